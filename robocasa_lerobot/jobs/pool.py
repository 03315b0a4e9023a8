"""Independent pieces of work on several processes: datatrove's executor and completion markers, without its noise."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import multiprocess
from datatrove.executor.local import LocalPipelineExecutor
from datatrove.utils.logging import logger as datatrove_logger

from robocasa_lerobot.errors import WorkerDiedError
from robocasa_lerobot.jobs.parent import end_with

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
            # A pool puts a new process in the place of a dead one and waits forever for what that one was doing.
            processes = list(pool._pool)
            results = pool.imap_unordered(self._run_for_rank, ranks)
            for _ in ranks:
                while True:
                    try:
                        results.next(POLL_SECONDS)
                        break
                    except multiprocess.TimeoutError:
                        _check_alive(processes)

    def run_rank(self, rank: int) -> None:
        """Run one piece in this process, unless it has its completion marker."""
        _start_worker(self._initializer)
        self._run_for_rank(rank)


def _check_alive(processes: Sequence[Any]) -> None:
    """Raise WorkerDiedError if one of the processes has ended."""
    for process in processes:
        status = process.exitcode
        if status is None:
            continue
        cause = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        remedy = " (memory may have run out: try fewer workers)" if status == -signal.SIGKILL else ""
        raise WorkerDiedError(f"a worker process was ended by {cause}{remedy}; the same command goes on from here.")


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
    parent = multiprocess.parent_process()
    if parent is not None:
        end_with(parent)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches all: the parent ends its pool, and says so once
    if initializer is not None:
        initializer()
