"""What a piece of work takes of a machine, and what keeps more processes from doing more."""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from types import TracebackType
from typing import Self

import psutil

GOOD = 0.9  # of as many times the work as there are processes
DEARER = 1.15  # times the processor seconds of one process for the same work
ALL_BUSY = 0.95  # of all cores
FULL = 0.85  # of the memory
_INTERVAL_S = 0.2


@dataclass(frozen=True)
class Use:
    """What some work took.

    Attributes:
        cores: how many were busy on average, whoever used them.
        processor_s: seconds of processor for each step or frame.
        memory_gib: the most that was used beyond what was in use before.
        memory_share: the most that was in use of all memory, by everybody.
    """

    cores: float
    processor_s: float
    memory_gib: float
    memory_share: float

    @classmethod
    def median(cls, uses: Sequence[Use]) -> Use:
        """Of each value by itself."""
        return cls(**{f.name: statistics.median(getattr(use, f.name) for use in uses) for f in fields(cls)})


class Watch:
    """Notes from its start to its end how busy the cores are and how full the memory is."""

    def __enter__(self) -> Self:
        self._ended = threading.Event()
        self._before = self._most = psutil.virtual_memory().used
        self._busy, self._started = _busy_s(), time.perf_counter()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()
        self._busy, self._seconds = _busy_s() - self._busy, time.perf_counter() - self._started

    def use(self, done: float) -> Use:
        """What it was, for so many steps or frames."""
        return Use(
            cores=round(self._busy / self._seconds, 2),
            processor_s=self._busy / done,
            memory_gib=round((self._most - self._before) / 2**30, 2),
            memory_share=round(self._most / psutil.virtual_memory().total, 3),
        )

    def _look(self) -> None:
        while not self._ended.wait(_INTERVAL_S):
            self._most = max(self._most, psutil.virtual_memory().used)


def limit(processes: int, cores: int, times_one: float, use: Use, of_one: Use) -> str:
    """Why so many processes do no more than this many times the work of one; the nearest wall in plain words."""
    if use.memory_share > FULL:
        return f"memory: {use.memory_share:.0%} in use"
    if times_one >= GOOD * processes:
        return "" if processes < cores else "nothing yet: as many processes as cores"
    dearer = use.processor_s / of_one.processor_s
    busy = use.cores >= ALL_BUSY * cores
    if dearer > DEARER:
        shared = "; all cores are busy" if busy else ""
        return f"each step takes {dearer:.2f}x the processor: caches, memory or threads are shared{shared}"
    if busy:
        return f"all {cores} cores are busy: one process uses {of_one.cores:.1f}"
    return f"waiting: {use.cores:.1f} of {cores} cores are busy (start, disk, GPU, or one process for all)"


def _busy_s() -> float:
    """Seconds of processor used by everybody since the start of the machine."""
    times = psutil.cpu_times()
    idle = times.idle + getattr(times, "iowait", 0.0)
    total = sum(times) - getattr(times, "guest", 0.0) - getattr(times, "guest_nice", 0.0)
    return float(total - idle)
