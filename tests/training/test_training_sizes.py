"""A phase whose policy does not fit what it starts from is refused before anything is trained."""

from __future__ import annotations

from pathlib import Path

import pytest
from training_support import experiment_file

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment


def run(folder: Path, data: Path, *settings: str) -> bool:
    return run_experiment(load_experiment(experiment_file(folder, data, defaults={"steps": 1}), settings))


def test_sizes_that_do_not_fit_the_phase_before(tmp_path: Path, data: Path) -> None:
    message = r"sets policy\.dropout, policy\.width, with which \d+ of the weights .* 16.* there, and .*32.* here"
    with pytest.raises(UserError, match=message):
        run(tmp_path, data, "--phases.finetune.policy.dropout=0.2", "--phases.finetune.policy.width=32")
    assert not (tmp_path / "out").exists()


def test_settings_that_change_no_size_pass_and_those_of_a_checkpoint_are_looked_at(tmp_path: Path, data: Path) -> None:
    assert run(tmp_path / "first", data, "--phases.finetune.policy.dropout=0.2")
    start = f"--phases.pretrain.init={tmp_path}/first/out/pretrain/checkpoints/last/pretrained_model"
    keep = "--phases.pretrain.statistics=keep"
    with pytest.raises(UserError, match=r"'pretrain' sets policy\.width, with which"):
        run(tmp_path / "second", data, start, keep, "--phases.pretrain.policy.width=32")
    assert not (tmp_path / "second/out").exists()


@pytest.mark.parametrize("setting", ["leave_out=[observation.images.wrist]", "rename={observation.state: state}"])
def test_inputs_of_weights_where_there_are_none(setting: str, tmp_path: Path, data: Path) -> None:
    with pytest.raises(UserError, match=r"'pretrain' sets policy\.\w+, .* starts from_scratch, .*loader\.cameras"):
        run(tmp_path, data, f"--phases.pretrain.policy.{setting}")
