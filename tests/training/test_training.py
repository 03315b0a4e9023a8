"""Training for real, on a tiny dataset: phases, checkpoints, and going on after an interruption."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from training_support import experiment_file, losses, metrics, tiny, weights

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.training.config.experiment import EmaConfig, load_experiment
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.records import check_unchanged
from robocasa_lerobot.training.setup import builders, optimizers
from robocasa_lerobot.training.weights.checkpoint import last_checkpoint, pretrained_model
from robocasa_lerobot.training.weights.ema import Ema, ema_decay


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, data: Path) -> Path:
    """A two-phase run in one go."""
    folder = tmp_path_factory.mktemp("finished")
    torch.set_num_threads(1)
    assert run_experiment(tiny(folder, data))
    return folder


def test_two_phases_leave_what_they_should(finished: Path) -> None:
    out = finished / "out"
    assert sorted(p.name for p in (out / "pretrain/checkpoints").iterdir()) == ["000000", "000002", "000004", "last"]
    assert sorted(p.name for p in (out / "finetune/checkpoints").iterdir()) == ["000002", "000004", "last"]
    assert (out / "finetune/checkpoints/last").readlink() == Path("000004")
    model = out / "finetune/checkpoints/last/pretrained_model"
    expected = {"config.json", "model.safetensors", "train_config.json", "policy_preprocessor.json"}
    assert expected <= {p.name for p in model.iterdir()}
    assert "optimizer_state.safetensors" in {p.name for p in (model.parent / "training_state").iterdir()}
    assert load_experiment(out / "experiment.yaml") == load_experiment(finished / "experiment.yaml")
    about = json.loads((out / "finetune/phase.json").read_text())
    assert about["init"].endswith("pretrain/checkpoints/000004/pretrained_model")
    assert "2 episodes, 24 frames" in about["data"][0]
    for phase in ("pretrain", "finetune"):
        lines = metrics(finished, phase)
        assert [line["step"] for line in lines] == [1, 2, 3, 4]
        assert {"loss", "learning_rate", "grad_norm", "seconds_per_step", "data_seconds_per_step"} <= lines[0].keys()
        assert [line["samples"] for line in lines] == [4, 8, 12, 16]


def test_a_checkpoint_says_which_experiment_made_it_wherever_it_lies(finished: Path, tmp_path: Path) -> None:
    phase = finished / "out/finetune"
    copy = shutil.copytree(phase / "checkpoints/000004/pretrained_model", tmp_path / "copied")
    moved = shutil.copytree(phase, tmp_path / "moved", symlinks=True)
    for place in (phase, copy, moved):
        source = read_source(str(place))
        assert (source.label, source.experiment, source.phase, source.step) == (
            "test/finetune-000004", "test", "finetune", 4,
        )  # fmt: skip
    # One that was written before there was an `origin.json`.
    place = moved / "checkpoints/000004/pretrained_model"
    fingerprint = read_source(str(place)).fingerprint
    (place / "origin.json").unlink()
    assert read_source(str(place)).label == "test/moved-000004"
    assert read_source(str(place)).fingerprint == fingerprint


@pytest.mark.parametrize("first", [1, 2, 3, 5])
def test_stopped_and_continued_gives_the_same_losses(tmp_path: Path, data: Path, finished: Path, first: int) -> None:
    experiment = tiny(tmp_path, data)
    assert not run_experiment(experiment, stop_after=first)
    while not run_experiment(experiment, stop_after=4):
        pass
    for phase in ("pretrain", "finetune"):
        assert losses(tmp_path, phase) == losses(finished, phase)
        ours, theirs = weights(tmp_path, phase), weights(finished, phase)
        assert all(torch.equal(ours[key], theirs[key]) for key in theirs)


def test_request_to_end_saves_first(tmp_path: Path, data: Path) -> None:
    experiment = tiny(tmp_path, data, overrides=["--defaults.steps=5000"])
    before = signal.getsignal(signal.SIGTERM)

    def ask() -> None:
        while not (tmp_path / "out/pretrain/checkpoints/000004").is_dir():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGTERM)

    asking = threading.Thread(target=ask)
    asking.start()
    assert not run_experiment(experiment)
    asking.join()
    assert signal.getsignal(signal.SIGTERM) == before
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert int(last.name) == metrics(tmp_path, "pretrain")[-1]["step"] < 5000


def test_finished_run_is_left_alone(finished: Path, data: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in (finished / "out").glob("*/**/*") if path.is_file()}
    assert run_experiment(load_experiment(finished / "experiment.yaml"))
    assert before == {path: path.stat().st_mtime_ns for path in before}


def test_changed_settings_of_a_begun_run_are_listed(tmp_path: Path, data: Path) -> None:
    assert not run_experiment(tiny(tmp_path, data), stop_after=2)
    changed = tiny(tmp_path, data, overrides=["--seed=1", "--phases.pretrain.batch_size=2", "--policy.width=32"])
    with pytest.raises(UserError) as caught:
        run_experiment(changed)
    for text in ("seed: 0 -> 1", "phases.pretrain.batch_size: 4 -> 2", "policy.width: 16 -> 32", "--resume=force"):
        assert text in str(caught.value)
    later = tiny(tmp_path, data, overrides=["--phases.finetune.batch_size=2", "--phases.pretrain.log_every=2"])
    assert not run_experiment(later, stop_after=5)  # a phase that has not begun may change, and what is only shown
    # Statistics are computed when a phase begins.
    again = tiny(tmp_path, data, overrides=["--phases.finetune.statistics=replace", "--phases.finetune.batch_size=2"])
    with pytest.raises(UserError, match=r"which they keep:\n  phases.finetune.statistics: keep -> replace\nPut them"):
        run_experiment(again, force=True)


def test_a_begun_phase_that_would_start_elsewhere_is_told(tmp_path: Path, data: Path) -> None:
    """`init` says nothing before and after, but another phase comes before it now."""
    assert not run_experiment(tiny(tmp_path, data), stop_after=5)
    between = tiny(tmp_path, data)
    between.phases.insert(1, dataclasses.replace(between.phases[1], name="between"))
    with pytest.raises(UserError, match=r"phases\.finetune\.init: pretrain -> between"):
        check_unchanged(between, tmp_path / "out", force=False)


def test_forced_settings_of_optimiser_and_policy_are_used(tmp_path: Path, data: Path, finished: Path) -> None:
    """Moments and the place in the schedule are those of before, everything else is what the settings say now."""
    assert not run_experiment(tiny(tmp_path, data), stop_after=2)
    lower = ["--phases.pretrain.learning_rate=1e-5", "--phases.pretrain.optimizer.weight_decay=0"]
    policy = ["--policy.dropout=0", "--policy.num_inference_steps=5"]
    assert not run_experiment(tiny(tmp_path, data, overrides=[*lower, *policy]), stop_after=1, force=True)
    constant = ["--phases.pretrain.learning_rate=2e-5", "--phases.pretrain.scheduler={type: none}", *policy]
    assert not run_experiment(tiny(tmp_path, data, overrides=constant), stop_after=1, force=True)
    plain = [line["learning_rate"] for line in metrics(finished, "pretrain")]
    rates = [line["learning_rate"] for line in metrics(tmp_path, "pretrain")]
    assert rates == pytest.approx([*plain[:2], plain[2] * 1e-5 / 1e-3, 2e-5])
    for step, decay in (("000003", 0), ("000004", weight_decay(finished, "000004"))):
        assert weight_decay(tmp_path, step) == decay
    config = json.loads((tmp_path / "out/pretrain/checkpoints/000004/pretrained_model/config.json").read_text())
    assert (config["dropout"], config["num_inference_steps"]) == (0, 5)
    for setting, message in (
        ("width=32", "do not fit the policy's settings"),
        ("constant_range=0.1", r"own processors.* constant_range: 0.001 -> 0.1\. Put the old values back\."),
    ):
        changed = tiny(tmp_path, data, overrides=["--phases.pretrain.steps=5", f"--policy.{setting}"])
        with pytest.raises(UserError, match=message):
            run_experiment(changed, force=True)


def weight_decay(folder: Path, step: str) -> float:
    path = folder / f"out/pretrain/checkpoints/{step}/training_state/optimizer_param_groups.json"
    return float(json.loads(path.read_text())[0]["weight_decay"])


def test_forced_without_changes_gives_the_same_losses(tmp_path: Path, data: Path, finished: Path) -> None:
    experiment = tiny(tmp_path, data)
    assert not run_experiment(experiment, stop_after=3)
    assert run_experiment(experiment, force=True)
    for phase in ("pretrain", "finetune"):
        assert losses(tmp_path, phase) == losses(finished, phase)


def test_changed_data_are_told(tmp_path: Path) -> None:
    data = write_fake_dataset(tmp_path / "data" / "fake", episodes=2, length=8, image_size=32)
    assert not run_experiment(tiny(tmp_path, data), stop_after=2)
    data.rename(tmp_path / "before")
    write_fake_dataset(data, episodes=2, length=9, image_size=32)
    with pytest.raises(UserError, match="begun with other data"):
        run_experiment(tiny(tmp_path, data))


def test_checkpoint_loads_through_lerobot(finished: Path, data: Path) -> None:
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.configs.train import TrainPipelineConfig
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors

    model = pretrained_model(last_checkpoint(finished / "out/finetune") or finished)
    config = PreTrainedConfig.from_pretrained(model)
    policy = get_policy_class(config.type).from_pretrained(model)
    pre, post = make_pre_post_processors(config, pretrained_path=str(model))
    observation = {key: torch.rand(1, 3, 32, 32) for key in contract.IMAGE_KEYS}
    observation[contract.STATE_KEY] = torch.zeros(1, contract.STATE_SIZE)
    action = post(policy.select_action(pre({**observation, "task": ["open the left drawer"]})))
    assert action.shape == (1, contract.ACTION_SIZE)
    assert torch.isfinite(action).all()
    training = TrainPipelineConfig.from_pretrained(model)
    assert (training.steps, training.batch_size, training.dataset.root) == (4, 4, str(data))


def _statistics(folder: Path, phase: str) -> dict[str, np.ndarray[Any, Any]]:
    from safetensors.numpy import load_file

    (path,) = (folder / "out" / phase / "checkpoints/last/pretrained_model").glob("policy_pre*normalizer*.safetensors")
    return load_file(path)


def test_statistics_are_kept_or_recomputed(tmp_path: Path, finished: Path, data: Path) -> None:
    key = "observation.state.mean"
    np.testing.assert_array_equal(_statistics(finished, "finetune")[key], _statistics(finished, "pretrain")[key])
    # New processors may be others; those that are kept may not (`test_mistakes_are_told_before_training`).
    overrides = ["--phases.finetune.statistics=replace", "--phases.finetune.policy={constant_range: 0.1}"]
    assert run_experiment(tiny(tmp_path, data, overrides=overrides))
    assert not np.array_equal(_statistics(tmp_path, "finetune")[key], _statistics(tmp_path, "pretrain")[key])


def test_phase_starts_from_the_weights_of_the_one_before(tmp_path: Path, data: Path) -> None:
    overrides = ["--phases.finetune.save_initial=true", "--phases.finetune.learning_rate=1e-4"]
    assert run_experiment(tiny(tmp_path, data, overrides=overrides))
    before, after = weights(tmp_path, "pretrain"), weights(tmp_path, "finetune", "000000")
    assert all(torch.equal(before[key], after[key]) for key in before)
    rates = [line["learning_rate"] for line in metrics(tmp_path, "finetune")]
    assert max(rates) == pytest.approx(1e-4)


def test_checkpoint_of_another_experiment_can_be_the_start(tmp_path: Path, finished: Path, data: Path) -> None:
    start = finished / "out/pretrain/checkpoints/last/pretrained_model"
    path = experiment_file(tmp_path, data, policy={"path": str(start), "num_inference_steps": 5})
    content = yaml.safe_load(path.read_text())
    content["policy"] = {"path": str(start), "num_inference_steps": 5}
    content["phases"] = content["phases"][1:]
    path.write_text(yaml.safe_dump(content))
    assert run_experiment(load_experiment(path))
    config = json.loads((tmp_path / "out/finetune/checkpoints/last/pretrained_model/config.json").read_text())
    assert config["num_inference_steps"] == 5
    assert config["width"] == 16


@pytest.mark.costly
@pytest.mark.parametrize(
    ("kind", "plain"),
    [
        ("act", ["use_vae=false", "dropout=0", "chunk_size=8"]),
        (
            "diffusion",
            # Normalised over groups: batch statistics are of a part.
            [
                *("do_mask_loss_for_padding=true", "drop_n_last_frames=0", "horizon=16", "prediction_type=sample"),
                "use_group_norm=true",
            ],
        ),
    ],
)
def test_parts_of_a_batch_add_up(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, kind: str, plain: list[str]
) -> None:
    """Accumulated gradients are those of the same samples in one part; without noise, so up to rounding.

    Windows leave the episodes in one of the parts more than in the other.
    """
    monkeypatch.setattr(torch, "randn", torch.zeros)
    monkeypatch.setattr(torch, "randint", lambda *_, size, device=None, **__: torch.zeros(size, device=device).long())
    common = [*(f"--policy.{setting}" for setting in plain), "--defaults.steps=1"]
    run_experiment(tiny(tmp_path / "parts", data, kind, [*common, "--defaults.gradient_accumulation=2"]), stop_after=1)
    run_experiment(tiny(tmp_path / "whole", data, kind, common), stop_after=1)
    np.testing.assert_allclose(losses(tmp_path / "parts", "pretrain"), losses(tmp_path / "whole", "pretrain"), 1e-4)


def test_loss_falls(tmp_path: Path, data: Path) -> None:
    overrides = ["--phases.pretrain.steps=80", "--phases.pretrain.log_every=20", "--phases.pretrain.batch_size=8"]
    run_experiment(tiny(tmp_path, data, overrides=[*overrides, "--policy.optimizer_lr=1e-2"]), stop_after=80)
    values = [line["loss"] for line in metrics(tmp_path, "pretrain")]
    assert values[-1] < 0.8 * values[0]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["--policy.type=diffusion_transformr"], "Did you mean 'diffusion_transformer'"),
        (["--policy.widht=8"], "Did you mean 'width'"),
        (["--policy.width=7"], "multiple of n_heads"),
        (["--policy.vision_encoder=resnet"], "resnet18"),
        (["--phases.finetune.policy={horizn: 4}"], "Did you mean 'horizon'"),
        (
            ["--phases.finetune.policy={constant_range: 0.1}"],
            "statistics: keep.* constant_range: 0.001 -> 0.1.*`statistics: replace`",
        ),
        (
            ["--phases.finetune.policy={normalization_mapping: {VISUAL: IDENTITY, STATE: MEAN_STD, ACTION: MIN_MAX}}"],
            "normalization_mapping: {.*STATE: MIN_MAX.*} -> {.*STATE: MEAN_STD.*}",
        ),
        (["--device=cude"], "Did you mean 'cuda'"),
        (["--device=cuda:1"], "set `device: cuda`, and choose the GPU before the command: `CUDA_VISIBLE_DEVICES=1`"),
        (["--phases.finetune.mixture.members=[{root: nowhere}]"], "no dataset at nowhere"),
        (["--phases.pretrain.mixture.members=[{root: nowhere}]"], "no dataset at nowhere"),
        (["--phases.finetune.freeze=[obs_encoder]"], "unknown part of the policy 'obs_encoder'"),
        (["--phases.finetune.lora={targets: [nothing]}"], "unknown layer 'nothing'"),
        (["--phases.finetune.optimizer={type: adamx}"], "'adam' or 'adamw'"),
        (["--phases.finetune.scheduler={name: cosin}"], "`scheduler`"),
        (["--mixed_precision=fp16"], "fp16 needs a GPU"),
    ],
)
def test_mistakes_are_told_before_training(tmp_path: Path, data: Path, overrides: list[str], message: str) -> None:
    experiment = tiny(tmp_path, data, overrides=overrides)
    with pytest.raises(UserError, match=message):
        run_experiment(experiment)
    assert not (tmp_path / "out/pretrain").exists()


def test_weights_that_do_not_fit_are_told(tmp_path: Path, finished: Path, data: Path) -> None:
    start = finished / "out/pretrain/checkpoints/last/pretrained_model"
    overrides = [
        f"--phases.pretrain.init={start}",
        "--defaults.statistics=keep",
        "--phases.pretrain.policy={width: 32}",
    ]
    with pytest.raises(UserError, match="do not fit"):
        run_experiment(tiny(tmp_path, data, overrides=overrides))
    small = [f"--phases.pretrain.init={start}", "--defaults.statistics=keep", "--loader.image_size=16"]
    with pytest.raises(UserError, match="image_size"):
        run_experiment(tiny(tmp_path / "small", data, overrides=small))


def test_loss_that_is_no_number_stops(tmp_path: Path, data: Path) -> None:
    with pytest.raises(UserError, match="the loss is"):
        run_experiment(tiny(tmp_path, data, "act", ["--policy.optimizer_lr=1e30", "--defaults.grad_clip_norm=0"]))


def test_average_of_weights() -> None:
    config = EmaConfig(power=0.75)
    assert [ema_decay(step, config) for step in (0, 1)] == [0.0, pytest.approx(1 - 2**-0.75)]
    assert ema_decay(10**9, config) == config.max_decay
    layer = torch.nn.Linear(2, 1, bias=False)
    layer.weight.data.fill_(1.0)
    ema, wanted = Ema(layer, config), 1.0
    for step in range(5):
        layer.weight.data.fill_(step + 2.0)
        ema.update()
        decay = ema_decay(step, config)
        wanted = decay * wanted + (1 - decay) * (step + 2.0)
    with ema.applied():
        assert layer.weight.data[0, 0].item() == pytest.approx(wanted)
    assert layer.weight.data[0, 0].item() == 6.0


def test_checkpoints_hold_the_average(tmp_path: Path, data: Path) -> None:
    from safetensors.torch import load_file

    assert not run_experiment(tiny(tmp_path, data), stop_after=4)
    raw = load_file(tmp_path / "out/pretrain/checkpoints/000004/training_state/raw_model.safetensors")
    average = weights(tmp_path, "pretrain", "000004")
    assert raw.keys() == average.keys()
    assert any(not torch.equal(raw[key], average[key]) for key in raw)
    assert not run_experiment(tiny(tmp_path / "plain", data, overrides=["--defaults.ema.enabled=false"]), stop_after=4)
    plain = weights(tmp_path / "plain", "pretrain", "000004")
    assert all(torch.equal(raw[key], plain[key]) for key in raw)  # averaging does not change the training itself


def test_learning_rate_scales_all_groups(data: Path, tmp_path: Path) -> None:
    experiment = tiny(tmp_path, data, "act", ["--defaults.learning_rate=2e-5"])
    config = builders.policy_config(experiment.policy, None, "cpu")
    from robocasa_lerobot.data.mixture import open_mixture

    meta = open_mixture(experiment.phases[0].mixture, experiment.loader).meta
    policy = builders.make_phase_policy(config, meta, None)
    optimizer, _, clip = optimizers.make_optimizer(policy, experiment.phases[0])
    preset = config.get_optimizer_preset()
    assert optimizer.param_groups[0]["lr"] == pytest.approx(2e-5)
    assert optimizer.param_groups[1]["lr"] == pytest.approx(config.optimizer_lr_backbone * 2e-5 / preset.lr)
    assert clip == preset.grad_clip_norm
    told, schedule = optimizers.in_lerobots_words(config, experiment.phases[0])
    assert told == dataclasses.replace(preset, lr=2e-5)
    assert schedule == config.get_scheduler_preset()


@pytest.mark.slow
def test_loader_processes_give_the_same_losses(tmp_path: Path, data: Path, finished: Path) -> None:
    assert run_experiment(tiny(tmp_path, data, overrides=["--loader.workers=2"]))
    assert losses(tmp_path, "pretrain") == losses(finished, "pretrain")
