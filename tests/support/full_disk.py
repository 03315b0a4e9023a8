"""A disk that is full after so many bytes of a file, as far as a process can tell, and an episode to fill it."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from robocasa_lerobot.demos.recorder import Recording

STEPS = 60


@contextmanager
def full_after(size: int) -> Iterator[None]:
    """No file of this process gets longer than so many bytes: writing beyond is an OSError, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))  # Python has the signal ignored that comes with it
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def recording() -> Recording:
    """An episode of numbers that do not pack well."""
    rng = np.random.default_rng(0)
    return Recording(
        seed=1,
        success=True,
        reason="",
        false_terms=(),
        states=rng.normal(size=(STEPS, 90)),
        actions=rng.normal(size=(STEPS, 12)),
        observations={"picture": rng.integers(0, 256, (STEPS, 16, 16, 3), dtype=np.uint8)},
        rewards=np.zeros(STEPS),
        stages=np.zeros(STEPS, dtype=np.int32),
        success_terms=np.ones((STEPS, 1), dtype=bool),
        term_names=("closed",),
        model_file="<mujoco/>" * 3000,
        assets={"one.png": b"p" * 5000},
        ep_meta={"lang": "Close the drawer."},
    )
