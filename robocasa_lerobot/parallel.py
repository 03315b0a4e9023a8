"""Independent pieces of work spread over processes by datatrove, quietly, with the caller's own progress bar."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

from datatrove.executor.local import LocalPipelineExecutor
from datatrove.utils.logging import logger as datatrove_logger
from datatrove.utils.stats import PipelineStats

POLL_SECONDS = 0.5


class QuietExecutor(LocalPipelineExecutor):
    """datatrove's local executor (worker processes, a completion marker for each piece) without its log lines.

    Log files are still written to its `logging_dir`, and errors arrive as exceptions.
    """

    on_worker_start: Callable[[], None] | None = None

    def _launch_run_for_rank(self, *args: Any, **kwargs: Any) -> PipelineStats:
        datatrove_logger.disable("datatrove")  # here too, because it must happen in the worker process
        if self.on_worker_start is not None:
            self.on_worker_start()
        return super()._launch_run_for_rank(*args, **kwargs)

    def run(self) -> PipelineStats:
        """Run every piece that has no completion marker yet."""
        datatrove_logger.disable("datatrove")
        return super().run()


@contextlib.contextmanager
def polled(show: Callable[[], None]) -> Iterator[None]:
    """Call `show` twice a second from a thread while the body runs: progress of workers that leave files."""
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
