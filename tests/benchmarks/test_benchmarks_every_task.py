"""The walk over every task runs the users' commands, and goes on with what is missing."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return importlib.import_module("every_task")


@pytest.mark.costly
def test_a_command_that_has_ended_well_is_not_run_again(benchmark: ModuleType, tmp_path: Path) -> None:
    steps = benchmark.Steps(tmp_path)
    with pytest.raises(SystemExit, match="verify ended with status 2"):
        steps.run("verify", ["verify", str(tmp_path / "nothing")])
    printed = steps.run("sets", ["tasks", "--help"])
    again = benchmark.Steps(tmp_path)
    assert again.done["verify"]["status"] == 2
    assert again.done["sets"]["seconds"] > 0
    assert again.run("sets", ["tasks", "--help", "--workers", "1"]) == printed
    with pytest.raises(SystemExit, match="is of `tasks --help`; this one is `no such command`"):
        again.run("sets", ["no such command"])


@pytest.mark.slow
def test_a_task_is_recorded_converted_verified_and_replayed(benchmark: ModuleType, tmp_path: Path) -> None:
    words = ["--tasks", "CloseDrawer", "--strips", "1", "--folder", str(tmp_path), "--out", str(tmp_path / "r.json")]
    benchmark.main(words)
    found = json.loads((tmp_path / "r.json").read_text())
    assert found["ratios"] == {"tasks_recorded": 1, "replayed_from_actions": 1, "replayed_from_states": 1}
    assert found["verified"]
    assert found["missing"] == found["not_replayed"] == []
    assert set(found["minutes"]) == {"demos", "convert", "verify", "replay", "strips"}
    assert "recorded: 1 of 1 tasks" in (tmp_path / "r.md").read_text()
    assert len(list((tmp_path / "strips").glob("*.png"))) == 1
