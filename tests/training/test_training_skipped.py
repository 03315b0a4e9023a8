"""What a run could not do is in a file beside its phases, and only as long as it cannot be done."""

from __future__ import annotations

from pathlib import Path

from robocasa_lerobot.training.planning import skipped
from robocasa_lerobot.training.planning.skipped import Skipped


def test_what_is_recorded_is_read_and_a_later_run_writes_anew(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert skipped.read(out) == []
    first = Skipped("phase", "phase2", None, "none of its 20 tasks is registered")
    second = Skipped("partial", "phase1", "lifelong", 'without the task "A"')
    skipped.record(out, [first, second, first])
    assert skipped.read(out) == [first, second]
    assert str(second) == 'evaluation lifelong of phase1 is partial: without the task "A"'
    skipped.record(out, [second])
    assert skipped.read(out) == [second]
    skipped.record(out, [])
    assert skipped.read(out) == []
    assert list(out.iterdir()) == []
