"""Policies that clip what they sample, where a later phase's actions go beyond the statistics that are kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from lerobot.policies.factory import get_policy_class
from training_support import experiment_file

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)


@pytest.mark.parametrize("widest", [2.0, 1.0])
def test_what_was_widened_goes_back_with_the_statistics(widest: float, tmp_path: Path, data: Path) -> None:
    """A third phase keeps the statistics and with them the reach, or makes its own, in which nothing lies beyond 1."""
    path = experiment_file(tmp_path, data, defaults={"steps": 1})
    content = yaml.safe_load(path.read_text())
    content["phases"][0]["mixture"]["members"][0]["tasks"] = ["CloseDrawer"]
    statistics = "keep" if widest > 1 else "replace"
    content["phases"].append({**content["phases"][1], "name": "third", "statistics": statistics})
    path.write_text(yaml.safe_dump(content))
    assert run_experiment(load_experiment(path))
    reaches = [
        json.loads((tmp_path / "out" / phase / "checkpoints/last/pretrained_model/config.json").read_text())
        for phase in ("finetune", "third")
    ]
    assert [config["clip_sample_range"] for config in reaches] == pytest.approx([2.0, widest], abs=1e-3)


@pytest.mark.parametrize("own", [None, 1.5])
def test_sampling_reaches_actions_that_the_kept_statistics_do_not_know(
    own: float | None, tmp_path: Path, data: Path
) -> None:
    """The gripper of made-up data is at -1 in one task and at 1 in the other: a constant becomes the range -2 to 0."""
    path = experiment_file(tmp_path, data)
    content = yaml.safe_load(path.read_text())
    content["phases"][0]["mixture"]["members"][0]["tasks"] = ["CloseDrawer"]
    if own is not None:
        content["phases"][1]["policy"] = {"clip_sample_range": own}
    path.write_text(yaml.safe_dump(content))
    run_experiment(load_experiment(path), stop_after=6)  # of 4 and 4
    assert run_experiment(load_experiment(path)), "it goes on as it began"
    for phase, wanted in (("pretrain", 1.0), ("finetune", own or 2.0)):
        folder = tmp_path / "out" / phase / "checkpoints/last/pretrained_model"
        policy = get_policy_class("diffusion_transformer").from_pretrained(folder)
        assert policy.config.clip_sample_range == pytest.approx(wanted, abs=1e-3)
        assert policy.scheduler.config.clip_sample_range == pytest.approx(wanted, abs=1e-3)
