"""A training on a CPU in several processes, each with a part of the cores and of every batch.

The kernels of a small network take microseconds, and threads that share them mostly wait for each other: two threads
train `make demo`'s policy hardly faster than one. Two processes with a thread each share nothing but gradients.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.parent import end_with
from robocasa_lerobot.jobs.workers import cores_here

AUTOMATIC = 0
_MOST = 8  # of those that are chosen: more of a small batch would wait for each other again
_RANK, _WORLD = "RANK", "WORLD_SIZE"
_ENDING_SECONDS = 60.0


def launched() -> bool:
    """Whether this process is one of several already, as `accelerate launch` and `torchrun` start them."""
    return _RANK in os.environ or int(os.environ.get(_WORLD, "1")) > 1


def processes_for(asked: int, shares: Sequence[int], cores: int | None = None) -> int:
    """How many processes train: as many as were asked for, or one for each core as far as parts of batches allow.

    Args:
        asked: of the experiment; `AUTOMATIC` chooses.
        shares: samples that go through the policy at once, of each phase: processes have equal parts of them.
        cores: to share; None is those of this machine that this process may use, or as many as `OMP_NUM_THREADS` says.
    """
    if asked != AUTOMATIC:
        return asked
    most = min(_cores() if cores is None else cores, _MOST)
    return next(n for n in range(max(most, 1), 0, -1) if all(share % n == 0 for share in shares))


def in_processes[T](count: int, work: Callable[..., T], **arguments: Any) -> T:
    """What `work(**arguments)` returns here, where `count` - 1 further processes do the same beside it.

    They find each other by the variables that Accelerate and torch read, and end with this one. Only this one prints,
    and is to be asked to end. `work` and `arguments` can be pickled, but for what is None there: see `_follow`.

    Raises:
        UserError: one of them has ended before this one.
    """
    if count == 1:
        return work(**arguments)
    context = multiprocessing.get_context("spawn")
    with _one_of(count), _started(context, count, work, arguments) as others:
        try:
            return work(**arguments)
        except RuntimeError as error:
            gone = [(n, other.exitcode) for n, other in enumerate(others, start=1) if other.exitcode]
            if not gone or isinstance(error, UserError):
                raise
            rank, status = gone[0]
            what = f"by {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
            raise UserError(
                f"process {rank} of the {count} that train here has ended {what}; what it said stands above. The same "
                "command goes on; `--cpu_processes=1` trains in one process, which takes less memory."
            ) from error


@contextmanager
def threads_for(processes: int) -> Iterator[None]:
    """As many threads for torch as one of so many processes has; all that there were, for one."""
    import torch

    before = torch.get_num_threads()
    if processes > 1:
        torch.set_num_threads(_threads(processes))
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _threads(processes: int) -> int:
    return max(1, _cores() // processes)


def _cores() -> int:
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores_here(), int(asked)) if asked.isdecimal() and int(asked) else cores_here()


@contextmanager
def _one_of(count: int) -> Iterator[None]:
    """This process as the first of so many: where the others find it, and how many threads it has."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    values = {
        _WORLD: count,
        "LOCAL_WORLD_SIZE": count,
        _RANK: 0,
        "LOCAL_RANK": 0,
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": port,
        "ACCELERATE_USE_CPU": "true",
        "OMP_NUM_THREADS": _threads(count),
    }
    before = {name: os.environ.get(name) for name in values}
    os.environ.update({name: str(value) for name, value in values.items()})
    loaded = "torch" in sys.modules  # and has read its variable
    try:
        with threads_for(count) if loaded else nullcontext():
            yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@contextmanager
def _started(
    context: multiprocessing.context.SpawnContext, count: int, work: Callable[..., Any], arguments: dict[str, Any]
) -> Iterator[list[BaseProcess]]:
    """The other processes, which have ended when this ends."""
    others: list[BaseProcess] = []
    try:
        for rank in range(1, count):
            os.environ.update({_RANK: str(rank), "LOCAL_RANK": str(rank)})
            others.append(context.Process(target=_follow, args=(work, arguments), daemon=True))
            others[-1].start()
        os.environ.update({_RANK: "0", "LOCAL_RANK": "0"})
        yield others
        for other in others:
            other.join(_ENDING_SECONDS)
    finally:
        for other in others:
            other.kill()
            other.join()


def _follow(work: Callable[..., Any], arguments: dict[str, Any]) -> None:
    """One of the others: it says nothing but what no first process would, and takes Ctrl-C from that alone."""
    end_with(multiprocessing.parent_process())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
        try:
            work(**arguments)
        except UserError:  # the first one says it
            sys.exit(2)
