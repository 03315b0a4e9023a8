"""What two commits' demonstrators did is compared recording by recording."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import same_demos

from robocasa_lerobot.benchmark.tasks import facts_of

REPOSITORY = Path(__file__).parents[2]


def test_every_atomic_task_is_recorded_in_one_of_both_splits() -> None:
    tasks = same_demos.chosen(5)
    assert sum(facts_of(name).kind == "atomic" for name in tasks) == 65
    assert len(tasks) == len(set(tasks)) == 125
    jobs = same_demos.jobs_of(tasks, 7)
    assert jobs[:2] == [f"{tasks[0]}/pretrain/7", f"{tasks[1]}/target/8"]


@pytest.mark.parametrize("other", [("b", 3, True), ("a", 4, True), ("a", 3, False)])
def test_what_differs_is_named(other: same_demos.Made) -> None:
    same = ("a", 3, True)
    assert same_demos.differing({"x": same, "y": same}, {"x": same, "y": other}) == ["y"]
    assert same_demos.differing({"x": same}, {"x": same}) == []


@pytest.mark.slow
def test_a_commit_does_the_same_as_itself(tmp_path: Path) -> None:
    out = tmp_path / "found.json"
    command = [sys.executable, "benchmarks/same_demos.py", "HEAD", "--tasks=CloseDrawer", f"--out={out}"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    found = json.loads(out.read_text(encoding="utf-8"))
    (before,), (now,) = (found["recordings"][side].values() for side in ("before", "now"))
    assert before[1] > 0
    assert (done.returncode == 0) == (before == now)
