"""Optimisers and schedules of a phase: the policy's own, with what the phase changes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from training_support import losses, tiny

from robocasa_lerobot.data.mixture import open_mixture
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.setup import builders, optimizers


def test_optimizer_and_schedule_of_a_phase(tmp_path: Path, data: Path) -> None:
    def made(*overrides: str) -> tuple[torch.optim.Optimizer, Any]:
        experiment = tiny(tmp_path, data, "act", overrides)
        config = builders.policy_config(experiment.policy, None, "cpu")
        meta = open_mixture(experiment.phases[0].mixture, experiment.loader).meta
        policy = builders.make_phase_policy(config, meta, None)
        return optimizers.make_optimizer(policy, experiment.phases[0])[:2]

    optimizer, _ = made("--phases.pretrain.optimizer={weight_decay: 0.5, betas: [0.5, 0.6]}")
    assert optimizer.param_groups[0]["weight_decay"] == 0.5
    assert optimizer.param_groups[0]["betas"] == (0.5, 0.6)
    optimizer, schedule = made(
        "--phases.pretrain.optimizer={type: sgd, lr: 0.1}", "--phases.pretrain.scheduler={type: none}"
    )
    assert isinstance(optimizer, torch.optim.SGD)
    assert schedule is None
    optimizer, _ = made("--phases.pretrain.optimizer={type: adam}")
    own = builders.policy_config(tiny(tmp_path, data, "act").policy, None, "cpu").get_optimizer_preset()
    assert optimizer.param_groups[0]["lr"] == own.lr, "the policy's, not that of LeRobot's adam"
    optimizer, _ = made("--phases.pretrain.optimizer={type: xvla-adamw}", "--phases.pretrain.lora={rank: 2}")
    assert [group["name"] for group in optimizer.param_groups] == ["other"]  # it goes by names
    optimizer, _ = made(
        "--phases.pretrain.optimizer={type: muon, matrix_lr: 0.1}", "--phases.pretrain.learning_rate=1e-6"
    )
    assert [group["lr"] for group in optimizer.param_groups] == pytest.approx([0.1 * 1e-6 / own.lr, 1e-6])
    cosine = "type: cosine_decay_with_warmup, num_decay_steps: 1000, peak_lr: 1.0, decay_lr: 0.1, num_warmup_steps: 3"
    _, schedule = made(f"--phases.pretrain.scheduler={{{cosine}}}")  # a warm-up that was asked for is not shortened
    assert [schedule.lr_lambdas[0](step) for step in range(3)] == pytest.approx([0.25, 0.5, 0.75])
    with pytest.raises(UserError, match="Did you mean 'weight_decay'"):
        made("--phases.pretrain.optimizer={weight_decy: 0.5}")
    with pytest.raises(UserError, match="type of optimizer"):
        made("--phases.pretrain.optimizer={type: sdg}")


@pytest.mark.costly
def test_matrices_are_trained_by_muon_where_a_policy_says_so(tmp_path: Path, data: Path) -> None:
    """In one go and stopped, by the same rates in both phases; LeRobot's settings of it lie beside the weights."""
    changes = ["--policy.optimizer_name=muon", "--phases.finetune.learning_rate=5e-4"]
    assert run_experiment(tiny(tmp_path, data, overrides=changes))
    plain, again = tmp_path / "plain", tmp_path / "again"
    plain.mkdir()
    again.mkdir()
    assert run_experiment(tiny(plain, data))
    assert losses(tmp_path, "pretrain")[0] == losses(plain, "pretrain")[0]
    assert losses(tmp_path, "pretrain")[1:] != losses(plain, "pretrain")[1:]
    stopped = tiny(again, data, overrides=changes)
    assert not run_experiment(stopped, stop_after=3)
    assert run_experiment(stopped)
    for phase in ("pretrain", "finetune"):
        assert losses(again, phase) == losses(tmp_path, phase)
        told = json.loads((tmp_path / f"out/{phase}/checkpoints/last/pretrained_model/train_config.json").read_text())
        part = 1.0 if phase == "pretrain" else 0.5
        assert told["optimizer"]["type"] == "muon"
        assert (told["optimizer"]["lr"], told["optimizer"]["matrix_lr"]) == pytest.approx((1e-3 * part, 0.01 * part))
