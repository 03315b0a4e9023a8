"""RoboCasa's own Gymnasium interface: its names, what they hold, its flags, and its ids."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robocasa_gym import RoboCasaGym, register_robocasa_ids
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.errors import UserError

TASK, SEED = "CloseDrawer", 3
# As robocasa 1.0.1 has them, with their sizes.
STATE = {
    "state.gripper_qpos": 2,
    "state.base_position": 3,
    "state.base_rotation": 4,
    "state.end_effector_position_relative": 3,
    "state.end_effector_rotation_relative": 4,
}
ACTION = {
    "action.end_effector_position": 3,
    "action.end_effector_rotation": 3,
    "action.gripper_close": 1,
    "action.base_motion": 4,
    "action.control_mode": 1,
}
VIDEO = ["video.robot0_agentview_left", "video.robot0_agentview_right", "video.robot0_eye_in_hand"]
INSTRUCTION = "annotation.human.task_description"


@pytest.fixture
def ids() -> Iterator[None]:
    before = dict(gymnasium.registry)
    yield
    gymnasium.registry.clear()
    gymnasium.registry.update(before)


def whole(action: dict[str, Any]) -> np.ndarray[Any, Any]:
    """An action in stored order, from parts in any order."""
    return np.concatenate([action[f"action.{part.name}"] for part in contract.ACTION_PARTS])


def test_names_and_sizes_are_robocasas() -> None:
    env = RoboCasaGym(TASK, camera_widths=32, camera_heights=32)
    observed, acted = env.observation_space, env.action_space
    assert isinstance(observed, gymnasium.spaces.Dict)
    assert isinstance(acted, gymnasium.spaces.Dict)
    assert set(observed) == {*VIDEO, *STATE, INSTRUCTION}
    assert {key: observed[key].shape for key in STATE} == {key: (size,) for key, size in STATE.items()}
    assert {observed[key].dtype for key in STATE} == {np.dtype(np.float32)}
    assert {key: space.shape for key, space in acted.items()} == {key: (size,) for key, size in ACTION.items()}
    assert {(space.low.min(), space.high.max()) for space in acted.values()} == {(-1.0, 1.0)}  # type: ignore[attr-defined]


@pytest.mark.render
def test_it_is_the_same_kitchen() -> None:
    ours = KitchenEnv(TASK, image_size=32, terminate_on_success=False)
    theirs = RoboCasaGym(TASK, seed=SEED, camera_widths=32, camera_heights=32)
    expected, _ = ours.reset(seed=SEED)
    found, info = theirs.reset()
    theirs.action_space.seed(0)
    for _ in range(4):
        assert theirs.observation_space.contains(found)
        for camera, picture in expected["pixels"].items():
            np.testing.assert_array_equal(found[f"video.{camera}"], picture)
        state = np.concatenate([found[f"state.{part.name}"] for part in contract.STATE_PARTS])
        np.testing.assert_array_equal(state, expected["agent_pos"].astype(np.float32))
        assert found[INSTRUCTION] == info["instruction"] != ""
        action = theirs.action_space.sample()
        expected, reward, *_ = ours.step(whole(action))
        found, *rest, info = theirs.step(action)
        assert rest == [reward, False, False]
    second = theirs.reset()[1]["seed"]
    assert second == ours.reset()[1]["seed"] != SEED  # the seed is of the first episode alone
    ours.close()
    theirs.close()


def test_no_episode_ends_by_itself() -> None:
    env = RoboCasaGym(TASK, enable_render=False, horizon=2)
    found, _ = env.reset(seed=SEED)
    assert all(not found[key].any() and found[key].shape == (256, 256, 3) for key in VIDEO)
    assert env.observation_space.contains(found)
    still = {key: np.zeros(size, np.float32) for key, size in ACTION.items()}
    assert [env.step(still)[2:4] for _ in range(4)] == [(False, False)] * 4
    assert env.unwrapped.steps == 4 > env.unwrapped.horizon  # type: ignore[attr-defined]


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match=r"square here: found camera_widths 64 and camera_heights 48"):
        RoboCasaGym(TASK, camera_widths=64, camera_heights=48)
    env = RoboCasaGym(TASK, enable_render=False)
    env.reset(seed=SEED)
    action = {key: np.zeros(size, np.float32) for key, size in ACTION.items()}
    with pytest.raises(contract.ContractError, match="gripper_close"):
        env.step({key: value for key, value in action.items() if key != "action.gripper_close"})
    with pytest.raises(contract.ContractError, match="torso"):
        env.step({**action, "action.torso": [0.0]})


def test_its_ids_make_ours_for_all_tasks(ids: None) -> None:
    register_robocasa_ids()
    register_robocasa_ids()
    assert {f"robocasa/{name}" for name in task_facts()} <= set(gymnasium.registry)
    env = gymnasium.make(f"robocasa/{TASK}", split="pretrain", seed=SEED, enable_render=False)
    assert env.reset()[1]["seed"] == SEED
    kitchen = env.unwrapped
    assert isinstance(kitchen, KitchenEnv)
    assert (kitchen.split, kitchen.horizon) == ("pretrain", get_task(TASK).horizon)


def test_robocasas_own_ids_are_left_to_it(ids: None) -> None:
    gymnasium.register(f"robocasa/{TASK}", entry_point="robocasa.wrappers.gym_wrapper:RoboCasaGymEnv")
    with pytest.raises(UserError, match=rf"robocasa/{TASK} is robocasa.wrappers.*Import either"):
        register_robocasa_ids()
    assert "robocasa/OpenDrawer" not in gymnasium.registry


def test_every_instruction_fits_its_space() -> None:
    space = RoboCasaGym(TASK, enable_render=False).observation_space[INSTRUCTION]  # type: ignore[index]
    unfit = [(name, words) for name in task_names() for words in wordings(name) if not space.contains(words)]
    assert unfit == []


def wordings(name: str) -> list[str]:
    """All that a task may say, before names of objects are put in."""
    task = get_task(name)
    return [task.instruction, *task.paraphrases]
