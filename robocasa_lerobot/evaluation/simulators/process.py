"""A foreign env's process: started in a user's interpreter, asked one question at a time, buried with a cause."""

from __future__ import annotations

import collections
import os
import signal
import subprocess
import threading
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from numpy.typing import NDArray

from robocasa_lerobot.evaluation.simulators.foreign_worker import FrameError, read_frame, write_frame

Arrays = dict[str, NDArray[Any]]
_WORKER = Path(__file__).with_name("foreign_worker.py")
# Of the interpreter that runs us; another one would look for its own packages there.
_OURS = ("PYTHONHOME", "VIRTUAL_ENV", "__PYVENV_LAUNCHER__")
_KEPT_LINES = 30
_END_SECONDS = 5.0


class SimulatorError(RuntimeError):
    """A foreign process died, answered nonsense, or its env raised; the message has the cause."""


class EnvRaisedError(SimulatorError):
    """The env, or what makes it, raised; `kind` is the name of the exception."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(kind, text)  # what pickle makes it again from
        self.kind = kind

    def __str__(self) -> str:
        return str(self.args[1])


class ForeignProcess:
    """One foreign worker; whatever it prints is kept for the cause of its death, and does not reach the protocol.

    Args:
        python: the interpreter; it looks for modules in this process's working directory and `PYTHONPATH` too.

    Raises:
        SimulatorError: the interpreter cannot be started.
    """

    def __init__(self, python: str) -> None:
        environment = {name: value for name, value in os.environ.items() if name not in _OURS}
        their_read, our_write = os.pipe()
        our_read, their_write = os.pipe()
        command = [python, str(_WORKER), str(their_read), str(their_write), str(os.getpid())]
        try:
            self._process = subprocess.Popen(
                command,
                pass_fds=(their_read, their_write),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment,
            )
        except OSError as error:
            for descriptor in (our_read, our_write):
                os.close(descriptor)
            raise SimulatorError(f"{python} cannot be started: {error}") from error
        finally:
            os.close(their_read)
            os.close(their_write)
        self._questions, self._answers = os.fdopen(our_write, "wb"), os.fdopen(our_read, "rb")
        self._ended_because: str | None = None
        self._printed: collections.deque[str] = collections.deque(maxlen=_KEPT_LINES)
        assert self._process.stdout is not None
        self._reader = threading.Thread(target=self._drain, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Of the foreign process."""
        return self._process.pid

    def ask_within(self, seconds: float, name: str, **message: Any) -> tuple[dict[str, Any], Arrays]:
        """As `ask`, where no worker pool watches: a process that has not answered within so many seconds is ended.

        Raises:
            EnvRaisedError, SimulatorError: as for `ask`, and where it was.
        """

        def end() -> None:
            self._ended_because = f"gave no answer to {name!r} within {seconds:g} s and was ended"
            self._process.kill()

        out_of_time = threading.Timer(seconds, end)
        out_of_time.daemon = True
        out_of_time.start()
        try:
            return self.ask(name, **message)
        finally:
            out_of_time.cancel()

    def ask(self, name: str, arrays: Arrays | None = None, **message: Any) -> tuple[dict[str, Any], Arrays]:
        """The answer to a question; it waits as long as it takes, and the worker pool ends what takes too long.

        Raises:
            EnvRaisedError: the other side answered with an exception.
            SimulatorError: it died, or its answer is none; the process is then ended.
        """
        if self._questions.closed:
            raise SimulatorError("the simulator's process has been ended")
        try:
            write_frame(self._questions, {"ask": name, **message}, arrays)
            answer, found = read_frame(self._answers)
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise SimulatorError(self._cause_of_death()) from None
        except FrameError as error:
            self.kill()
            raise SimulatorError(f"the simulator's process answered {name!r} with nonsense: {error}") from error
        if answer.get("answers") != name:
            self.kill()
            raise SimulatorError(
                f"the simulator's process answered {answer.get('answers')!r} to the question {name!r}."
            )
        if "error" in answer:
            raise EnvRaisedError(str(answer.get("kind")), str(answer["error"]).strip())
        return answer, found

    def close(self) -> None:
        """Ask the env to end, and end the process."""
        if self._process.poll() is None:
            with suppress(OSError, ValueError, FrameError):
                write_frame(self._questions, {"ask": "close"})
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_SECONDS)
        self.kill()

    def kill(self) -> None:
        """End the process at once."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for stream in (self._questions, self._answers):
            with suppress(OSError):
                stream.close()

    def _cause_of_death(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_SECONDS)
        code = self._process.poll()
        self._reader.join(1.0)
        if self._ended_because is not None:
            how = self._ended_because
        elif code is None:
            how = "closed its pipe"
        elif code < 0:
            how = f"was ended by {signal.Signals(-code).name}"
            how += " (out of memory?)" if code == -signal.SIGKILL else ""
        else:
            how = f"ended with exit status {code}"
        self.kill()
        said = "".join(f"\n  {line}" for line in self._printed)
        return f"the simulator's process {how}" + (f"; it last printed:{said}" if said else "")

    def _drain(self, stream: IO[bytes]) -> None:
        for line in stream:
            self._printed.append(line.decode(errors="replace").rstrip()[:500])
