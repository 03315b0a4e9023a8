"""A mug whose handle is on the robot's side is turned before a level hand takes it."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.motion import UP, rotation_about
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.skills.common import stage_done
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ahead_of
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.mugs import handle_of
from robocasa_lerobot.demos.skills.pick_place.turning.handle_away import IN_THE_WAY, below_a_spout, turned_first
from robocasa_lerobot.demos.skills.pick_place.verbs import place_object
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


@pytest.fixture
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv("CoffeeSetupMug", split="target", cameras=(), terminate_on_success=False)
    made.reset(seed=240_116)
    yield made
    made.close()


def handle_ahead(env: KitchenEnv) -> float:
    """Of the handle's direction along the robot's heading."""
    handle = handle_of(graspable(env, "obj"))
    assert handle is not None
    return float(env.data.body("obj").xmat.reshape(3, 3) @ handle @ ahead_of(env))


def point_handle(env: KitchenEnv, angle_deg: float) -> None:
    """Turn the mug where it stands, so that its handle is at this angle to the left of the robot's heading."""
    handle = handle_of(graspable(env, "obj"))
    assert handle is not None
    wanted = rotation_about(UP, np.deg2rad(angle_deg)) @ ahead_of(env)
    yaw = np.arctan2(wanted[1], wanted[0]) - np.arctan2(handle[1], handle[0])
    env.data.joint("obj_joint0").qpos[3:] = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    mujoco.mj_forward(env.model, env.data)
    assert handle_ahead(env) == pytest.approx(np.cos(np.deg2rad(angle_deg)), abs=1e-6)


@pytest.mark.parametrize("angle_deg", [180.0, 120.0, -120.0])
def test_a_handle_in_the_way_is_turned_away(env: KitchenEnv, angle_deg: float) -> None:
    point_handle(env, angle_deg)
    before = env.data.body("obj").xpos.copy()
    first = turned_first(graspable(env, "obj"))
    assert first is not None
    for action in first(env):
        env.step(action.astype(np.float32))
    assert handle_ahead(env) > IN_THE_WAY
    assert env.data.body("obj").xmat[8] > 0.99  # it stands
    assert np.linalg.norm((env.data.body("obj").xpos - before)[:2]) < 0.05


@pytest.mark.parametrize("angle_deg", [0.0, 80.0, -80.0])
def test_a_handle_out_of_the_way_is_left_alone(env: KitchenEnv, angle_deg: float) -> None:
    point_handle(env, angle_deg)
    first = turned_first(graspable(env, "obj"))
    assert first is not None
    assert list(first(env)) == []


@pytest.mark.parametrize("angle_deg", [180.0, -100.0, 30.0])
def test_the_mug_comes_under_the_spout_however_its_handle_points(env: KitchenEnv, angle_deg: float) -> None:
    point_handle(env, angle_deg)
    stage = env.declaration.stages[0]
    for action in place_object(env, stage):
        env.step(action.astype(np.float32))
    assert stage_done(env, stage)


def test_what_has_no_handle_is_not_turned() -> None:
    env = KitchenEnv("RestockBowls", split="target", cameras=())
    env.reset(seed=0)
    obj = graspable(
        env, next(name for name, placed in env.scene.objects.items() if placed.item.category.name == "bowl")
    )
    assert handle_of(obj) is None
    assert turned_first(obj) is None
    assert below_a_spout(obj).first is None
    env.close()


def test_a_mug_that_is_held_wrong_for_the_spout_is_set_down_and_grasped_anew() -> None:
    """Out of a cabinet a hand brings it by its rim, from above: so it does not fit below the spout."""
    env = KitchenEnv("PrepareCoffee", split="target", cameras=(), terminate_on_success=False)
    recording = record_episode(env, 240_117)
    assert recording.success, recording.reason
    env.close()
