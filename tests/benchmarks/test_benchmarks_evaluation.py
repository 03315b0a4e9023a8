"""The evaluation benchmark's own arithmetic; the figures are nobody's test."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(autouse=True)
def programs_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)


def module(name: str) -> ModuleType:
    return importlib.import_module(name)


def test_ratios_are_of_trials_per_hour_on_the_same_films() -> None:
    speed = module("evaluation_speed")
    seconds = {("ours", True): 20.0, ("lerobot", True): 60.0, ("ours", False): 10.0, ("lerobot", False): 40.0}
    found = {speed.name_of(*side): speed.summary([{"seconds": s, "split": {}}], 6) for side, s in seconds.items()}
    assert found["ours, without films"]["trials_per_hour"]["median"] == 2160
    assert speed.ratios({"demo": found}) == {"demo, with films": 3.0, "demo, without films": 4.0}
    without = {name: values for name, values in found.items() if name.endswith("without films")}
    assert speed.ratios({"demo": without}) == {"demo, without films": 4.0}
    body = {"policies": {"demo": found}, "ratios": speed.ratios({"demo": found})}
    assert "ours is 3.00 times LeRobot's: demo, with films" in speed.report(body)


def test_tasks_have_different_lengths_and_options_are_read() -> None:
    from robocasa_lerobot.envs.tasks.registry import get_task

    speed = module("evaluation_speed")
    assert len({get_task(task).horizon for task in speed.TASKS}) == 3
    options = speed.parse(["--quick", "--trials", "2", "--without-films", "--workers", "4"])
    assert (options.quick, options.trials, options.without_films, options.workers) == (True, 2, True, 4)
    assert speed.parse([]).output == speed.OUTPUT
