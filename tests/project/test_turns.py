"""Costly tests take turns among the fast ones, and none of them never comes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from task_sample import TURNS, whose_turn

REPOSITORY = Path(__file__).parents[2]
FILE = "tests/convert/test_convert_verify.py"


def collected(*words: str) -> list[str]:
    pytest = [sys.executable, "-m", "pytest", "--collect-only", "--quiet", FILE, *words]
    done = subprocess.run(pytest, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return [line for line in done.stdout.splitlines() if "::" in line]


def test_every_costly_test_has_its_turn() -> None:
    tests = [f"test_{number}" for number in range(20)]
    turns = {tuple(whose_turn(tests, f"commit {number}")) for number in range(50)}
    assert len(turns) == TURNS
    assert sorted(test for turn in turns for test in turn) == sorted(tests), "each in one of them"
    assert {len(turn) for turn in turns} == {6, 7}


def test_a_file_that_is_named_runs_whole_unless_turns_are_asked_for() -> None:
    costly = collected("-m", "costly")
    assert len(costly) > 5
    assert collected("-m", "costly", "--in-turns", "--task-sample=any") == whose_turn(costly, "any")
