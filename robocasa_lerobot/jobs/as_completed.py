"""Work that falls into independent jobs, in several processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from robocasa_lerobot.errors import WorkerDiedError
from robocasa_lerobot.jobs.parent import end_with


def as_they_end[Result](
    function: Callable[..., Result], jobs: Sequence[tuple[Any, ...]], workers: int
) -> Iterator[Result]:
    """A function's results for the arguments of each job, in the order in which they end; here if one process will do.

    Jobs that have not begun are dropped where nobody asks for further results.

    Raises:
        WorkerDiedError: one of the processes has ended before its time.
    """
    if workers <= 1 or len(jobs) <= 1:
        for job in jobs:
            yield function(*job)
        return
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["__main__", function.__module__])  # imported once, not by each process
    with ProcessPoolExecutor(min(workers, len(jobs)), mp_context=context, initializer=_end_with_parent) as pool:
        try:
            futures = [pool.submit(function, *job) for job in jobs]
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            raise WorkerDiedError(
                "a worker process died before it had a result; memory may have run out: try fewer workers."
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for jobs for ever."""
    end_with(multiprocessing.parent_process())
