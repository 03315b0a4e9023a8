"""Progress of long work: few whole lines in a log, a bar on a terminal, and one module that all commands use."""

from __future__ import annotations

import contextlib
import io
import os
import pty
import subprocess
import sys
import time
from pathlib import Path

import pytest
from convert_support import write_demos
from source_tree import PACKAGE, REPOSITORY, imports

from robocasa_lerobot.progress import LINE_SECONDS, Bar, Rows


def test_a_log_gets_a_line_now_and_then_and_one_at_the_end() -> None:
    log = io.StringIO()
    with Bar(total=60, file=log, desc="working", unit="piece", line_seconds=0.25) as bar:
        for _ in range(60):
            time.sleep(0.01)
            bar.update()
            bar.refresh()  # as who polls files does
    lines = log.getvalue().splitlines()
    assert "\r" not in log.getvalue()
    assert 2 <= len(lines) <= 4
    assert all(line.startswith("working: ") for line in lines)
    assert "60/60" in lines[-1]


def test_short_or_passing_work_leaves_one_line_or_none() -> None:
    for leave, number in ((True, 1), (False, 0)):
        log = io.StringIO()
        assert list(Bar(range(5), file=log, desc="working", leave=leave)) == list(range(5))
        assert len(log.getvalue().splitlines()) == number
    log = io.StringIO()
    assert list(Bar(range(5), file=log, disable=True)) == list(range(5))
    assert not log.getvalue()


def _everything(terminal: int) -> str:
    """What was written to a terminal whose other end has been closed; it may come in several pieces."""
    parts = []
    with contextlib.suppress(OSError):  # how a terminal says that there is no more
        while part := os.read(terminal, 1 << 16):
            parts.append(part)
    os.close(terminal)
    return b"".join(parts).decode()


def test_a_terminal_gets_a_bar_that_is_drawn_over() -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal, Bar(total=3, file=terminal, desc="working", mininterval=0) as bar:
        for _ in range(3):
            bar.update()
    shown = _everything(ours)
    assert shown.count("working") > 2
    assert shown.count("\r") > 2
    assert shown.count("\n") == 1


def test_of_several_things_each_has_its_turn_in_a_log(capsys: pytest.CaptureFixture[str]) -> None:
    now = [0.0]
    with Rows(["long", "b"], clock=lambda: now[0]) as rows:
        for step in range(100):
            now[0] = float(step)
            rows.update("long", step, 100, f"{step} of 100")
            rows.update("b", step, 100, f"{step} of 100")
        rows.finish("b", "[1/2] b done")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 + 99 // LINE_SECONDS
    assert {line.split()[0] for line in lines[:-1]} == {"long", "b"}
    assert lines[-1] == "[1/2] b done"


@pytest.mark.costly
def test_convert_writes_few_lines_into_a_log(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "demos.hdf5", [60] * 4, images=128)
    command = ["convert", str(source), "--out", str(tmp_path / "data"), "--workers", "1"]
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "robocasa_lerobot.cli", *command], capture_output=True, text=True, check=True
    )
    lines = [line for line in done.stderr.splitlines() if "converting" in line]
    assert "\r" not in done.stderr
    assert len(lines) <= 1 + (time.monotonic() - began) // LINE_SECONDS
    assert "240/240" in lines[-1]


@pytest.mark.parametrize("folder", [PACKAGE, REPOSITORY / "benchmarks"], ids=lambda folder: folder.name)
def test_nobody_else_draws_bars(folder: Path) -> None:
    files = [path for path in folder.rglob("*.py") if ".venvs" not in path.parts and path != PACKAGE / "progress.py"]
    assert len(files) > 20
    drawing = [path.name for path in files if any(n.split(".")[0] in ("tqdm", "rich") for n in imports(path))]
    assert not drawing
