"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ASIDE = ".partial"  # at the end, so that no pattern for finished files finds one that is being written


@contextmanager
def written_aside(path: Path, *, by_many: bool = False) -> Iterator[Path]:
    """A path beside `path` to write to, which takes its name at the end; if the body fails, it goes.

    Where processes may write the same file at once, `by_many` gives each a path of its own, and the last one stays.
    """
    own = f".{platform.node()}-{os.getpid()}" if by_many else ""
    aside = path.with_name(f"{path.name}{own}{_ASIDE}")
    try:
        yield aside
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all, UTF-8."""
    with written_aside(path) as aside:
        aside.write_text(text, encoding="utf-8")
