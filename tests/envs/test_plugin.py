"""LeRobot finds our env and policy types in both of its ways, and the env type is a drop-in for LeRobot's own."""

from __future__ import annotations

import copy
import importlib.metadata
import inspect
import json
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import gymnasium
import numpy as np
import pytest
from lerobot.configs import FeatureType
from lerobot.configs.policies import PreTrainedConfig
from lerobot.envs import make_env
from lerobot.envs.configs import EnvConfig, RoboCasaEnv
from lerobot.envs.factory import make_env_config
from lerobot.envs.utils import close_envs, env_to_policy_features

from robocasa_lerobot import contract
from robocasa_lerobot.cli import doctor
from robocasa_lerobot.envs.lerobot_plugin import ENV_TYPE, RobocasaKitchenEnvConfig
from robocasa_lerobot.envs.tasks import registry
from robocasa_lerobot.errors import UnknownNameError, UserError

COMPANION = "lerobot_policy_robocasa"


def in_new_process(code: str, *arguments: str) -> str:
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().splitlines()[-1]


def test_companion_is_named_as_lerobots_discovery_wants() -> None:
    # It compares the raw Name of the metadata, and imports the module of exactly that name.
    names = [distribution.metadata["Name"] for distribution in importlib.metadata.distributions()]
    assert COMPANION in names, "run `make setup`"


@pytest.mark.costly
def test_discovery_of_installed_plugins_finds_both_types() -> None:
    finding = doctor.check_plugins()  # asks LeRobot in a fresh process
    assert finding.status == "ok", finding
    assert ENV_TYPE in finding.found
    assert "diffusion_transformer" in finding.found


@pytest.mark.slow
def test_discovery_flag_finds_both_types() -> None:
    """`--env.discover_packages_path` on LeRobot's command line, without the companion distribution."""
    parsed = in_new_process(
        "import json, sys\n"
        "from dataclasses import dataclass\n"
        "from lerobot.configs import parser\n"
        "from lerobot.envs.configs import EnvConfig\n"
        "from lerobot.configs.policies import PreTrainedConfig\n"
        "@dataclass\n"
        "class Config:\n"
        "    env: EnvConfig\n"
        "@parser.wrap()\n"
        "def main(cfg: Config):\n"
        "    print(json.dumps([cfg.env.type, cfg.env.task, list(PreTrainedConfig.get_known_choices())]))\n"
        "main()",
        "--env.discover_packages_path=robocasa_lerobot.plugins",
        f"--env.type={ENV_TYPE}",
        "--env.task=CloseDrawer",
    )
    env_type, task, policy_types = json.loads(parsed)
    assert (env_type, task) == (ENV_TYPE, "CloseDrawer")
    assert "diffusion_transformer" in policy_types


def test_policy_types_are_registered_by_the_plugins_package() -> None:
    import robocasa_lerobot.plugins  # noqa: F401

    assert ENV_TYPE in EnvConfig.get_known_choices()
    assert "diffusion_transformer" in PreTrainedConfig.get_known_choices()


def test_keys_shapes_and_rate_are_those_of_lerobots_robocasa() -> None:
    ours, theirs = make_env_config(ENV_TYPE), RoboCasaEnv()
    assert env_to_policy_features(ours) == env_to_policy_features(theirs)
    assert ours.features_map == theirs.features_map
    assert ours.fps == theirs.fps


def test_policy_features_follow_from_the_contract() -> None:
    features = env_to_policy_features(RobocasaKitchenEnvConfig(image_size=96))
    assert {key: (feature.type, tuple(feature.shape)) for key, feature in features.items()} == {
        contract.ACTION_KEY: (FeatureType.ACTION, (12,)),
        contract.STATE_KEY: (FeatureType.STATE, (16,)),
        **dict.fromkeys(contract.IMAGE_KEYS, (FeatureType.VISUAL, (3, 96, 96))),
    }


def test_tasks_by_list() -> None:
    config = RobocasaKitchenEnvConfig(task="OpenDrawer, CloseDrawer")
    assert config.task_names() == ("OpenDrawer", "CloseDrawer")


@pytest.mark.parametrize(
    ("task", "split"),
    [
        ("pretrain50", "pretrain"),
        ("pretrain300", "pretrain"),
        ("atomic_seen", "target"),
        ("composite_unseen", "target"),
        ("OpenDrawer", "target"),
        ("pretrain50,OpenDrawer", "target"),
    ],
)
def test_task_sets_have_lerobots_splits(task: str, split: str) -> None:
    from lerobot.envs.robocasa import _TASK_GROUP_SPLITS

    assert RobocasaKitchenEnvConfig(task=task).gym_kwargs["split"] == _TASK_GROUP_SPLITS.get(task, split) == split
    assert RobocasaKitchenEnvConfig(task=task, split="pretrain_val").gym_kwargs["split"] == "pretrain_val"


def test_lerobot_takes_all_kitchens_for_a_task_as_is_said_where_ours_are_the_targets() -> None:
    from lerobot.envs import robocasa

    assert 'split=self.split if self.split is not None else "all"' in inspect.getsource(robocasa.RoboCasaEnv)
    assert RobocasaKitchenEnvConfig(task="OpenDrawer").gym_kwargs["split"] == "target"


def test_task_sets_stand_for_their_members() -> None:
    for name in registry.task_sets():
        assert RobocasaKitchenEnvConfig(task=name).task_names() == registry.task_set(name)


@pytest.mark.parametrize("task", ["", " , ", "OpenDrawer,OpenDrawer"])
def test_no_task_or_one_twice_is_an_error(task: str) -> None:
    with pytest.raises(UserError, match=r"env\.task"):
        RobocasaKitchenEnvConfig(task=task).task_names()


def test_misspelt_task_names_the_closest() -> None:
    with pytest.raises(UnknownNameError, match="'OpenDrawer'"):
        RobocasaKitchenEnvConfig(task="OpenDrawr").task_names()


@pytest.mark.parametrize(("field", "value"), [("fps", 30), ("max_parallel_tasks", 2)])
def test_settings_that_would_give_wrong_results_are_errors(field: str, value: int) -> None:
    with pytest.raises(UserError, match=field):
        RobocasaKitchenEnvConfig(**{field: value})  # type: ignore[arg-type]


def test_several_kitchens_in_one_process_are_refused() -> None:
    with pytest.raises(UserError, match="use_async_envs"):
        RobocasaKitchenEnvConfig().create_envs(2, use_async_envs=False)


SMALL = {"task": "OpenDrawer", "image_size": 32, "episode_length": 3}
NEW_ROLLOUT = {"lerobot_new_rollout": True}  # what LeRobot's rollout passes to reset


@contextmanager
def vector_env(n_envs: int) -> Iterator[gymnasium.vector.VectorEnv]:
    """The vector env of the one task, made and closed as LeRobot does."""
    envs = make_env(RobocasaKitchenEnvConfig(**SMALL), n_envs=n_envs, use_async_envs=True)  # type: ignore[arg-type]
    assert {task: list(of_task) for task, of_task in envs.items()} == {"OpenDrawer": [0]}
    try:
        yield envs["OpenDrawer"][0]
    finally:
        close_envs(envs)


def hold_still(n_envs: int) -> np.ndarray:
    """Zero motion, arm mode, open gripper, as (n_envs, 12) float32."""
    action = np.zeros((n_envs, contract.ACTION_SIZE), np.float32)
    for name in contract.BINARY_PARTS:
        action[:, contract.ACTION_SLICES[name]] = -1
    return action


@pytest.mark.render
def test_one_kitchen_as_lerobots_rollout_uses_it() -> None:
    with vector_env(1) as env:
        assert isinstance(env, gymnasium.vector.SyncVectorEnv)
        observation, info = env.reset(seed=[3], options=NEW_ROLLOUT)
        for camera in contract.CAMERAS:
            assert observation["pixels"][camera].shape == (1, 32, 32, 3)
            assert observation["pixels"][camera].dtype == np.uint8
        assert observation["agent_pos"].shape == (1, contract.STATE_SIZE)
        assert not info["is_success"].any()
        assert env.call("_max_episode_steps") == (3,)
        assert env.call("task") == ("OpenDrawer",)
        assert env.call("task_description")[0].strip()
        assert env.metadata["render_fps"] == contract.CONTROL_HZ
        for step in range(3):
            _, _, terminated, truncated, info = env.step(hold_still(1))
            assert "is_success" in info
            assert bool(truncated[0]) == (step == 2)
            assert not terminated[0]
        assert env.envs[0].render().dtype == np.uint8


@pytest.mark.render
def test_vector_env_opens_again_after_it_was_closed() -> None:
    """Evaluation during LeRobot's training closes the envs after each round and resets them for the next."""
    with vector_env(1) as env:
        first, _ = env.reset(seed=[3], options=NEW_ROLLOUT)
        env.close()
        again, _ = env.reset(seed=[3], options=NEW_ROLLOUT)
        assert np.array_equal(first["agent_pos"], again["agent_pos"])
        assert not env.closed


@pytest.mark.render
@pytest.mark.slow
def test_kitchens_in_processes_get_the_seeds_they_are_given() -> None:
    """Distinct seeds stay distinct (LeRobot's own robocasa env adds the index once more), and equal ones equal."""
    with vector_env(2) as env:
        first, _ = env.reset(seed=[5, 6], options=NEW_ROLLOUT)
        first = copy.deepcopy(first)
        second, _ = env.reset(seed=[6, 5], options=NEW_ROLLOUT)
        assert not np.array_equal(first["agent_pos"][0], first["agent_pos"][1])
        assert np.array_equal(first["agent_pos"], second["agent_pos"][::-1])
        same, _ = env.reset(seed=[6, 6], options=NEW_ROLLOUT)
        assert np.array_equal(same["agent_pos"][0], same["agent_pos"][1])
        _, _, _, _, info = env.step(hold_still(2))
        assert info["is_success"].shape == (2,)
        assert len(env.call("task_description")) == 2


def test_config_is_picklable() -> None:
    config = RobocasaKitchenEnvConfig(**SMALL)  # type: ignore[arg-type]
    assert pickle.loads(pickle.dumps(config)) == config
