"""Progress of a recording: for each task episodes, success rate and time left; bars on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from types import TracebackType

from robocasa_lerobot.demos.attempts import RecordingSettings, Tally
from robocasa_lerobot.progress import Rows


class Board:
    """Shows tallies of tasks. Tasks appear when they are first worked on, and stay as one line when they are done.

    Args:
        tasks: settings of all that are to be done.
        show: nothing is shown if False.
        clock: seconds, for tests.
    """

    def __init__(
        self, tasks: Sequence[RecordingSettings], *, show: bool = True, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._tasks = [settings.task for settings in tasks]
        self._width = max((len(name) for name in self._tasks), default=0)
        self._clock = clock
        self._begun: dict[str, tuple[float, int]] = {}  # when this run first saw a task work, attempts done by then
        self._seen: dict[str, int] = {}
        self._finished = 0
        self._rows = Rows(self._tasks, show=show, clock=clock)

    def update(self, settings: RecordingSettings, tally: Tally) -> None:
        """Show how far a task is; its clock runs from the first call on."""
        name, done = settings.task, len(tally.done)
        self._begun.setdefault(name, (self._clock(), done))
        if self._seen.get(name) == done:
            return
        self._seen[name] = done
        succeeded = min(sum(tally.done.values()), settings.episodes)
        self._rows.update(name, succeeded, settings.episodes, self.line(settings, tally))

    def finish(self, settings: RecordingSettings, tally: Tally) -> None:
        """Say that a task is done, or given up."""
        self._finished += 1
        number = f"[{self._finished}/{len(self._tasks)}]"
        short = "" if len(tally.chosen) == settings.episodes else ", given up"
        rate = 1 - len(tally.failures) / max(tally.tried, 1)
        self._rows.finish(
            settings.task,
            f"{number} {settings.task:<{self._width}}  {len(tally.chosen)} episodes, "
            f"{rate:.0%} of {tally.tried} attempts succeeded{short}",
        )

    def line(self, settings: RecordingSettings, tally: Tally) -> str:
        """Episodes, success rate and time left, in words."""
        succeeded, done = sum(tally.done.values()), len(tally.done)
        words = [f"{min(succeeded, settings.episodes)}/{settings.episodes} episodes"]
        if done:
            words.append(f"{tally.rate:.0%} of {done} attempts succeed")
        left = self.seconds_left(settings, tally)
        if left:
            words.append(f"{_span(left)} left")
        return ", ".join(words)

    def seconds_left(self, settings: RecordingSettings, tally: Tally) -> float | None:
        """Time that the task still takes if it goes on as since this run began it; None where nothing is known."""
        begun, before = self._begun.get(settings.task, (0.0, 0))
        made, succeeded = len(tally.done) - before, sum(tally.done.values())
        if made <= 0 or succeeded == 0:
            return None
        missing = max(settings.episodes - succeeded, 0)
        return (self._clock() - begun) / made * missing / tally.rate

    def __enter__(self) -> Board:
        self._rows.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._rows.__exit__(kind, error, trace)


def _span(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"
