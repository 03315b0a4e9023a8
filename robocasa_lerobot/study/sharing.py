"""A study that several processes carry out together: on one machine, or on nodes of a cluster with one disk."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from robocasa_lerobot.jobs.child_process import start_command, stop_signals_to
from robocasa_lerobot.jobs.locks import LockHeldError, locked
from robocasa_lerobot.study.runs import Run, StoppedError, threads_variable

_MOST_AT_ONCE = 4  # each holds a policy, its optimizer and a share of the frames: about 3 GB in the small experiments


def trainings_at_once(asked: int | None, runs: int, cores: int, cuda: bool) -> int:
    """How many of `runs` trainings go on beside each other: as many as asked for, or by default one for each core.

    Small policies use a second one badly: two with one thread each make 15 steps a second together where one with two
    threads makes 11.8 (the demo's policy on two cores). On a GPU it is one.
    """
    return max(1, min(asked or (1 if cuda else min(cores, _MOST_AT_ONCE)), runs))


def threads_of_each(at_once: int, cores: int) -> int | None:
    """Threads of a training beside the others; None leaves them to torch, where it is alone."""
    return max(1, cores // at_once) if at_once > 1 else None


def shared_runs(runs: Sequence[Run], ended: Callable[[Run], bool], root: Path) -> Iterator[Run]:
    """The runs that have not ended, each held by this process until the next is asked for.

    One that another process holds comes last, when that has let go of it, if it has not ended it.
    """
    root.mkdir(parents=True, exist_ok=True)
    left = list(runs)
    while left:
        elsewhere = []
        for run in left:
            if ended(run):
                continue
            with ExitStack() as held:
                try:
                    held.enter_context(locked(_lock(run, root), wait=False))
                except LockHeldError:
                    elsewhere.append(run)
                    continue
                if not ended(run):  # in the meantime
                    yield run
        if elsewhere:
            print(f"== {elsewhere[0].name} is run by another process: waiting for it", flush=True)
            with locked(_lock(elsewhere[0], root), wait=True):
                pass
        left = elsewhere


@contextmanager
def alone(root: Path, work: str) -> Iterator[None]:
    """Do a kind of work of a study in one process at a time; the others wait, and say so."""
    path = root / f".{work}.lock"
    with ExitStack() as held:
        try:
            held.enter_context(locked(path, wait=False))
        except LockHeldError:
            print(f"another process is at the {work}: waiting", flush=True)
            held.enter_context(locked(path, wait=True))
        yield


@contextmanager
def helped_by(number: int, arguments: Sequence[str], root: Path, threads: int | None) -> Iterator[None]:
    """Have so many further processes carry out the same study, given by its arguments, until the end of the context.

    They write to `helper_N.log` in `root`. Where the context ends with an error or a signal, they save and end as well.

    Raises:
        StoppedError: one of them did not end well, or a signal asked this process to end.
    """
    if not number:
        yield
        return
    root.mkdir(parents=True, exist_ok=True)
    logs = [root / f"helper_{one}.log" for one in range(1, number + 1)]
    with ExitStack() as stack:
        helpers = []
        for log in logs:
            file = stack.enter_context(log.open("a", encoding="utf-8"))
            helper = start_command(["study", *arguments], threads_variable(threads), file)
            helpers.append(stack.enter_context(helper))
        print(f"{number} more beside this one: {', '.join(map(str, logs))}", flush=True)
        stack.enter_context(stop_signals_to(_stop))
        try:
            yield
            statuses = [helper.wait() for helper in helpers]
        except BaseException:
            for helper in helpers:
                helper.terminate()
            for helper in helpers:  # before its input is closed, which would end it at once
                helper.wait()
            raise
    for log, status in zip(logs, statuses, strict=True):
        if status:
            raise StoppedError(f"a process beside this one ended with status {status}; its words are in {log}.")


def _stop(number: int, _frame: object) -> None:
    raise StoppedError(f"ended by {signal.Signals(number).name}; the same study goes on there.")


def _lock(run: Run, root: Path) -> Path:
    return root / f".{run.experiment}-seed_{run.seed}.lock"
