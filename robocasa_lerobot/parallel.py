"""Independent pieces of work on several processes: datatrove's executor and completion markers, without its noise."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import multiprocess
from datatrove.executor.local import LocalPipelineExecutor
from datatrove.utils.logging import logger as datatrove_logger

POLL_SECONDS = 0.3


class PoolExecutor(LocalPipelineExecutor):
    """datatrove's local executor (a completion marker for each piece) on a plain pool of processes.

    datatrove's own pool starts a managing process for its log lines, which stays behind when this one is killed.
    Log files are still written to its `logging_dir`, and errors arrive as exceptions.

    Args:
        initializer: called once in every process that works, this one too if it works alone.
        preload: modules whose slow imports are done once, in the process that workers are forked from.
    """

    def __init__(
        self, *args: Any, initializer: Callable[[], None] | None = None, preload: Sequence[str] = (), **kwargs: Any
    ) -> None:
        super().__init__(*args, **kwargs)
        self._initializer = initializer
        self._preload = list(preload)

    def run(self) -> None:
        """Run every piece that has no completion marker yet."""
        ranks = self.get_incomplete_ranks()
        _start_worker(self._initializer)
        if self.workers == 1:
            for rank in ranks:
                self._run_for_rank(rank)
            return
        multiprocess.set_forkserver_preload(self._preload)
        context = multiprocess.get_context("forkserver")
        with context.Pool(self.workers, initializer=_start_worker, initargs=(self._initializer,)) as pool:
            for _ in pool.imap_unordered(self._run_for_rank, ranks):
                pass


def exit_if_orphaned() -> None:
    """End this worker at once if the process that started it was killed: the next run must not meet it writing."""
    parent = multiprocess.parent_process()
    if parent is not None and not parent.is_alive():
        os._exit(1)


@contextlib.contextmanager
def polled(show: Callable[[], None]) -> Iterator[None]:
    """Call `show` from a thread while the body runs: progress of workers that leave files."""
    stop = threading.Event()

    def watch() -> None:
        while not stop.wait(POLL_SECONDS):
            show()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def _start_worker(initializer: Callable[[], None] | None) -> None:
    datatrove_logger.disable("datatrove")
    if initializer is not None:
        initializer()
