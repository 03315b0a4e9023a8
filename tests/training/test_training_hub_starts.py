"""Starts from checkpoints whose cameras, states and actions are others than ours, as those on the hub are."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from evaluation_env import SlideEnv
from lerobot.configs.policies import PreTrainedConfig
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.policies.utils import validate_visual_features_consistency
from lerobot.utils.feature_utils import dataset_to_policy_features
from policy_models_support import tiny_settings
from policy_support import unit_stats
from training_support import losses

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.policy_runner import load_actor
from robocasa_lerobot.evaluation.planning.trials import make_plan
from robocasa_lerobot.evaluation.run.rollout import run_trial
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import check_phase, run_experiment
from robocasa_lerobot.training.setup import build_phase as prepare
from robocasa_lerobot.training.setup import builders, features

CONFIGS = Path(__file__).parents[2] / "configs"
SIZE = 32
LEFT, RIGHT, WRIST = (
    contract.image_key(f"robot0_{name}") for name in ("agentview_left", "agentview_right", "eye_in_hand")
)
# Inputs of the published weights, from their config.json: cameras, size of their pictures, of states and of actions.
HUB: dict[str, tuple[tuple[str, ...], int, int, int]] = {
    "pi0": (("base_0_rgb", "left_wrist_0_rgb", "right_wrist_0_rgb"), 224, 32, 32),
    "pi05": (("base_0_rgb", "left_wrist_0_rgb", "right_wrist_0_rgb"), 224, 32, 32),
    "smolvla": (("camera1", "camera2", "camera3"), 256, 6, 6),
    "xvla": (("image", "image2", "image3"), 256, 8, 20),
}
PLACES = {
    "pi0": [LEFT, WRIST],
    "pi05": [LEFT, WRIST, RIGHT],
    "smolvla": [LEFT, WRIST, RIGHT],
    "xvla": [LEFT, WRIST, RIGHT],
}


def hub_features(kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    cameras, size, state, action = HUB[kind]
    inputs = {contract.IMAGE_PREFIX + name: {"type": "VISUAL", "shape": [3, size, size]} for name in cameras}
    inputs["observation.state"] = {"type": "STATE", "shape": [state]}
    return inputs, {"action": {"type": "ACTION", "shape": [action]}}


def preset(kind: str) -> dict[str, Any]:
    return dict(yaml.safe_load((CONFIGS / f"policies/{kind}.yaml").read_text()))


def hub_config(folder: Path, kind: str, **fields: Any) -> Path:
    """A folder with a config.json alone, as the published ones have it."""
    folder.mkdir(parents=True)
    inputs, outputs = hub_features(kind)
    content = {"type": kind, "n_obs_steps": 1, "input_features": inputs, "output_features": outputs, **fields}
    (folder / "config.json").write_text(json.dumps(content))
    return folder


def meta(size: int = contract.IMAGE_SIZE) -> MixtureMeta:
    return MixtureMeta(contract.dataset_features((size, size)), contract.VIDEO_FPS, contract.ROBOT_TYPE, ["open"], 1, 1)


@pytest.mark.parametrize(("name", "kind"), [("multitask_pi0", "pi0"), ("multitask_pi05", "pi05")])
def test_benchmarks_settings_come_before_the_weights_own(name: str, kind: str, tmp_path: Path) -> None:
    """LeRobot's pi0 on the hub executes 50 steps, reads 48 words and decays over 30,000 steps; published: other."""
    folder = hub_config(
        tmp_path / "hub", kind, n_action_steps=50, tokenizer_max_length=48, scheduler_decay_steps=30_000
    )
    file = CONFIGS / f"experiments/robocasa365/{name}.yaml"
    experiment = load_experiment(file, [f"--phases.multitask.init={folder}"])
    config: Any = builders.policy_config(*prepare.planned_policy(experiment, experiment.phases[0]), "cpu")
    made = builders.policy_config(preset(kind), None, "cpu")
    for field in preset(kind).keys() - {"type", "rename", "leave_out"}:
        assert getattr(config, field) == getattr(made, field), field
    assert (config.n_action_steps, config.scheduler_decay_steps) == (5, 100_000)
    features.check_features(config, meta())
    features.fit_features(config, meta())
    assert [key for key in config.input_features if key in contract.IMAGE_KEYS] == PLACES[kind]
    assert {key: feature.shape for key, feature in config.input_features.items()} == {
        **dict.fromkeys(PLACES[kind], (3, contract.IMAGE_SIZE, contract.IMAGE_SIZE)),
        "observation.state": (contract.STATE_SIZE,),
    }
    assert config.output_features["action"].shape == (contract.ACTION_SIZE,)
    config.validate_features()


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=2, length=10, image_size=SIZE)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, r"tokenizer of google/paligemma-3b-pt-224"),
        ({"rename": None, "leave_out": None}, r"base_0_rgb'.*rename: "),
        (
            {"leave_out": ["observation.images.right_wrist_0_rg"]},
            r"Did you mean 'observation.images.right_wrist_0_rgb'",
        ),
        ({"rename": {LEFT: "observation.images.base_0_rbg"}}, r"Did you mean 'observation.images.base_0_rgb'"),
        ({"rename": {LEFT: "observation.images.left_wrist_0_rgb"}}, r"gives two features to one"),
        ({"max_state_dim": 8}, r"shape \(32,\), the data \(16,\)"),
    ],
)
def test_what_does_not_fit_is_found_without_the_weights(
    settings: dict[str, Any], message: str, tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", True)
    folder = hub_config(tmp_path / "hub", "pi0")
    file = tmp_path / "experiment.yaml"
    phase = {"name": "multitask", "init": str(folder), "mixture": {"members": [{"root": str(data)}]}}
    base = str(CONFIGS / "experiments/robocasa365/multitask_pi0.yaml")
    out = {"output_dir": str(tmp_path / "out"), "device": "cpu", "mixed_precision": "no"}
    file.write_text(yaml.safe_dump({"base": base, **out, "policy": settings, "phases": [phase]}))
    with pytest.raises(UserError, match=message):
        run_experiment(load_experiment(file))
    assert not (tmp_path / "out/multitask").exists()


def test_statistics_of_another_robot_are_not_kept(tmp_path: Path, data: Path) -> None:
    folder = hub_config(tmp_path / "hub", "smolvla")
    path = experiment_file(tmp_path, data, "smolvla", folder, statistics="keep")
    experiment = load_experiment(path)
    with pytest.raises(UserError, match=r"'observation.state' of shape \(6,\).*`statistics: replace`"):
        check_phase(experiment, experiment.phases[0], "cpu")


def experiment_file(folder: Path, data: Path, kind: str, start: Path, statistics: str = "replace") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    common = {"mixture": {"members": [{"root": str(data)}]}, "steps": 2, "batch_size": 2, "log_every": 1}
    content = {
        "name": "test",
        "output_dir": str(folder / "out"),
        "device": "cpu",
        "policy": {"file": str(CONFIGS / f"policies/{kind}.yaml"), **tiny_settings(kind, folder.parent / "models")},
        "loader": {"cache_dir": str(data.parent / "frames")},
        "phases": [
            {"name": "train", "init": str(start), "statistics": statistics, **common},
            {"name": "further", "statistics": "keep", **common},
        ],
    }
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def hub_checkpoint(folder: Path, kind: str, models: Path) -> Path:
    """A small policy of random weights with the features of the published one."""
    config: Any = builders.policy_config({**preset(kind), **tiny_settings(kind, models)}, None, "cpu")
    inputs, outputs = hub_features(kind)
    as_feature = lambda f: PolicyFeature(FeatureType[f["type"]], tuple(f["shape"]))  # noqa: E731
    config.input_features = {key: as_feature(feature) for key, feature in inputs.items()}
    config.output_features = {key: as_feature(feature) for key, feature in outputs.items()}
    torch.manual_seed(0)
    get_policy_class(kind)(config).save_pretrained(folder)
    return folder


@pytest.fixture(autouse=True)
def _without_num2words(monkeypatch: pytest.MonkeyPatch) -> None:
    """SmolVLM's processor refuses to be made without a package that only its prompts for videos use."""
    from transformers.models.smolvlm import processing_smolvlm

    if processing_smolvlm.num2words is None:
        monkeypatch.setattr(processing_smolvlm, "num2words", str)


@pytest.mark.costly
@pytest.mark.parametrize("kind", ["smolvla", "xvla"])
def test_a_published_policy_trains_goes_on_and_acts_in_our_kitchen(kind: str, tmp_path: Path, data: Path) -> None:
    start = hub_checkpoint(tmp_path / "hub", kind, tmp_path / "models")
    experiment = load_experiment(experiment_file(tmp_path / "run", data, kind, start))
    assert not run_experiment(experiment, stop_after=1)
    assert run_experiment(experiment)
    for phase in ("train", "further"):
        assert all(math.isfinite(loss) for _, loss, _ in losses(tmp_path / "run", phase))
        checkpoint = tmp_path / f"run/out/{phase}/checkpoints/000002/pretrained_model"
        config = json.loads((checkpoint / "config.json").read_text())
        cameras = [key for key in config["input_features"] if key.startswith(contract.IMAGE_PREFIX)]
        assert cameras == PLACES[kind]
        assert config["input_features"]["observation.state"]["shape"] == [contract.STATE_SIZE]
        assert config["output_features"]["action"]["shape"] == [contract.ACTION_SIZE]
    source = read_source(str(checkpoint))
    actor: Any = load_actor(source, "cpu", None)
    saved = PreTrainedConfig.from_pretrained(checkpoint)  # as `lerobot-eval` reads it, without a `--rename_map`
    validate_visual_features_consistency(saved, dataset_to_policy_features(meta().features))
    (trial,) = make_plan(["test"], {"Slide": 6}, trials=1, seed=3, videos=0)
    env = SlideEnv("Slide", image_size=SIZE)
    observation, _ = env.reset(seed=1)
    actor.reset(5, env)
    action = actor.act(observation, "open the left drawer")
    assert action.shape == (contract.ACTION_SIZE,)
    assert np.isfinite(action).all()
    assert run_trial(SlideEnv("Slide", image_size=SIZE, horizon=6), actor, trial).steps <= 6


def test_kept_statistics_of_renamed_cameras_are_used(tmp_path: Path, data: Path) -> None:
    """A checkpoint that normalises pictures of cameras with other names: ours in their places are the same inputs."""
    start, names = tmp_path / "start", dict(zip((LEFT, RIGHT, WRIST), ("one", "two", "three"), strict=True))
    rename = {ours: contract.IMAGE_PREFIX + name for ours, name in names.items()}
    path = experiment_file(tmp_path / "run", data, "act", start, statistics="keep")
    content = yaml.safe_load(path.read_text())
    content["policy"]["rename"] = rename
    path.write_text(yaml.safe_dump(content))
    found = dataset_to_policy_features(meta(SIZE).features)
    settings = {**preset("act"), **tiny_settings("act", tmp_path / "models")}
    config: Any = builders.policy_config(settings, None, "cpu")
    config.output_features = {contract.ACTION_KEY: found.pop(contract.ACTION_KEY)}
    config.input_features = {rename.get(key, key): feature for key, feature in found.items()}
    get_policy_class("act")(config).save_pretrained(start)
    pictures = {
        key: {"mean": np.full((3, 1, 1), 0.1 * i), "std": np.full((3, 1, 1), 0.5)}
        for i, key in enumerate(rename.values(), 1)
    }
    pre, post = make_pre_post_processors(config, dataset_stats={**unit_stats(), **pictures})
    pre.save_pretrained(start)
    post.save_pretrained(start)
    assert run_experiment(load_experiment(path))
    for phase in ("train", "further"):
        checkpoint = tmp_path / f"run/out/{phase}/checkpoints/000002/pretrained_model"
        preprocessor, _ = make_pre_post_processors(PreTrainedConfig.from_pretrained(checkpoint), str(checkpoint))
        batch = {key: torch.full((1, 3, SIZE, SIZE), 0.7) for key in rename}
        inputs = preprocessor({**batch, contract.STATE_KEY: torch.zeros(1, contract.STATE_SIZE)})
        for i, key in enumerate(rename, 1):
            torch.testing.assert_close(inputs[key], (batch[key] - 0.1 * i) / 0.5)
