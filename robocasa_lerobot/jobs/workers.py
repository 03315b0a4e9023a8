"""Cores and memory of this machine, and how many processes a piece of work takes."""

from __future__ import annotations

import os

from robocasa_lerobot.errors import UserError

_MAX_AUTOMATIC_WORKERS = 8


def cores_here() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory_bytes() -> int:
    """Memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def automatic_workers(pieces: int, work: int, least_work: int, cores_each: int = 1) -> int:
    """By cores, number of pieces, and the least work that pays for starting a process; `work` is all there is."""
    return max(1, min(cores_here() // cores_each, _MAX_AUTOMATIC_WORKERS, pieces, work // least_work))


def check_workers(asked: int | None) -> None:
    """Refuse a number of processes that does nothing, before any work has begun; None is one that is chosen later.

    Raises:
        UserError: fewer than one was asked for.
    """
    if asked is not None and asked < 1:
        raise UserError(f"--workers is {asked}, expected at least 1.")


def num_workers(asked: int | None, pieces: int, work: int, least_work: int, cores_each: int = 1) -> int:
    """As many as were asked for, at most one for each piece; None chooses, one for each `cores_each` cores.

    Raises:
        UserError: fewer than one was asked for.
    """
    check_workers(asked)
    if asked is None:
        return automatic_workers(pieces, work, least_work, cores_each)
    return min(asked, pieces)
