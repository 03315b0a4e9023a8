"""Starting and burying the processes of an evaluation.

They are forked from a server process that has done the slow imports once (Python's forkserver), so that a worker is
there at once and shares that memory. The server has the environment of its own start: what a worker needs of the
present one is handed over.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import forkserver
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path

from robocasa_lerobot.evaluation.imports.policy_imports import POLICY_MODULES, policy_imports

# What they run: a module, which this process does without, and a function in it.
WORKER = ("robocasa_lerobot.evaluation.run.worker", "worker_main")
POLICY_SERVER = ("robocasa_lerobot.evaluation.run.policy_server", "server_main")


def cause_of_death(process: ForkServerProcess, what: str = "worker process") -> str:
    """Why a process has ended, in words."""
    process.join(timeout=10)
    code = process.exitcode
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        note = " (out of memory?)" if name == "SIGKILL" else ""
        return f"the {what} was ended by {name}{note}"
    return f"the {what} ended with exit status {code}"


def process_context(checkpoints: bool) -> ForkServerContext:
    """The context that processes are started in; with `checkpoints`, what any policy needs is imported beforehand."""
    return _forking(POLICY_MODULES if checkpoints else ())


def start_importing(checkpoints: Collection[Path], threads: int, own_process: bool) -> None:
    """Start the server process, whose imports take seconds, while this one still reads what it is to do.

    Before it, this process has what the workers are to have in their environment when libraries are loaded.

    Args:
        checkpoints: folders of the policies that the workers will compute.
        threads: of the numeric libraries, which the workers have from it.
        own_process: whether this process computes no other policies, so that what these do not need can be left out.
    """
    _forking(policy_imports(checkpoints) if own_process else POLICY_MODULES if checkpoints else ())
    with thread_limit(threads):
        forkserver.ensure_running()


def _forking(imports: Sequence[str]) -> ForkServerContext:
    """The context whose server process imports these; what it has imported stays, once it is started."""
    context = multiprocessing.get_context("forkserver")
    # An import that fails there is silently left to the worker, which reports it.
    context.set_forkserver_preload([*imports, WORKER[0], POLICY_SERVER[0]])
    return context


def run_in(what: tuple[str, str], *arguments: object) -> None:
    """Call a function of a module with these arguments; the target of a new process, which imports the module."""
    module, function = what
    getattr(importlib.import_module(module), function)(*arguments)


def take_over(environment: dict[str, str]) -> None:
    """Give this process the environment of the one that asked for it."""
    os.environ.clear()
    os.environ.update(environment)


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
