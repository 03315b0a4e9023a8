"""Imports that take seconds, as LeRobot's: less looking for garbage, less of them, and beside those of workers."""

from __future__ import annotations

import gc
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager

# New objects after which Python looks for garbage, 700 by default in 3.12. Imports leave nearly none: looking for it
# took a tenth of the time of LeRobot's, 6 seconds, and takes nearly none with so many.
_ALLOCATIONS = 5000
# What LeRobot imports where it is installed, and uses in its policies and their training alone.
POLICY_PACKAGES = ("transformers", "diffusers", "peft")


@contextmanager
def rare_collections() -> Iterator[None]:
    """Have Python look for garbage less often within the block, unless it does so already, or never (0)."""
    before = gc.get_threshold()
    gc.set_threshold(max(_ALLOCATIONS, before[0]) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def left_out(packages: Collection[str]) -> Iterator[None]:
    """Have packages count as not installed within the block, in which LeRobot is imported, and as before after it.

    LeRobot can do without what its extras bring, and imports what is there all the same: transformers, diffusers and
    peft were 2.5 of its 6.5 seconds. It looks once: what of it is imported within the block stays without them, so this
    is for processes that do one job, which needs none of them. What is imported already stays.
    """
    hidden = [name for name in packages if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]  # None: Python's way to say that there is none
    try:
        yield
    finally:
        for name in hidden:
            if sys.modules.get(name, name) is None:
                del sys.modules[name]


def start_importing(modules: Sequence[str]) -> None:
    """Start the process that the workers of a `PoolExecutor` are forked from, while this one imports as well.

    Workers have the environment that this process has now.

    Args:
        modules: what that process imports, and the pool asks for as its `preload`.
    """
    import multiprocess
    from multiprocess import forkserver

    multiprocess.set_forkserver_preload(list(modules))
    forkserver.ensure_running()
