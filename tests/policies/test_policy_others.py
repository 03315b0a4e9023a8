"""LeRobot's own policies: their files in `configs/policies/`, training and trials as for ours, and what they need."""

from __future__ import annotations

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from evaluation_env import SlideEnv
from lerobot.configs import NormalizationMode
from policy_models_support import tiny_settings
from policy_support import with_features
from safetensors.torch import load_file
from training_support import losses, weights

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import chunk_seed
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import STATELESS_TYPES, ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.actors.policy_runner import StepPolicy, load_actor
from robocasa_lerobot.evaluation.planning.trials import make_plan
from robocasa_lerobot.evaluation.run.rollout import run_trial
from robocasa_lerobot.policies.needs import NEEDS, explained
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.setup import build_phase as prepare
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup.kept import IN_PROCESSORS

FOLDER = Path(__file__).parents[2] / "configs/policies"
FILES = sorted(FOLDER.glob("*.yaml"))
OURS = ("diffusion_transformer", "flow_vla")
LEROBOTS = ("act", "diffusion", "multi_task_dit", "smolvla", "xvla", "pi0", "pi05", "groot")
OFFLINE = ("act", "diffusion", "multi_task_dit", "smolvla", "xvla")
DOWNLOADED = ("pi0", "pi05", "groot")  # 3 billion parameters whatever the settings, or weights that must be there
# The two with full ResNets take long.
RESUMED = [
    *(pytest.param(kind, marks=pytest.mark.slow) if kind in ("act", "diffusion") else kind for kind in OFFLINE),
    "diffusion_transformer",
    "flow_vla",
    "flow_vla_smolvlm",
    "flow_vla_paligemma",
]
SIZE = 32

# Published values (facts of the benchmark's forks): type, field, value.
PUBLISHED: list[tuple[str, dict[str, Any]]] = [
    (
        "pi0",
        {
            "chunk_size": 50, "n_action_steps": 5, "max_action_dim": 32, "tokenizer_max_length": 96,
            "num_inference_steps": 10, "time_sampling_beta_alpha": 1.5, "time_sampling_beta_beta": 1.0,
            "optimizer_lr": 2.5e-5, "optimizer_betas": (0.9, 0.95), "optimizer_weight_decay": 1e-10,
            "optimizer_grad_clip_norm": 1.0, "scheduler_warmup_steps": 1000, "scheduler_decay_steps": 100_000,
            "scheduler_decay_lr": 2.5e-6, "image_resolution": (224, 224),
        },
    ),
    (
        "pi05",
        {
            "chunk_size": 50, "n_action_steps": 5, "tokenizer_max_length": 200, "optimizer_lr": 2.5e-5,
            "optimizer_weight_decay": 1e-10, "scheduler_decay_steps": 100_000,
        },
    ),
    (
        "groot",
        {
            "chunk_size": 16, "n_action_steps": 16, "num_inference_timesteps": 4, "tune_llm": False,
            "tune_visual": False, "tune_projector": True, "tune_diffusion_model": True, "lora_rank": 0,
            "optimizer_lr": 3e-5, "optimizer_betas": (0.95, 0.999), "optimizer_weight_decay": 1e-5,
            "warmup_ratio": 0.05, "embodiment_tag": "new_embodiment",
        },
    ),
    (
        "diffusion",
        {
            "n_obs_steps": 2, "n_action_steps": 8, "spatial_softmax_num_keypoints": 32, "num_train_timesteps": 100,
            "num_inference_steps": 100, "noise_scheduler_type": "DDPM", "optimizer_lr": 1e-4,
            "optimizer_betas": (0.9, 0.95), "scheduler_warmup_steps": 1000, "crop_shape": (224, 224),
        },
    ),
]  # fmt: skip


def settings(path: Path) -> dict[str, Any]:
    return dict(yaml.safe_load(path.read_text(encoding="utf-8")))


def config_of(kind: str) -> Any:
    return builders.policy_config(settings(FOLDER / f"{kind}.yaml"), None, "cpu")


def meta() -> MixtureMeta:
    return MixtureMeta(contract.dataset_features((SIZE, SIZE)), contract.VIDEO_FPS, contract.ROBOT_TYPE, ["open"], 1, 1)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=2, length=10, image_size=SIZE)


@pytest.fixture(autouse=True)
def _without_num2words(monkeypatch: pytest.MonkeyPatch) -> None:
    """SmolVLM's processor refuses to be made without a package that only its prompts for videos use."""
    from transformers.models.smolvlm import processing_smolvlm

    if processing_smolvlm.num2words is None:
        monkeypatch.setattr(processing_smolvlm, "num2words", str)


def test_every_policy_has_a_file() -> None:
    kinds = {settings(path)["type"] for path in FILES}
    assert kinds == {*OURS, *LEROBOTS}
    assert set(NEEDS) == set(LEROBOTS)
    assert {*OURS, *OFFLINE} == kinds - set(DOWNLOADED)  # those that are trained in tests


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_file_fits_the_contracts_features(path: Path) -> None:
    config = with_features(builders.policy_config(settings(path), None, "cpu"), contract.IMAGE_SIZE)
    config.validate_features()
    assert not config.push_to_hub
    assert 1 <= config.n_action_steps <= len(config.action_delta_indices)
    assert 0 in config.action_delta_indices
    config.get_optimizer_preset()
    config.get_scheduler_preset()


@pytest.mark.parametrize(("kind", "published"), PUBLISHED, ids=[kind for kind, _ in PUBLISHED])
def test_published_settings(kind: str, published: dict[str, Any]) -> None:
    config = config_of(kind)
    found = {name: getattr(config, name) for name in published}
    found = {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}
    assert found == published
    if kind in ("pi0", "pi05"):
        assert config.normalization_mapping["STATE"] == config.normalization_mapping["ACTION"]
        assert config.normalization_mapping["ACTION"] == NormalizationMode.MEAN_STD


def test_settings_that_processors_keep_are_those_of_the_policies() -> None:
    assert IN_PROCESSORS.keys() == {*OURS, *LEROBOTS} - {"act", "diffusion"}  # which have normalisation alone
    for kind, names in IN_PROCESSORS.items():
        assert {"normalization_mapping", *names} <= {field.name for field in dataclasses.fields(config_of_type(kind))}


def config_of_type(kind: str) -> Any:
    return builders.policy_config({"type": kind}, None, "cpu")


def experiment_file(folder: Path, data: Path, kind: str, models: Path) -> Path:
    own = next((ours for ours in OURS if kind.startswith(ours)), None)
    file = FOLDER / f"{f'{own}_demo' if own else kind}.yaml"
    content = {
        "name": "test",
        "output_dir": str(folder / "out"),
        "device": "cpu",
        "policy": {"file": str(file), **tiny_settings(kind, models)},
        "loader": {"cache_dir": str(data.parent / "frames")},
        "phases": [
            {
                "name": "train",
                "mixture": {"members": [{"root": str(data)}]},
                "steps": 4,
                "batch_size": 2,
                "log_every": 1,
                "save_every": 2,
                "save_initial": True,
            }
        ],
    }
    folder.mkdir()
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.costly
@pytest.mark.parametrize("kind", RESUMED)
def test_two_steps_and_two_more_equal_four_and_a_trial(kind: str, data: Path, tmp_path: Path) -> None:
    at_once, in_two = tmp_path / "at_once", tmp_path / "in_two"
    models = tmp_path / "models"
    assert run_experiment(load_experiment(experiment_file(at_once, data, kind, models)))
    halves = load_experiment(experiment_file(in_two, data, kind, models))
    assert not run_experiment(halves, stop_after=2)
    assert run_experiment(halves)
    lines = losses(at_once, "train")
    assert [step for step, *_ in lines] == [1, 2, 3, 4]
    assert all(math.isfinite(loss) and norm > 0 for _, loss, norm in lines)
    assert losses(in_two, "train") == lines
    whole, resumed = weights(at_once, "train"), weights(in_two, "train")
    assert whole.keys() == resumed.keys()
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    assert any(not torch.equal(whole[name], value) for name, value in weights(at_once, "train", "000000").items())

    runner = load_actor(read_source(str(at_once / "out/train/checkpoints/000004/pretrained_model")), "cpu", None)
    (trial,) = make_plan(["test"], {"Slide": 6}, trials=1, seed=3, videos=0)
    actions = []
    for _ in range(2):
        env = SlideEnv("Slide", image_size=SIZE)
        observation, _ = env.reset(seed=1)
        runner.reset(5, env)
        actions.append(np.stack([runner.act(observation, "open the left drawer") for _ in range(6)]))
        assert actions[-1].shape == (6, contract.ACTION_SIZE)
        assert np.isfinite(actions[-1]).all()
    np.testing.assert_array_equal(*actions)
    check_chunk(read_source(str(at_once / "out/train")), actions[0])
    assert run_trial(SlideEnv("Slide", image_size=SIZE, horizon=6), runner, trial).steps <= 6


def check_chunk(source: Any, actions: np.ndarray) -> None:
    """Where a policy is asked for whole chunks: the first is what LeRobot's own queue gives, one call for each step."""
    loaded = LoadedCheckpoint(source, "cpu", None)
    if source.type not in STATELESS_TYPES:
        return
    assert ChunkPolicy.serves(loaded)
    steps, env = StepPolicy(loaded), SlideEnv("Slide", image_size=SIZE)
    observation, _ = env.reset(seed=1)
    steps.reset(chunk_seed(5, 0), env)
    executed = ChunkPolicy(loaded, 1).shape.executed
    theirs = np.stack([steps.act(observation, "open the left drawer") for _ in range(min(executed, len(actions)))])
    np.testing.assert_array_equal(actions[: len(theirs)], theirs)


@pytest.mark.slow
def test_gr00t_is_asked_for_chunks_as_its_own_queue_gives_them(tmp_path: Path) -> None:
    """A tiny one with the published names in a cache of the hub, which a process looks for when it starts."""
    pytest.importorskip("tree", reason="GR00T needs dm-tree")
    script = Path(__file__).parents[1] / "support" / "groot_chunks.py"
    tests = str(script.parent)
    environment = {
        **os.environ, "HF_HOME": str(tmp_path), "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join((f"{tests}/tiny_gemma", tests, str(script.parents[2]))),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]


def state_files(folder: Path) -> dict[str, dict[str, torch.Tensor]]:
    state = folder / "out/train/checkpoints/000004/training_state"
    return {name: load_file(state / f"{name}.safetensors") for name in ("master_weights", "average")}


def test_half_precision_goes_on_as_if_never_stopped(data: Path, tmp_path: Path) -> None:
    """SmolVLA with its language model trained, which LeRobot keeps in bfloat16: in one go, and stopped half-way."""
    for name in ("at_once", "in_two"):
        path = experiment_file(tmp_path / name, data, "smolvla", tmp_path / "models")
        experiment = load_experiment(path, ["--policy.train_expert_only=false", "--policy.freeze_vision_encoder=false"])
        assert name == "at_once" or not run_experiment(experiment, stop_after=2)
        assert run_experiment(experiment)
    assert losses(tmp_path / "at_once", "train") == losses(tmp_path / "in_two", "train")
    whole, resumed = weights(tmp_path / "at_once", "train"), weights(tmp_path / "in_two", "train")
    assert any(value.dtype == torch.bfloat16 for value in whole.values())
    assert all(torch.equal(value, resumed[key]) for key, value in whole.items())
    ours, theirs = state_files(tmp_path / "at_once"), state_files(tmp_path / "in_two")
    for kind, values in ours.items():
        assert {value.dtype for value in values.values()} == {torch.float32}
        assert all(torch.equal(value, theirs[kind][key]) for key, value in values.items())


def groot_config(folder: Path, **changes: Any) -> Any:
    folder.mkdir(parents=True, exist_ok=True)
    path = {"base_model_path": str(folder)}
    config = builders.policy_config({**settings(FOLDER / "groot.yaml"), **path, **changes}, None, "cpu")
    return with_features(config, contract.IMAGE_SIZE)


def random_steps(pre: Any) -> dict[str, bool]:
    return {type(step).__name__: step.training for step in pre.steps if hasattr(step, "training")}


def test_processors_of_a_checkpoint_train_as_new_ones_do(tmp_path: Path) -> None:
    """GR00T crops pictures at random and drops states: after a kill and with `statistics: keep`, too."""
    config, made_up = groot_config(tmp_path / "base"), meta()
    numbers = {"min": -1.0, "max": 1.0, "mean": 0.0, "std": 1.0, "q01": -0.9, "q99": 0.9, "count": 10.0}
    sizes = {"observation.state": contract.STATE_SIZE, "action": contract.ACTION_SIZE}
    made_up.stats = {key: {k: np.full(n, v) for k, v in numbers.items()} for key, n in sizes.items()}
    pre, post = builders.make_processors(config, made_up, None, keep_statistics=False)
    assert set(random_steps(pre).values()) == {True}
    pre.save_pretrained(tmp_path / "checkpoint")
    post.save_pretrained(tmp_path / "checkpoint")
    again, _ = builders.make_processors(config, made_up, tmp_path / "checkpoint", keep_statistics=True)
    assert random_steps(again) == random_steps(pre)


@pytest.mark.parametrize("name", ["multitask_gr00t", "foundation", "lifelong", "lifelong_lora", "joint_cotraining"])
def test_gr00t_warms_up_for_a_twentieth_of_each_phase(name: str) -> None:
    experiment = load_experiment(FOLDER.parent / f"experiments/robocasa365/{name}.yaml")
    for phase in experiment.phases:
        config = builders.policy_config(*prepare.planned_policy(experiment, phase), "cpu")
        assert config.get_scheduler_preset().num_warmup_steps == 0.05 * phase.steps
        assert phase.drop_last_frames == 0  # published: every frame starts a sample
        assert config.drop_n_last_frames == 15


@pytest.mark.parametrize("kind", ["multi_task_dit", "smolvla", "xvla", "groot"])
def test_missing_weights_are_named(kind: str) -> None:
    with pytest.raises(UserError, match="could not be built") as raised:
        builders.make_phase_policy(config_of(kind), meta(), None)
    assert f"lerobot[{NEEDS[kind].extra}]" in str(raised.value)
    assert NEEDS[kind].weights in str(raised.value)
    assert NEEDS[kind].remedy in str(raised.value)
    assert raised.value.__cause__ is not None


@pytest.mark.parametrize("kind", ["pi0", "pi05"])
def test_missing_tokenizer_is_named(kind: str) -> None:
    # Their networks build without weights, at 3 billion parameters: only the processors are made here.
    with pytest.raises(UserError, match="google/paligemma-3b-pt-224") as raised:
        builders.make_processors(with_features(config_of(kind), SIZE), meta(), None, keep_statistics=False)
    assert f"lerobot[{NEEDS[kind].extra}]" in str(raised.value)


def test_other_errors_pass_as_they_are() -> None:
    with pytest.raises(UserError, match=r"^mine$"), explained("pi0"):
        raise UserError("mine")
    with pytest.raises(ValueError, match=r"^not a need$"), explained("flow_vla"):
        raise ValueError("not a need")
    with pytest.raises(RuntimeError, match=r"^a bug$"), explained("pi0"):
        raise RuntimeError("a bug")
    with pytest.raises(UserError, match=r"No module named 'timm'.*lerobot\[groot\]"), explained("groot"):
        raise ModuleNotFoundError("No module named 'timm'")
