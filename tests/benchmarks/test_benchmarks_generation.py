"""The benchmark of generation: its arithmetic, its arms, and that it goes on where it was stopped."""

from __future__ import annotations

import importlib
import json
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

from robocasa_lerobot.demos.choose import task_set
from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def report(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("generation_report")


@pytest.fixture
def bench(report: ModuleType) -> ModuleType:
    return importlib.import_module("generation")


def test_every_task_belongs_to_a_class(report: ModuleType) -> None:
    found = {task: report.class_of(task) for task in task_set("mimicgen60")}
    assert set(found.values()) == set(report.CLASSES[:5])
    assert found["OpenDrawer"] == "buttons, drawers, racks"
    assert found["CloseBlenderLid"] == found["OpenFridge"] == "doors, lids, heads"
    assert found["PickPlaceCounterToSink"] == "pick and place, open surfaces"
    assert found["PickPlaceFridgeShelfToDrawer"] == "pick and place, into and out of things"
    assert min(Counter(found.values()).values()) >= 4
    assert report.class_of("KettleBoiling") == "composite"


def test_rates_and_ratios(report: ModuleType, tmp_path: Path) -> None:
    def trial(task: str, seed: int, arm: str, success: bool, seconds: float, *sources: int) -> object:
        held, reason = success or seed == 1, "" if success else "late"
        counted = (100, seconds, len(sources), sources, success, reason)
        return report.Trial(task, seed, arm, success, held, *counted, workers=2, start=(seed // 2, 0))

    trials = [trial("OpenDrawer", seed, "ours", seed != 0, 1.0, seed % 2, 1) for seed in range(4)]
    trials += [trial("TurnOnStove", seed, "ours", True, 3.0, 5) for seed in range(4)]
    trials += [trial("OpenDrawer", seed, "mimicgen", seed == 0, 0.5, 0) for seed in range(4)]
    trials += [trial("TurnOnStove", seed, "mimicgen", seed == 0, 0.5, 0) for seed in range(4)]
    ours = report.summary(trials[:8])
    assert ours["mean"] == pytest.approx((0.75 + 1.0) / 2)
    assert ours["mean_ever"] == ours["mean"]
    assert report.summary(trials[8:])["mean_ever"] == 2 * report.summary(trials[8:])["mean"] == 0.5
    assert ours["tasks"]["OpenDrawer"]["most_used_source"] == pytest.approx(5 / 6)
    assert ours["tasks"]["OpenDrawer"]["failures"] == {"late": 1}
    assert ours["classes"]["knobs, levers"] == {"tasks": 1, "mean": 1.0, "worst": 1.0}
    assert ours["tasks"]["OpenDrawer"]["starts_covered"] == 1.0
    assert report.summary(trials[8:])["tasks"]["OpenDrawer"]["starts_covered"] == 0.5
    # Seeds that the other arm has not tried say nothing of both.
    more = [trial("OpenDrawer", seed, "ours", False, 9.0) for seed in range(4, 8)]
    assert report.ratios([*trials, *more])["success_ours_over_mimicgen"] == pytest.approx(0.875 / 0.25)
    assert report.ratios([*trials, *more])["mean_success_ours"] < 0.875
    found = report.ratios(trials)
    assert found["success_ours_over_mimicgen"] == pytest.approx(0.875 / 0.25)
    assert found["kept_an_hour_ours"] == pytest.approx(2 * 3600 * 7 / 16)
    assert found["kept_an_hour_ours_over_mimicgen"] == pytest.approx((7 / 16) / (2 / 4))
    page = report.text(trials, "head")
    assert "| OpenDrawer | 3 of 4 | 75% |" in page
    assert "| ours | 2 | 8 | 87.5% | 3,150 | 87.5% |" in page
    # Tasks of one arm alone have their line in the picture, too.
    from generation_picture import draw

    draw({"ours": ours, "mimicgen": report.summary(trials[8:12])}, tmp_path / "rates.png")
    assert Image.open(tmp_path / "rates.png").width == 990


def test_arms(bench: ModuleType) -> None:
    assert bench.arms_of("ours=100, mimicgen", 10) == {"ours": 100, "mimicgen": 10}
    for wrong in ("our", "ours=many"):
        with pytest.raises(SystemExit, match="expected one of"):
            bench.arms_of(wrong, 10)


@pytest.mark.slow
def test_it_goes_on_where_it_was_stopped(bench: ModuleType, tmp_path: Path) -> None:
    sources = tmp_path / "sources"
    record_tasks([RecordingSettings("CloseDrawer", 2, split="pretrain", seed=100_000)], sources, show_progress=False)
    assert not any(outcome.dropped for outcome in prepare_files([sources]))
    trials, out = tmp_path / "trials.jsonl", tmp_path / "generation.json"
    command = ["--source", str(sources), "--workers", "1", "--trials", str(trials), "--out", str(out)]
    bench.main([*command, "--arms", "ours=1,mimicgen=1,scripted=1,far=1,one=1,own=2"])
    lines = trials.read_text().splitlines(keepends=True)
    assert len(lines) == 7
    assert {json.loads(line)["arm"] for line in lines} == set(bench.ARMS)
    trials.write_text("".join(lines[:2]) + lines[2][:10])
    bench.main([*command, "--arms", "ours=1,mimicgen=1,scripted=1"])
    body = json.loads(out.read_text())
    assert set(body["arms"]) == {"ours", "mimicgen", "scripted"}
    assert body["ratios"]["mean_success_scripted"] == 1.0
    assert out.with_suffix(".md").exists()
