"""Episodes that are held out: which ones, the loss on them, and that measuring it does not change the training."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from training_support import losses, tiny

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import open_mixture
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.training.config.phase import HeldOutConfig
from robocasa_lerobot.training.held_out import task_names, without_held_out
from robocasa_lerobot.training.phases import run_experiment


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=8, length=12, image_size=32)


def test_held_out_episodes_are_not_trained_on(tmp_path: Path, data: Path) -> None:
    overrides = ["--defaults.steps=2", "--defaults.held_out={share: 0.25, every: 1, samples: 8}"]
    experiment = tiny(tmp_path, data, overrides=overrides)
    mixture = open_mixture(experiment.phases[0].mixture, experiment.loader)
    mixture.config.draw = "episodes"
    kept, apart = without_held_out(mixture, HeldOutConfig(share=0.25), experiment.loader, seed=0)
    assert kept.config.draw == "episodes"
    assert mixture.sources == kept.sources == apart.sources  # opened once
    numbers = [dataset.config.members[0].episodes or [] for dataset in (kept, apart)]
    assert sorted([*numbers[0], *numbers[1]]) == list(range(8))
    assert len(numbers[1]) == 2  # one of four of each task
    assert {number % 2 for number in numbers[1]} == {0, 1}
    assert run_experiment(experiment, only="pretrain")
    lines = [json.loads(line) for line in (tmp_path / "out/pretrain/held_out.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [1, 2]
    assert lines[0]["tasks"].keys() == {"OpenDrawer", "CloseDrawer"}
    assert lines[0]["loss"] == pytest.approx(np.mean(list(lines[0]["tasks"].values())))
    assert lines[0] != lines[1]


def test_few_demonstrations_are_all_trained_on(tmp_path: Path, data: Path) -> None:
    """Of one task two or three are used, of which a quarter is less than one; of the other all four."""
    experiment = tiny(tmp_path, data)
    for demos in ("2", "3"):
        for seed in range(8):
            config = MixtureConfig([MemberConfig(str(data), demos=demos), MemberConfig(str(data), ["OpenDrawer"])])
            mixture = open_mixture(config, experiment.loader)
            names = task_names(mixture.sources[data])
            kept, apart = without_held_out(mixture, HeldOutConfig(share=0.25), experiment.loader, seed)
            trained = {e for member in kept.config.members for e in member.episodes or []}
            held = {e for member in apart.config.members for e in member.episodes or []}
            assert [names[e] for e in held] == ["OpenDrawer"]
            assert not held & trained
            assert sum(names[e] == "CloseDrawer" for e in trained) == int(demos)
        few = open_mixture(MixtureConfig([MemberConfig(str(data), demos=demos)]), experiment.loader)
        assert without_held_out(few, HeldOutConfig(share=0.25), experiment.loader, seed=0) == (few, None)
        half = without_held_out(few, HeldOutConfig(share=0.5), experiment.loader, seed=0)[1]
        assert half is not None


def test_single_demonstrations_are_trained_on_and_none_is_held_out(
    tmp_path: Path, data: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    overrides = ["--defaults.held_out={share: 0.1}", f"--phases.pretrain.mixture.members=[{{root: {data}, demos: 1}}]"]
    assert run_experiment(tiny(tmp_path, data, overrides=overrides), only="pretrain")
    assert not (tmp_path / "out/pretrain/held_out.jsonl").exists()
    assert "tasks have too few episodes" in capfd.readouterr().out


def test_measuring_held_out_episodes_does_not_change_the_training(tmp_path: Path, data: Path) -> None:
    common = ["--defaults.steps=3"]
    often = [*common, "--defaults.held_out={share: 0.25, every: 1, samples: 8}"]
    seldom = [*common, "--defaults.held_out={share: 0.25, every: 9, samples: 8}"]
    for name, overrides in (("often", often), ("seldom", seldom)):
        assert run_experiment(tiny(tmp_path / name, data, overrides=overrides), only="pretrain")
    assert losses(tmp_path / "often", "pretrain") == losses(tmp_path / "seldom", "pretrain")
