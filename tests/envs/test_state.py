"""States of an episode: exact round trips, in the same env and in others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from demonstration_steps import demonstrated_commands
from numpy.typing import NDArray
from task_selection import demonstrated, every_task

import robocasa_lerobot.envs  # noqa: F401  (makes the tasks known to Gymnasium)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.state import KitchenState
from robocasa_lerobot.errors import UserError


def make(task: str, **kwargs: Any) -> KitchenEnv:
    return KitchenEnv(task, cameras=(), **kwargs)  # states alone; pictures have tests of their own


def actions(count: int, seed: int) -> list[NDArray[np.float32]]:
    """A wandering command, which moves more than white noise does."""
    rng = np.random.default_rng(seed)
    direction = rng.uniform(-1, 1, 12)
    return [np.clip(direction + 0.3 * rng.normal(size=12), -1, 1).astype(np.float32) for _ in range(count)]


def trajectory(env: KitchenEnv, commands: list[NDArray[np.float32]]) -> list[NDArray[np.float64]]:
    rows = []
    for command in commands:
        observation, *_ = env.step(command)
        rows.append(np.concatenate((env.data.qpos, env.data.qvel, observation["agent_pos"], [env.data.time])))
    return rows


def assert_same(one: list[NDArray[np.float64]], other: list[NDArray[np.float64]]) -> None:
    assert len(one) == len(other) > 0
    for step, (a, b) in enumerate(zip(one, other, strict=True)):
        assert np.array_equal(a, b), f"step {step}: differs by {np.abs(a - b).max()}"


@pytest.mark.parametrize("task", every_task())
def test_an_episode_continues_from_a_state_bit_for_bit(task: str, tmp_path: Path) -> None:
    env = make(task)
    env.reset(seed=3)
    trajectory(env, actions(25, 0))
    state = env.get_state()
    expected = trajectory(env, actions(25, 1))
    _, info = env.set_state(state)
    assert info["seed"] == 3
    assert_same(trajectory(env, actions(25, 1)), expected)
    np.savez(tmp_path / "state.npz", **state.to_dict())
    with np.load(tmp_path / "state.npz") as file:
        loaded = KitchenState.from_dict(dict(file))
    other = make(task)
    other.set_state(loaded)
    assert_same(trajectory(other, actions(25, 1)), expected)
    assert np.array_equal(other.get_state().physics, env.get_state().physics)


@pytest.mark.costly
@pytest.mark.parametrize("task", demonstrated())
def test_a_demonstration_continues_from_anywhere(task: str) -> None:
    """In grasps, with doors in motion, while things fall asleep and wake: the rest replays to the same bits."""
    env = make(task)
    env.reset(seed=1)
    commands, states, awake = [], [], set()
    for command in demonstrated_commands(env):
        states.append(env.get_state())
        awake.add(int(env.data.ntree_awake))
        commands.append(command)
    assert len(awake) > 1, "nothing but the robot ever moved"
    end = env.get_state()
    for start in range(0, len(states), 17):
        env.set_state(states[start])
        for command in commands[start:]:
            env.step(command)
        reached = env.get_state()
        for part in ("physics", "asleep", "controller"):
            assert np.array_equal(getattr(reached, part), getattr(end, part)), f"{part}, from step {start}"


@pytest.mark.slow
@pytest.mark.parametrize("task", demonstrated())
def test_random_motion_continues_from_any_state(task: str) -> None:
    env = make(task)
    for seed in range(40):
        env.reset(seed=seed)
        trajectory(env, actions(20 + seed, seed))
        state = env.get_state()
        commands = actions(80, 100 + seed)
        expected = trajectory(env, commands)
        env.set_state(state)
        assert_same(trajectory(env, commands), expected)


@pytest.mark.parametrize("task", every_task())
def test_a_reset_with_the_running_seed_is_the_same_scene_again(task: str) -> None:
    env = make(task)
    first, first_info = env.reset(seed=5)
    model = env.model
    expected = trajectory(env, actions(20, 2))
    again, again_info = env.reset(seed=5)
    assert env.model is model
    assert np.array_equal(first["agent_pos"], again["agent_pos"])
    assert first_info == again_info
    assert_same(trajectory(env, actions(20, 2)), expected)
    fresh = make(task)
    fresh.reset(seed=5)
    assert_same(trajectory(fresh, actions(20, 2)), expected)
    env.reset(seed=6)
    assert env.model is not model


def test_what_is_no_state_is_refused() -> None:
    env = make("OpenDrawer")
    env.reset(seed=0)
    for other in (None, env.get_state().to_dict()):
        with pytest.raises(UserError, match=r"expected what `get_state` gave; `KitchenState\.from_dict`"):
            env.set_state(other)  # type: ignore[arg-type]


def test_a_state_of_something_else_is_refused() -> None:
    env = make("OpenDrawer")
    env.reset(seed=0)
    state = env.get_state()
    with pytest.raises(UserError, match=r"OpenDrawer.*CloseDrawer"):
        make("CloseDrawer").set_state(state)
    values = state.to_dict()
    with pytest.raises(UserError, match="version of the kitchens"):
        env.set_state(KitchenState.from_dict({**values, "physics": state.physics[:-1]}))
    with pytest.raises(UserError, match="MuJoCo version"):
        env.set_state(KitchenState.from_dict({**values, "mujoco_version": "3.0.0"}))
    del values["asleep"]
    with pytest.raises(UserError, match="asleep missing"):
        KitchenState.from_dict(values)


def test_a_state_of_another_kitchen_is_refused() -> None:
    """The same task, split and seed in other layouts or styles are another scene."""
    env = KitchenEnv("OpenDrawer", cameras=(), layouts=[11], styles=[11])
    env.reset(seed=0)
    state = env.get_state()
    for layout, style, words in ((12, 11, "layout 11"), (11, 12, "style 11")):
        other = KitchenEnv("OpenDrawer", cameras=(), layouts=[layout], styles=[style])
        for _ in range(2):  # the scene is built for it, then it is the running one
            with pytest.raises(UserError, match=rf"{words}.*gives \w+ 12.*`layouts` and `styles`"):
                other.set_state(state)
    values = state.to_dict()
    del values["layout_id"], values["style_id"]  # as states were stored before
    again = KitchenEnv("OpenDrawer", cameras=(), layouts=[11], styles=[11])
    again.set_state(KitchenState.from_dict(KitchenState.from_dict(values).to_dict()))
    assert np.array_equal(again.get_state().physics, state.physics)


def test_a_state_that_is_refused_leaves_the_running_episode_as_it_was() -> None:
    env = make("OpenDrawer", layouts=[11], styles=[11])
    env.reset(seed=3)
    expected = trajectory(env, actions(10, 0))
    env.reset(seed=3)
    halves = actions(10, 0)
    first = trajectory(env, halves[:5])
    elsewhere = make("OpenDrawer", layouts=[12], styles=[12])
    elsewhere.reset(seed=4)
    with pytest.raises(UserError, match="Make it with the same `layouts`"):
        env.set_state(elsewhere.get_state())
    assert (env.scene.seed, env.task_description) == (3, env.scene.instruction)
    assert_same([*first, *trajectory(env, halves[5:])], expected)


def test_kitchens_given_as_numbers_of_numpy_are_written_as_json() -> None:
    env = KitchenEnv("OpenDrawer", cameras=(), layouts=np.arange(11, 13), styles=np.int64(11))
    _, info = env.reset(seed=0)
    json.dumps(env.scene.ep_meta())
    assert type(info["scene"]["layout_id"]) is int
    assert (env.layouts, env.styles) == ([11, 12], [11])


def test_a_reset_that_is_interrupted_leaves_the_running_episode_as_it_was() -> None:
    env = make("OpenDrawer")
    env.reset(seed=3)
    expected = trajectory(env, actions(10, 0))
    env.reset(seed=3)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "initial_data", interrupt)
        with pytest.raises(KeyboardInterrupt):
            env.reset(seed=4)
    assert env.scene.seed == env.get_state().seed == 3
    assert_same(trajectory(env, actions(10, 0)), expected)
    assert env.reset(seed=4)[1]["seed"] == env.scene.seed == 4


def test_an_env_that_gymnasium_made_goes_on_from_a_state() -> None:
    first = make("CloseDrawer")
    first.reset(seed=3)
    state = first.get_state()
    expected = trajectory(first, actions(5, 0))
    made = gymnasium.make("robocasa_lerobot/CloseDrawer", cameras=())
    made.reset(seed=4)  # Gymnasium asks for one
    kitchen = made.unwrapped
    assert isinstance(kitchen, KitchenEnv)
    kitchen.set_state(state)
    for command in actions(5, 0):
        made.step(command)
    assert np.array_equal(kitchen.data.qpos, expected[-1][: kitchen.model.nq])
    made.close()
    first.close()


def test_there_is_no_state_before_the_first_reset() -> None:
    env = KitchenEnv("CloseDrawer", cameras=())
    with pytest.raises(UserError, match="call reset"):
        env.get_state()
    env.close()
