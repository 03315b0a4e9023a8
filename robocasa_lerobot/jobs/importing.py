"""Imports that take seconds, as LeRobot's: less looking for garbage, and at the same time as those of workers."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# New objects after which Python looks for garbage, 700 by default in 3.12. Imports leave nearly none: looking for it
# took a tenth of the time of LeRobot's, 6 seconds, and takes nearly none with so many.
_ALLOCATIONS = 5000


@contextmanager
def rare_collections() -> Iterator[None]:
    """Have Python look for garbage less often within the block, unless it does so already, or never (0)."""
    before = gc.get_threshold()
    gc.set_threshold(max(_ALLOCATIONS, before[0]) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def start_importing(module: str) -> None:
    """Start the process that the workers of a `PoolExecutor` are forked from, while this one imports as well.

    Workers have the environment that this process has now.

    Args:
        module: what that process imports, and the pool asks for as its only `preload`.
    """
    import multiprocess
    from multiprocess import forkserver

    multiprocess.set_forkserver_preload([module])
    forkserver.ensure_running()
