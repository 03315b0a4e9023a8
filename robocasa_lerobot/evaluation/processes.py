"""Starting and burying the processes of an evaluation."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.context import SpawnProcess


def cause_of_death(process: SpawnProcess, what: str = "worker process") -> str:
    """Why a process has ended, in words."""
    process.join(timeout=10)
    code = process.exitcode
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        note = " (out of memory?)" if name == "SIGKILL" else ""
        return f"the {what} was ended by {name}{note}"
    return f"the {what} ended with exit status {code}"


@contextmanager
def thread_limit(threads: int) -> Iterator[None]:
    """Environment for a child that is about to start: its numeric libraries read these when they are loaded."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, str(threads)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
