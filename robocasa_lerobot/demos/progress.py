"""Progress of a recording: for each task episodes, success rate and time left; bars on a terminal, lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn

from robocasa_lerobot.demos.attempts import RecordingSettings, Tally

# Between two lines about a task, where there is no terminal; less than a minute between rounds.
_LINE_SECONDS = 30.0


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
        self._printed: dict[str, float] = {}
        self._rows: dict[str, TaskID] = {}
        self._finished = 0
        self._show = show and bool(tasks)
        console = Console(file=sys.stderr)
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[text]}"),
            console=console,
            disable=not (self._show and console.is_terminal),
            transient=True,
        )
        self._live = not self._bars.disable

    def update(self, settings: RecordingSettings, tally: Tally) -> None:
        """Show how far a task is; its clock runs from the first call on."""
        name, done, now = settings.task, len(tally.done), self._clock()
        if name not in self._begun or done == self._begun[name][1]:
            self._begun.setdefault(name, (now, done))
            self._printed.setdefault(name, now)
        if not self._show or self._seen.get(name) == done:
            return
        self._seen[name] = done
        line = self.line(settings, tally)
        if self._live:
            if name not in self._rows:
                self._rows[name] = self._bars.add_task(f"{name:<{self._width}}", total=settings.episodes, text="")
            succeeded = min(sum(tally.done.values()), settings.episodes)
            self._bars.update(self._rows[name], completed=succeeded, text=line)
        elif now - self._printed[name] >= _LINE_SECONDS:
            self._printed[name] = now
            self._print(f"{name:<{self._width}}  {line}")

    def finish(self, settings: RecordingSettings, tally: Tally) -> None:
        """Say that a task is done, or given up."""
        self._finished += 1
        if settings.task in self._rows:
            self._bars.remove_task(self._rows.pop(settings.task))
        if self._show:
            number = f"[{self._finished}/{len(self._tasks)}]"
            short = "" if len(tally.chosen) == settings.episodes else ", given up"
            rate = 1 - len(tally.failures) / max(tally.tried, 1)
            self._print(
                f"{number} {settings.task:<{self._width}}  {len(tally.chosen)} episodes, "
                f"{rate:.0%} of {tally.tried} attempts succeeded{short}"
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

    def _print(self, text: str) -> None:
        if self._live:
            self._bars.console.print(text, highlight=False, markup=False)
        else:
            print(text, file=sys.stderr, flush=True)

    def __enter__(self) -> Board:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()


def _span(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"
