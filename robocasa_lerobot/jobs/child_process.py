"""Further Python processes: one that serves this one until its end of their pipe is closed, or a command of ours."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import IO, Any

from robocasa_lerobot.jobs.parent import END_WITH_INPUT

STOP_SIGNALS = (signal.SIGTERM, signal.SIGUSR1)  # Slurm sends the one it is told to before the time is over
# Not `-m`: the module would be there twice, and so would the classes of its messages.
_PROGRAM = "import sys; from {module} import serve; serve(*map(int, sys.argv[1:]))"


def start_serving(module: str, descriptors: Sequence[int], **environment: str) -> subprocess.Popen[bytes]:
    """Start a process that calls a module's `serve` with file descriptors, which it inherits.

    `environment` is added to this process's. Python's modules are found where this one finds them.
    """
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM.format(module=module), *map(str, descriptors)],
        pass_fds=descriptors,
        stdin=subprocess.DEVNULL,
        env=environment_of_python() | environment,
    )


def start_command(
    arguments: Sequence[str], environment: Mapping[str, str], log: IO[str] | None = None
) -> subprocess.Popen[bytes]:
    """Start a command of `robocasa-lerobot` that knows `--end-with-input`: it ends where this process is killed.

    Its output goes to `log` where there is one. `environment` is added to this process's.
    """
    return subprocess.Popen(
        [sys.executable, "-m", "robocasa_lerobot.cli", *arguments, END_WITH_INPUT],
        stdin=subprocess.PIPE,
        stdout=log,
        stderr=log,
        env={**os.environ, **environment},
    )


def run_command(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run such a command to its end and return its status, negative where a signal ended it.

    What asks this process to end is passed on to the command, which would otherwise go on alone; whoever had that
    signal before gets it when the command has ended.
    """
    taken: list[signal.Signals] = []
    with start_command(arguments, environment) as child:

        def pass_on(number: int, _frame: object) -> None:
            child.send_signal(number)
            taken.append(signal.Signals(number))

        with stop_signals_to(pass_on) as before:
            status = child.wait()
    for number in taken:
        if callable(handler := before[number]):
            handler(number, None)
    return status


@contextmanager
def stop_signals_to(handler: Callable[[int, FrameType | None], None]) -> Iterator[dict[signal.Signals, Any]]:
    """Inside, what asks this process to end goes to `handler` alone.

    Yields who had each signal before, and gets it back.

    Raises:
        ValueError: this is not the main thread: signals are not ours to handle.
    """
    before = {number: signal.signal(number, handler) for number in STOP_SIGNALS}
    try:
        yield before
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def environment_of_python() -> dict[str, str]:
    """This process's environment, in which a further Python finds this package."""
    places = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
