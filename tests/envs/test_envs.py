"""The kitchens as Gymnasium envs: every task, both presets, determinism, goals that can hold and fail."""

from __future__ import annotations

import warnings
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from task_selection import every_task

import robocasa_lerobot.envs  # noqa: F401  (makes the tasks known to Gymnasium)
from robocasa_lerobot import contract, gl
from robocasa_lerobot.contract import ContractError
from robocasa_lerobot.envs.checks.tasks import check_task
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.kitchens.splits import scene_ids
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.tasks.registry import get_task, task_names, task_set, task_sets
from robocasa_lerobot.errors import UnknownNameError, UserError

pytestmark = pytest.mark.render


def make(task: str, **kwargs) -> KitchenEnv:
    env = gymnasium.make(f"robocasa_lerobot/{task}", split="target", render_preset="fast", image_size=32, **kwargs)
    return env.unwrapped


@pytest.mark.costly
@pytest.mark.parametrize("task", every_task())
def test_gymnasium_checker_finds_no_fault(task):
    env = make(task)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Our states are unbounded on purpose, and a checker that re-creates the env needs its spec.
        warnings.filterwarnings("ignore", message=".*(infinity|different render modes|spec).*")
        check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.costly
@pytest.mark.parametrize("task", every_task())
def test_task_checker_finds_no_fault(task):
    assert check_task(task, seeds=(0, 1)) == []


@pytest.mark.parametrize("task", every_task())
def test_observations_follow_the_contract(task):
    env = make(task)
    observation, info = env.reset(seed=1)
    assert list(observation["pixels"]) == list(contract.CAMERAS)
    for picture in observation["pixels"].values():
        assert picture.shape == (32, 32, 3)
        assert picture.dtype == np.uint8
        assert picture.std() > 5  # not blank
    state = contract.split_state(observation["agent_pos"])
    assert state["base_position"][2] == pytest.approx(0.70, abs=0.01)
    assert np.linalg.norm(state["base_rotation"]) == pytest.approx(1.0)
    assert info["success_terms"]
    assert not info["success"]
    assert (info["scene"]["layout_id"], info["scene"]["style_id"]) in scene_ids("target")
    assert env.task_description == info["instruction"]
    assert "{" not in info["instruction"]
    assert env.horizon == get_task(task).horizon == env._max_episode_steps
    env.close()


def test_same_seed_and_actions_give_bit_identical_observations():
    rng = np.random.default_rng(3)
    actions = rng.uniform(-1, 1, (12, 12)).astype(np.float32)
    runs = []
    for _ in range(2):
        env = make("OpenDrawer")
        observation, _ = env.reset(seed=11)
        seen = [observation] + [env.step(action)[0] for action in actions]
        runs.append(seen)
        env.close()
    for a, b in zip(*runs, strict=True):
        assert np.array_equal(a["agent_pos"], b["agent_pos"])
        for camera in contract.CAMERAS:
            assert np.array_equal(a["pixels"][camera], b["pixels"][camera])


def test_two_envs_in_one_process_keep_their_own_pictures():
    first, second = make("OpenDrawer"), make("CloseDrawer")
    alone, _ = first.reset(seed=0)
    other, _ = second.reset(seed=5)
    first.close()  # frees OpenGL objects; those of the second must stay
    for camera in contract.CAMERAS:
        again = second.render_camera(camera)
        assert np.array_equal(again, other["pixels"][camera])
        assert not np.array_equal(again, alone["pixels"][camera])
    second.close()


def test_different_seeds_give_different_scenes():
    env = make("PickPlaceCounterToSink")
    scenes = []
    for seed in range(4):
        env.reset(seed=seed)
        scenes.append((env.scene.robot_pose.x, tuple(p.item.model for p in env.scene.objects.values())))
    assert len(set(scenes)) == 4
    env.close()


@pytest.mark.costly
def test_render_preset_changes_pictures_but_not_physics():
    states, pictures = [], []
    for preset in ("fast", "quality"):
        env = KitchenEnv("OpenDrawer", render_preset=preset, image_size=32)
        observation, _ = env.reset(seed=2)
        for _ in range(3):
            observation, *_ = env.step(np.full(12, 0.3, dtype=np.float32))
        states.append(np.concatenate([env.data.qpos, env.data.qvel]))
        pictures.append(observation["pixels"][contract.CAMERAS[0]])
        env.close()
    assert np.array_equal(*states)
    assert not np.array_equal(*pictures)


def test_goal_terms_follow_the_drawer():
    """Writes states, which a test may: the goal must hold beyond its threshold and not before."""
    for task, low, high in (("OpenDrawer", 0.94, 0.96), ("CloseDrawer", 0.06, 0.04)):
        env = make(task)
        env.reset(seed=0)
        drawer = env.scene.fixture("drawer", Drawer)
        for openness, expected in ((low, False), (high, True)):
            drawer.set_openness(env.data, openness)
            info = env._info()
            assert info["success"] is expected
            assert set(info["success_terms"].values()) == {expected}
        env.close()


def test_success_needs_every_term():
    import mujoco

    env = make("PickPlaceCounterToSink")
    env.reset(seed=0)
    basin = env.scene.fixture("sink", Sink).basin
    env.data.joint("obj_joint0").qpos[:3] = basin.world(env.data)
    mujoco.mj_forward(env.model, env.data)
    assert env._info()["success_terms"] == {"obj_in_sink": True, "gripper_far_from_obj": True}
    from robocasa_lerobot.envs.robots.panda_omron.names import GRIP_SITE

    env.data.joint("obj_joint0").qpos[:3] = env.data.site(GRIP_SITE).xpos
    mujoco.mj_forward(env.model, env.data)
    info = env._info()
    assert info["success_terms"] == {"obj_in_sink": False, "gripper_far_from_obj": False}
    assert not info["success"]
    env.close()


def test_episode_ends_at_the_horizon_without_success():
    env = make("OpenDrawer", horizon=3)
    env.reset(seed=0)
    flags = [env.step(np.zeros(12, dtype=np.float32))[2:4] for _ in range(3)]
    assert flags == [(False, False), (False, False), (False, True)]
    env.close()


def test_asynchronous_vector_env_gives_the_same_as_a_single_env():
    single = make("OpenDrawer")
    expected = [single.reset(seed=seed)[0] for seed in (4, 5)]
    single.close()
    make_env = partial(KitchenEnv, "OpenDrawer", image_size=32)
    vector = gymnasium.vector.AsyncVectorEnv([make_env] * 2, context="spawn")
    observation, info = vector.reset(seed=[4, 5])
    for index in range(2):
        assert np.array_equal(observation["agent_pos"][index], expected[index]["agent_pos"])
        for camera in contract.CAMERAS:
            assert np.array_equal(observation["pixels"][camera][index], expected[index]["pixels"][camera])
    assert list(info["is_success"]) == [False, False]
    vector.close()


def test_a_fork_after_rendering_with_opengl_is_an_error_and_not_a_hang(monkeypatch):
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "opengl")
    single = make("OpenDrawer")
    single.reset(seed=0)
    single.close()
    vector = gymnasium.vector.AsyncVectorEnv([partial(KitchenEnv, "OpenDrawer", image_size=32)], context="fork")
    with pytest.raises(UserError, match="spawn"):
        vector.reset(seed=0)
    vector.close()


def test_a_fork_after_rendering_without_opengl_draws_the_same(monkeypatch):
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "cpu")
    env = KitchenEnv("OpenDrawer", image_size=32)
    pictures = env.reset(seed=0)[0]["pixels"]
    vector = gymnasium.vector.AsyncVectorEnv([partial(KitchenEnv, "OpenDrawer", image_size=32)], context="fork")
    forked = vector.reset(seed=[0])[0]["pixels"]
    assert all(np.array_equal(pictures[name], forked[name][0]) for name in pictures)
    vector.close()
    env.close()


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"task": "OpenDrawr"}, "OpenDrawer"),
        ({"task": "OpenDrawer", "split": "targt"}, "target"),
        ({"task": "OpenDrawer", "split": None}, "unknown split None. Known: pretrain, "),
        ({"task": "OpenDrawer", "render_preset": "fst"}, "fast"),
        ({"task": "OpenDrawer", "render_mode": "human"}, "rgb_array"),
    ],
)
def test_misspelt_arguments_name_the_closest_match(kwargs, words):
    with pytest.raises(UnknownNameError, match=words):
        KitchenEnv(**kwargs)


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        *(({"image_size": size}, "expected a whole number from 1 to 4096") for size in (0, 64.5, "64", (64, 48), True)),
        ({"image_size": 100_000}, "expected a whole number from 1 to 4096"),  # no picture would fit into memory
        *(({"horizon": steps}, "horizon: found .* expected a whole number of at least 1") for steps in (0, 1.5, "9")),
        *(({"layouts": ids}, "layouts: found .* expected whole numbers") for ids in ("12", "3", [], [1.5], ["1"])),
        ({"styles": ()}, "styles: found .* expected whole numbers"),
        ({"initial_noise": 0.1}, r"expected an InitialNoise\(...\)"),
    ],
)
def test_arguments_of_another_kind_say_what_is_expected(kwargs, words):
    """Instead of a kitchen of layouts 1 and 2 for the text "12", or a failure at the first reset."""
    with pytest.raises(UserError, match=words):
        KitchenEnv("OpenDrawer", **kwargs)


def test_other_mistakes_say_what_to_do():
    env = KitchenEnv("OpenDrawer", image_size=32)
    with pytest.raises(UserError, match="reset"):
        env.step(np.zeros(12, dtype=np.float32))
    env.reset(seed=0)
    with pytest.raises(ContractError, match="12"):
        env.step(np.zeros(11, dtype=np.float32))
    for part in contract.split_action(np.arange(12)).values():
        action = np.zeros(12, dtype=np.float32)
        action[part] = np.nan
        with pytest.raises(ContractError, match="finite"):
            env.step(action)
    with pytest.raises(UnknownNameError, match="robot0_agentview_left"):
        env.render_camera("robot0_agentview_lef")
    env.close()


@pytest.mark.parametrize("seed", [-1, 2**63, 1.0, "1"])
def test_what_is_no_seed_is_explained(seed):
    with pytest.raises(UserError, match="expected a whole number from 0"):
        KitchenEnv("OpenDrawer", cameras=()).reset(seed=seed)
    with pytest.raises(UserError, match="expected a whole number from 0"):
        build_scene(get_task("OpenDrawer"), "target", seed)


def test_a_seed_may_be_numpys():
    assert KitchenEnv("CloseDrawer", cameras=()).reset(seed=np.int64(3))[1]["seed"] == 3


def test_task_sets():
    assert "OpenDrawer" in task_set("atomic_seen")
    assert len(task_set("target50")) == 50
    assert len(task_set("diversity17")) == 17
    assert "CloseDrawer" not in task_set("atomic_seen")
    assert set(task_set("lifelong_phase1")) == {name for name in task_names() if get_task(name).facts.kind == "atomic"}
    assert "mimicgen60" in task_sets()
    with pytest.raises(UnknownNameError, match="atomic_seen"):
        task_set("atomic_sen")
