"""Progress of long work, the same for all commands: bars on a terminal, a line every ten seconds in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from tqdm import tqdm

if TYPE_CHECKING:
    from rich.progress import TaskID

    _Tqdm = tqdm[Any]
else:
    _Tqdm = tqdm

# Between two lines where there is no terminal: a log that runs for a day has 8,640 of them.
LINE_SECONDS = 10.0


class Bar(_Tqdm):
    """tqdm's bar; where its file is no terminal, whole lines instead, one every `line_seconds` and one at the end.

    Work that ends sooner leaves its last line only, or none with `leave=False`. Other arguments are tqdm's.
    """

    def __init__(self, *args: Any, line_seconds: float = LINE_SECONDS, **kwargs: Any) -> None:
        self._terminal = (kwargs.get("file") or sys.stderr).isatty()
        self._line_seconds, self._printed = line_seconds, time.monotonic()
        super().__init__(*args, **kwargs)

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Draw the bar, or write a line if the last one was long enough ago; tqdm calls this."""
        if self._terminal:
            super().display(msg, pos)
        elif time.monotonic() - self._printed >= self._line_seconds:
            self._write_line()

    def clear(self, *args: Any, **kwargs: Any) -> None:
        """Wipe the bar off a terminal; lines stay."""
        if self._terminal:
            super().clear(*args, **kwargs)

    def close(self) -> None:
        """Leave the bar, or its last line."""
        if self._terminal or self.disable:
            super().close()
            return
        if self.leave:
            self._write_line()
        self.disable = True
        self._decr_instances(self)  # type: ignore[attr-defined]  # tqdm takes it off its list of open bars

    def _write_line(self) -> None:
        self._printed = time.monotonic()
        self.fp.write(f"{self}\n")
        self.fp.flush()


class Rows:
    """Progress of several named jobs at once: a bar for each on a terminal; elsewhere one line at a time.

    Args:
        names: of all jobs that will be shown; they line up.
        show: nothing is shown if False.
        clock: seconds, for tests.
    """

    def __init__(self, names: list[str], *, show: bool = True, clock: Callable[[], float] = time.monotonic) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        self._width = max((len(name) for name in names), default=0)
        self._show = show and bool(names)
        self._clock, self._printed = clock, clock()
        self._waiting: dict[str, str] = {}  # lines not yet written, the longest waiting job first
        self._tasks: dict[str, TaskID] = {}
        console = Console(file=sys.stderr)
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[text]}"),
            console=console,
            disable=not (self._show and console.is_terminal),
            transient=True,
        )

    def update(self, name: str, done: int, total: int, text: str) -> None:
        """Show how far a job is, in numbers and words."""
        if not self._bars.disable:
            if name not in self._tasks:
                self._tasks[name] = self._bars.add_task(f"{name:<{self._width}}", total=total, text="")
            self._bars.update(self._tasks[name], completed=done, text=text)
            return
        self._waiting[name] = text
        if self._show and self._clock() - self._printed >= LINE_SECONDS:
            self._printed = self._clock()
            first = next(iter(self._waiting))
            self._print(f"{first:<{self._width}}  {self._waiting.pop(first)}")

    def finish(self, name: str, text: str) -> None:
        """Take a job's bar away and leave a line."""
        self._waiting.pop(name, None)
        if name in self._tasks:
            self._bars.remove_task(self._tasks.pop(name))
        if self._show:
            self._print(text)

    def _print(self, text: str) -> None:
        if self._bars.disable:
            print(text, file=sys.stderr, flush=True)
        else:
            self._bars.console.print(text, highlight=False, markup=False)

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()
