"""Evaluations of phases: mistakes found before the first step, the impossible left out, no phase lost to one."""

from __future__ import annotations

import dataclasses
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import torch
from atomic_version import atomic_tasks_only
from training_support import ROOT, experiment_file

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.cli import main
from robocasa_lerobot.cli.eval import describe_settings
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.planning.check import check
from robocasa_lerobot.evaluation.records.results import read_results
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.interrupts import STOPPED, Interrupts
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


@pytest.mark.costly
def test_no_phase_is_lost_to_an_evaluation(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One fails when it runs: the next phase trains, and is evaluated, all the same."""
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / 'tests' / 'support'}{os.pathsep}{ROOT}")
    slide = tmp_path / "slide.yaml"
    slide.write_text(
        "env: {factory: 'evaluation_env:SlideEnv', tasks: [Slide], horizon: 4}\ntrials: 1\nvideos: 0\nworkers: 1\n"
    )
    path, out = experiment_file(tmp_path, data), tmp_path / "out"
    # A device that this machine does not have shows when the evaluation runs.
    broken = f"{slide.with_name('broken.yaml')} --env.render_devices=977"
    slide.with_name("broken.yaml").write_text(slide.read_text())
    assert train(path, "--evaluate", *evaluations_of(path, pretrain=[broken], finetune=[str(slide)])) == 2
    assert "1 evaluation(s) failed" in capsys.readouterr().err
    last = last_checkpoint(out / "finetune")
    assert last is not None
    assert checkpoint_step(last) == 4
    (trial,) = read_results(out / "finetune/evaluations/slide").trials
    assert trial.label == "test/finetune-000004"
    (left_out,) = skipped.read(out)
    assert (left_out.kind, left_out.phase, left_out.evaluation) == ("evaluation", "pretrain", "broken")
    assert "ended with status 2" in left_out.reason

    # What failed is run again, what was finished is not; and what is possible now has no line any more.
    before = (out / "finetune/evaluations/slide/finished").stat().st_mtime_ns
    mended = str(slide.with_name("broken.yaml"))
    assert train(path, "--evaluate", *evaluations_of(path, pretrain=[mended], finetune=[str(slide)])) == 0
    assert (out / "finetune/evaluations/slide/finished").stat().st_mtime_ns == before
    assert len(read_results(out / "pretrain/evaluations/broken").trials) == 1
    assert skipped.read(out) == []


def test_evaluations_without_their_tasks_are_left_out_and_those_with_some_are_partial(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    atomic_tasks_only(monkeypatch)
    in_this_process = lambda asked: [dataclasses.asdict(check(arguments)) for arguments in asked]  # noqa: E731
    monkeypatch.setattr(evaluations, "_checked", in_this_process)
    path = experiment_file(tmp_path, data)
    texts = evaluations_of(path, pretrain=["robustness", "paper --env.tasks=OpenDrawer,WashLettuce", "quick"])
    experiment = load_experiment(path, texts)
    found = evaluations.plan_evaluations(experiment, experiment.phases)
    left_out = [item.skipped for item in found]
    assert [item and (item.kind, item.phase, item.evaluation) for item in left_out] == [
        ("evaluation", "pretrain", "robustness"), ("partial", "pretrain", "paper"), None,
    ]  # fmt: skip
    assert left_out[0] is not None
    assert "has none of the tasks of composite_seen" in left_out[0].reason
    assert left_out[1] is not None
    assert "without 17 of 18 tasks of atomic_seen" in left_out[1].reason
    assert [item.tasks for item in found[:2]] == [0, 1]

    started: list[list[str]] = []
    monkeypatch.setattr(evaluations, "_run", lambda command, _: started.append(command) or 0)
    (tmp_path / "out/pretrain/checkpoints/000004").mkdir(parents=True)
    assert evaluations.run_evaluations(found, tmp_path / "out/pretrain") == []
    asked = [word.rpartition("/")[2] for command in started for word in command if word.startswith("--config_path=")]
    assert asked == ["paper.yaml", "quick.yaml"]


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


@pytest.mark.costly
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


def planned(name: str, arguments: Sequence[str] = ()) -> evaluations.PlannedEvaluation:
    file = evaluations.PhaseEvaluation(Path(f"{name}.yaml"), ())
    return evaluations.PlannedEvaluation("example", file, tuple(arguments), None, None, 1, 1, 1, "plan")


def test_a_signal_to_all_processes_is_no_failure_of_the_running_evaluation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It dies of it, sooner than this process looks; nothing is booked, and the next one is not begun."""
    (tmp_path / "checkpoints/000004").mkdir(parents=True)
    popen, started = subprocess.Popen, []
    told = Interrupts()

    def dies(command: list[str], **kwargs: Any) -> subprocess.Popen[bytes]:
        started.append(command)
        process = popen([sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"], **kwargs)
        process.wait()
        os.kill(os.getpid(), signal.SIGTERM)
        return process

    monkeypatch.setattr(subprocess, "Popen", dies)
    with told.listening():
        found = evaluations.run_evaluations([planned("one"), planned("two")], tmp_path, lambda: told.signalled)
    assert found == []
    assert len(started) == 1
    assert not list(tmp_path.rglob("finished"))


@pytest.mark.costly
def test_a_failed_evaluation_does_not_hide_that_a_run_was_stopped(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evaluations, "_run", lambda *_: 1)
    path = experiment_file(tmp_path, data, defaults={"steps": 2})
    words = ["--evaluate", *evaluations_of(path, pretrain=["quick"])]
    assert train(path, "--stop_after=3", *words) == STOPPED
    assert train(path, *words) == 2


@pytest.mark.costly
def test_an_evaluation_whose_file_has_changed_runs_again(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(evaluations, "_run", lambda command, _: commands.append(command) or 0)
    path, file = experiment_file(tmp_path, data, defaults={"steps": 1}), tmp_path / "own.yaml"
    texts = ["--phase=pretrain", *evaluations_of(path, pretrain=[str(file)])]
    for settings, runs in (("seed: 0\nworkers: 2", 1), ("seed: 0\nworkers: 3", 1), ("seed: 1", 2)):
        file.write_text(f"env: {{tasks: [OpenDrawer]}}\n{settings}\n")
        assert train(path, "--evaluate", *texts) == 0
        assert len(commands) == runs
    marker = tmp_path / "out/pretrain/evaluations/own/finished"
    before = marker.read_text()
    marker.write_text("000001 0123456789ab")  # as it was written before all settings counted
    assert train(path, "--evaluate", *texts) == 0
    assert len(commands) == 3
    assert marker.read_text() == before


# Another value for each setting of an evaluation.
OTHER_SETTINGS = {
    "policy.path": "random", "policy.label": "other", "policy.device": "cpu", "policy.devices": "cuda:1",
    "policy.placement": "workers", "policy.batch_width": 2, "policy.threads": 2, "policy.runtime": "torch",
    "policy.lifelong_phase": 1, "policy.demo_fraction": 0.5, "policy.training_data": "other",
    "remote.connect_seconds": 1, "remote.answer_seconds": 1, "remote.first_answer_seconds": 1,
    "env.tasks": "CloseDrawer", "env.task_sets": "atomic_seen",
    "env.registry": "configs/experiments/parts/kitchens.yaml", "env.tasks_per_set": 1,
    "env.allow_missing_tasks": False, "env.split": "pretrain", "env.render_preset": "quality", "env.image_size": 64,
    "env.horizon": 9, "env.horizon_multiplier": 2, "env.render_devices": 1, "success.rule": "at_end",
    "perturbation.names": "camera", "perturbation.camera_position_m": 1, "perturbation.camera_angle_deg": 1,
    "perturbation.wrist_position_m": 1, "perturbation.wrist_angle_deg": 1, "perturbation.joint_rad": 1,
    "perturbation.base_position_m": 1, "perturbation.base_yaw_deg": 1, "protocol": "other", "trials": 3, "seed": 1,
    "executed_steps": 2, "workers": 3, "shard": "1/2", "videos": 0, "out": "elsewhere", "retry_errors": True,
    "stall_seconds": 9, "report": False, "scale": "other",
}  # fmt: skip
# Those that need others beside them: of policies behind sockets, of other simulators, of task sets, of `hold`.
TOGETHER = {
    "policy.keys", "env.factory", "env.python", "env.type", "env.options", "success.hold_steps", "lifelong",
}  # fmt: skip


def test_the_name_of_a_planned_evaluation_changes_with_what_its_results_depend_on() -> None:
    assert OTHER_SETTINGS.keys() | TOGETHER == {name for name, *_ in describe_settings(EvaluationConfig)}
    common = ["--policy.path=zero", "--env.tasks=OpenDrawer", "--trials=2"]
    plain = check(common)
    same = set()
    for name, value in OTHER_SETTINGS.items():
        other = check([*common, f"--{name}={value}"])
        assert other.mistake is None, other
        same |= {name} if other.plan == plain.plan else set()
    assert same == {
        "policy.path", "policy.devices", "policy.placement", "env.render_devices", "remote.connect_seconds",
        "remote.answer_seconds", "remote.first_answer_seconds", "out", "workers", "shard", "stall_seconds",
    }  # fmt: skip


@pytest.mark.slow
def test_what_is_evaluated_again_keeps_its_trials_or_says_why_not(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", f"{ROOT / 'tests' / 'support'}{os.pathsep}{ROOT}")
    path, file = experiment_file(tmp_path, data, defaults={"steps": 1}), tmp_path / "slide.yaml"
    own = "env: {factory: 'evaluation_env:SlideEnv', tasks: [Slide], horizon: 4}\ntrials: 1\nvideos: 0\nworkers: 1\n"
    file.write_text(own)
    words = ["--evaluate", "--phase=pretrain", *evaluations_of(path, pretrain=[str(file)])]
    assert train(path, *words) == 0
    results = tmp_path / "out/pretrain/evaluations/slide"
    trials = (results / "trials.jsonl").read_bytes()
    (results / "finished").write_text("000001 0123456789ab")  # as it was written before all settings counted
    assert train(path, *words) == 0
    assert (results / "trials.jsonl").read_bytes() == trials
    file.write_text(f"{own}seed: 1\n")
    assert train(path, *words) == 2
    assert f"put the results of before, {results}, elsewhere" in capsys.readouterr().err
    results.rename(tmp_path / "before")
    assert train(path, *words) == 0
    assert (results / "trials.jsonl").read_bytes() != trials
