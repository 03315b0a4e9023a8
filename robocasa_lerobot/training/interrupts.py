"""Requests to save and end: a number of steps, or a signal of the system that runs the job."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

from robocasa_lerobot.jobs.child_process import stop_signals_to

REQUEUE = 75  # exit status "try again later" (EX_TEMPFAIL of sysexits.h): saved on a signal
STOPPED = 3  # exit status: saved after the number of steps that was asked for


class Interrupts:
    """Whether training has been asked to save and end; `stop` is asked once after each step."""

    def __init__(self, stop_after: int | None = None) -> None:
        self.stop_after, self.signalled, self._steps = stop_after, False, 0

    def stop(self) -> bool:
        """Whether to save and end after this step."""
        self._steps += 1
        return self.due

    @property
    def due(self) -> bool:
        """Whether no further step is to be made."""
        return self.signalled or (self.stop_after is not None and self._steps >= self.stop_after)

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take signals inside this context, and leave them to whoever had them before after it."""

        def on_signal(*_: object) -> None:
            self.signalled = True

        with ExitStack() as stack:
            with suppress(ValueError):  # not in the main thread
                stack.enter_context(stop_signals_to(on_signal))
            yield
