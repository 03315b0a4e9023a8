"""Evaluations of phases: mistakes found before the first step, the impossible left out, no phase lost to one."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
import torch
from training_support import ROOT, experiment_file

from robocasa_lerobot.benchmark.tasks import published_task_sets, published_tasks
from robocasa_lerobot.cli import main
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.evaluation.records.results import read_results
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.planning import evaluations, skipped
from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=2, length=12, image_size=32)


def train(path: Path, *settings: str) -> int:
    return main(["train", "--config_path", str(path), *settings])


def evaluations_of(path: Path, **phases: Sequence[str]) -> list[str]:
    return [f"--phases.{name}.evaluations={list(texts)}" for name, texts in phases.items()]


@pytest.mark.parametrize("how", ["--evaluate", "--plan"])
def test_mistakes_in_evaluations_are_all_found_before_the_first_step(
    how: str, tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = experiment_file(tmp_path, data)
    (tmp_path / "broken.yaml").write_text("env: [unclosed")
    wrong = {
        "pretrain": ["leaderboard --trails=3", "foundation --env.task_sets=no_such_set", "paper --trials=many"],
        "finetune": [f"{tmp_path}/broken.yaml", "quick --env.tasks=OpenDrawr", "lifelong --policy.lifelong_phase=5"],
    }
    assert train(path, how, "--measure=0", *evaluations_of(path, **wrong)) == 2
    said = capsys.readouterr().err
    for part in (
        "Did you mean 'trials'", "unknown task set 'no_such_set'", "trials", "not valid YAML",
        "Did you mean 'OpenDrawer'", "found 5, but env.task_sets has 4",
    ):  # fmt: skip
        assert part in said
    assert said.count("\n  phase ") == 6
    assert not list(tmp_path.glob("out/*/metrics.jsonl"))


def test_no_phase_is_lost_to_an_evaluation(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One has no registered task, one lacks some, one fails when it runs: the next phase trains all the same."""
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / 'tests' / 'support'}{os.pathsep}{ROOT}")
    later = sorted(set(published_tasks()) - set(task_names()))[:2]
    if not later:
        pytest.skip("every task of the benchmark is registered: nothing lacks")
    registry = tmp_path / "later.yaml"
    registry.write_text(f"task_sets: {{later: [{', '.join(later)}]}}\n")
    nothing = f"robustness --env.registry={registry} --env.task_sets=later"
    slide = tmp_path / "slide.yaml"
    slide.write_text(
        "env: {factory: 'evaluation_env:SlideEnv', tasks: [Slide], horizon: 4}\ntrials: 1\nvideos: 0\nworkers: 1\n"
    )
    path, out = experiment_file(tmp_path, data), tmp_path / "out"
    # A device that this machine does not have shows when the evaluation runs.
    broken = f"{slide.with_name('broken.yaml')} --env.render_devices=977"
    slide.with_name("broken.yaml").write_text(slide.read_text())
    partial = f"paper --env.tasks=OpenDrawer,{later[0]} --env.render_devices=977"
    settings = evaluations_of(path, pretrain=[nothing, broken, partial], finetune=[str(slide)])
    assert train(path, "--evaluate", *settings) == 2
    assert "2 evaluation(s) failed" in capsys.readouterr().err
    last = last_checkpoint(out / "finetune")
    assert last is not None
    assert checkpoint_step(last) == 4
    (trial,) = read_results(out / "finetune/evaluations/slide").trials
    assert trial.label == "test/finetune-000004"
    left_out = {(item.kind, item.phase, item.evaluation): item.reason for item in skipped.read(out)}
    assert {key: words in left_out[key] for key, words in {
        ("evaluation", "pretrain", "robustness"): "has none of the tasks of later",
        ("partial", "pretrain", "paper"): "without 17 of 18 tasks of atomic_seen",
        ("evaluation", "pretrain", "paper"): "ended with status 2",
        ("evaluation", "pretrain", "broken"): "ended with status 2",
    }.items()} == dict.fromkeys(left_out, True)  # fmt: skip

    # What failed is run again, what was finished is not; and what is possible now has no line any more.
    before = (out / "finetune/evaluations/slide/finished").stat().st_mtime_ns
    assert train(path, "--evaluate", *evaluations_of(path, pretrain=[nothing], finetune=[str(slide)])) == 0
    assert (out / "finetune/evaluations/slide/finished").stat().st_mtime_ns == before
    assert [(item.kind, item.evaluation) for item in skipped.read(out)] == [("evaluation", "robustness")]


def test_a_command_about_one_phase_keeps_what_is_known_of_the_others(tmp_path: Path) -> None:
    phase = skipped.Skipped("phase", "phase2", None, "nothing is registered")
    first, second = (skipped.Skipped("evaluation", name, "quick", "failed") for name in ("phase1", "phase2"))
    skipped.decide(tmp_path, [phase, first, second], {"phase1", "phase2"}, evaluations=True)
    skipped.decide(tmp_path, [phase], {"phase1"}, evaluations=False)
    assert skipped.read(tmp_path) == [first, second, phase]
    skipped.decide(tmp_path, [], {"phase1"}, evaluations=True)
    assert skipped.read(tmp_path) == [second]


def test_evaluations_mean_the_experiments_registry_where_they_name_none(tmp_path: Path, data: Path) -> None:
    registry = tmp_path / "own.yaml"
    registry.write_text("task_sets: {lifelong_phase1: [OpenDrawer], lifelong_phase2: [TurnOnStove]}\n")
    path = experiment_file(tmp_path, data, registry=str(registry))
    named = "paper --env.registry=robocasa365"
    texts = evaluations_of(path, pretrain=["lifelong --policy.lifelong_phase=2", named])
    experiment = load_experiment(path, texts)
    own, benchmark = evaluations.plan_evaluations(experiment, experiment.phases)
    assert own.tasks == 2
    assert f"--env.registry={registry}" in own.arguments
    assert benchmark.tasks == len(set(published_task_sets()["target50"]) & set(task_names()))
    assert load_experiment(path).registry == str(registry)


def test_nothing_of_a_killed_training_goes_on_evaluating(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The evaluation of a trainer that is killed ends, so that the next one may write to its folder."""
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / 'tests' / 'support'}{os.pathsep}{ROOT}")
    command = [
        sys.executable, "-m", "robocasa_lerobot.cli", "eval", "--end-with-input", "--policy=zero", "--trials=1",
        "--env.factory=evaluation_env:SlideEnv", "--env.tasks=Slide+slow", "--env.horizon=30000", "--workers=1",
        f"--out={tmp_path}",
    ]  # fmt: skip
    trainer = f"from robocasa_lerobot.training.planning import evaluations as e; e._run({command!r}, lambda: False)"
    with subprocess.Popen([sys.executable, "-c", trainer]) as process:
        while not (tmp_path / "trials.jsonl").exists():
            time.sleep(0.1)
        process.kill()
    with (tmp_path / ".lock").open() as lock:
        for _ in range(300):
            with suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            time.sleep(0.1)
    pytest.fail("the evaluation goes on")


def test_a_signal_ends_a_running_evaluation() -> None:
    command = [sys.executable, "-c", "import time; time.sleep(600)"]
    assert evaluations._run(command, lambda: True) is None
