"""Plans: what an experiment would do, without doing it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
import torch
import yaml
from accelerate import Accelerator
from policy_support import with_features
from safetensors.torch import load_file
from training_support import ROOT, TINY, experiment_file, tiny

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.planning.plan import plan_experiment
from robocasa_lerobot.training.planning.plan_text import render_plan
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup.build_phase import prepare_phase
from robocasa_lerobot.training.weights.checkpoint import save_checkpoint


def test_missing_data_are_told_with_the_command_that_makes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)  # where nothing has been made
    asked = ["train", "--config_path", str(ROOT / "configs/experiments/small/lifelong_cpu.yaml"), "--seed=3"]
    make = f"robocasa-lerobot data {asked[2]} --seed=3 --make` records and converts it"
    assert main([*asked, "--plan", "--measure", "0"]) == 0
    assert make in capsys.readouterr().out
    assert main(asked) == 2
    assert make in capsys.readouterr().err


MISSING = "{select: [{task_set: atomic_seen, split: target}]}"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=8, length=12, image_size=32)


def test_plan_tells_what_would_be_done(tmp_path: Path, data: Path) -> None:
    overrides = ["--phases.pretrain.save_every=1", "--phases.pretrain.keep_last=2", "--phases.finetune.lora.rank=2"]
    overrides.append("--loader.image_size=32")
    experiment = tiny(tmp_path, data, overrides=[*overrides, f"--phases.finetune.mixture={MISSING}"])
    pretrain, finetune = plan_experiment(experiment, measured_steps=4)
    assert not (tmp_path / "out").exists()
    assert (pretrain.depth, finetune.depth) == (0, 1)
    assert (pretrain.samples, pretrain.frames, pretrain.missing) == (16, 96, [])
    assert pretrain.kept == 3  # the newest two and the initial one
    assert (pretrain.aside, finetune.aside) == (1, 0)  # before one is removed there is the one that takes its place
    assert pretrain.parameters is not None
    assert finetune.parameters is not None
    assert pretrain.parameters[0] == pretrain.parameters[1]
    assert finetune.parameters[1] < finetune.parameters[0]
    assert len(finetune.missing) == 18
    assert pretrain.seconds is not None
    assert pretrain.seconds > 0
    text = render_plan(experiment, [pretrain, finetune], "cpu")
    assert "3 checkpoint(s) of 0.00 GB and one more while it is written" in text
    for part in ("finetune <- pretrain (to do)", "missing datasets: 18", "statistics: keep", "hours by measurement"):
        assert part in text
    assert run_experiment(tiny(tmp_path, data, overrides=overrides), only="pretrain")
    names = ("pretrained_model/model", "training_state/raw_model", "training_state/optimizer_state")
    files = [tmp_path / f"out/pretrain/checkpoints/000004/{name}.safetensors" for name in names]
    sizes = sum(tensor.nbytes for path in files for tensor in load_file(path).values())
    assert pretrain.checkpoint_bytes == pytest.approx(sizes, rel=0.05)
    assert plan_experiment(experiment, only="pretrain", measured_steps=0)[0].done == 4


def test_plan_counts_frames_once_that_phases_share(tmp_path: Path, data: Path) -> None:
    experiment = tiny(tmp_path, data, overrides=["--loader.cache_frames=true"])
    plans = plan_experiment(experiment, measured_steps=0)
    assert plans[0].cached
    assert plans[0].cached == plans[1].cached
    large = [dataclasses.replace(plan, cached=dict.fromkeys(plan.cached, 5_000_000_000)) for plan in plans]
    assert "\ndisk: 5.0 GB" in render_plan(experiment, large, "cpu")


@pytest.mark.parametrize(("budget", "cached"), [(0.0008, False), (0.0009, True)])
def test_frames_are_cached_where_the_budget_has_room_for_them(
    tmp_path: Path, data: Path, budget: float, cached: bool
) -> None:
    """96 frames of three pictures of 32 pixels, each of three bytes, are 0.00088 GB."""
    overrides = [f"--loader.cache_budget_gb={budget}", f"--loader.cache_dir={tmp_path / 'frames'}"]
    experiment = tiny(tmp_path, data, overrides=overrides)
    (plan,) = plan_experiment(experiment, "pretrain", measured_steps=0)
    assert sum(plan.cached.values()) == (884_736 if cached else 0)
    prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
    kept = sum(path.stat().st_size for path in (tmp_path / "frames").rglob("*") if path.is_file())
    assert (kept >= 884_736) == cached


@pytest.mark.parametrize("lora", [None, {"rank": 2}])
def test_plan_counts_the_float32_weights_of_a_policy_in_half_precision(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, lora: dict[str, int] | None
) -> None:
    made = builders.make_phase_policy
    monkeypatch.setattr(builders, "make_phase_policy", lambda *given: made(*given).to(torch.bfloat16))
    experiment = tiny(tmp_path, data, overrides=[f"--defaults.lora={json.dumps(lora)}"])
    (plan,) = plan_experiment(experiment, "pretrain", measured_steps=0)
    run = prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
    for parameter in run.state.policy.parameters():
        parameter.grad = torch.ones_like(parameter)
    run.state.optimizer.step()
    folder = save_checkpoint(tmp_path / "saved", run.state, run.train_config)
    files = [*folder.glob("training_state/*.safetensors"), folder / "pretrained_model/model.safetensors"]
    sizes = {path.stem: sum(tensor.nbytes for tensor in load_file(path).values()) for path in files}
    assert {"master_weights", "average", "optimizer_state", "raw_model", "model"} <= sizes.keys()
    del sizes["rng_state"]
    assert plan.checkpoint_bytes == pytest.approx(sum(sizes.values()), rel=0.05)


def test_plan_counts_frames_at_the_size_that_the_policy_brings_them_to(tmp_path: Path, data: Path) -> None:
    experiment = tiny(tmp_path, data, overrides=["--loader.cache_frames=true", "--policy.image_size=[16, 16]"])
    (plan,) = plan_experiment(experiment, "pretrain", measured_steps=0)
    assert plan.cached == {data: 8 * 12 * len(contract.CAMERAS) * 3 * 16 * 16}


def test_plan_builds_the_policy_for_the_cameras_that_it_gets(tmp_path: Path, data: Path) -> None:
    """Also where the data are not there yet."""
    overrides = ["--policy.vision_shared=false", "--loader.cameras=[robot0_eye_in_hand]"]
    experiment = tiny(tmp_path, data, overrides=[*overrides, f"--phases.finetune.mixture={MISSING}"])
    plans = plan_experiment(experiment, measured_steps=0)
    assert plans[1].missing
    run = prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
    total = sum(parameter.numel() for parameter in run.state.policy.parameters())
    assert [plan.parameters for plan in plans] == [(total, total)] * 2


def test_plan_lists_the_missing_data_that_statistics_are_pooled_with(tmp_path: Path, data: Path) -> None:
    overrides = [f"--phases.pretrain.mixture={MISSING}", "--phases.finetune.statistics=pool"]
    pretrain, finetune = plan_experiment(tiny(tmp_path, data, overrides=overrides), measured_steps=0)
    assert len(finetune.missing) == 18
    assert finetune.missing == pretrain.missing


def test_plan_says_that_weights_are_not_downloaded(tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, folder = "diffusion_transformer", tmp_path / "hub"
    with_features(builders.policy_config({"type": kind, **TINY[kind]}, None, "cpu")).save_pretrained(folder)
    monkeypatch.setattr(builders, "hub_config", lambda _: folder)
    path = experiment_file(tmp_path, data)
    content = yaml.safe_load(path.read_text())
    content["phases"] = [{**content["phases"][0], "init": "hub:owner/name", "statistics": "replace"}]
    path.write_text(yaml.safe_dump(content))
    (plan,) = plan_experiment(load_experiment(path), measured_steps=2)
    assert plan.parameters is not None
    assert plan.seconds is None
    assert plan.notes == [f"not measured: no weights in {folder} yet, which a training downloads from the hub"]
