"""Where the arm is longest, and how what lies across behind a front is turned."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.motion import Array, base_pose, floor_axes
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.pick import best_grasp, is_held, pick
from robocasa_lerobot.demos.skills.pick_place.strategies import grasp_strategy
from robocasa_lerobot.demos.skills.pick_place.turning.across import (
    ACROSS_COS,
    OUT_OF_CABINET,
    lies_across,
    long_axis,
    turn_across,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_JOINTS
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

# Over the counter, the elbow past the stretched arm and at its limit.
PAST_STRETCHED = (-0.03, 0.8, -0.04, -0.07, 0.04, 0.79, 0.76)
TURNED_RAD, DEEPER_M = 0.05, 0.03


def carry_out(env: KitchenEnv, actions: Iterator[Array]) -> int:
    """Step through a skill's actions; how many they were."""
    count = 0
    for action in actions:
        env.step(action.astype(np.float32))
        count += 1
    return count


@pytest.fixture
def stretched() -> Iterator[KitchenEnv]:
    env = KitchenEnv("PickPlaceToasterToCounter", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=3)
    env.data.qpos[Arm(env.model, env.data, env.scene.robot).addresses] = PAST_STRETCHED
    mujoco.mj_forward(env.model, env.data)
    yield env
    env.close()


def test_the_arm_is_longest_where_its_elbow_is_said_to_be_stretched(stretched: KitchenEnv) -> None:
    data, arm = stretched.data, Arm(stretched.model, stretched.data, stretched.scene.robot)
    far = []
    angles = np.linspace(-1.0, -0.08, 47)
    for angle in angles:
        data.qpos[arm.addresses[3]] = angle
        mujoco.mj_kinematics(stretched.model, data)
        # The axes of joints 2 and 6: of the shoulder and of the wrist.
        far.append(np.linalg.norm(data.joint(ARM_JOINTS[1]).xanchor - data.joint(ARM_JOINTS[5]).xanchor))
    assert angles[int(np.argmax(far))] == pytest.approx(PANDA_OMRON.reach.stretched, abs=0.02)


def test_what_lies_across_in_a_microwave_is_turned_by_pushing_its_end() -> None:
    env = KitchenEnv("PickPlaceMicrowaveToCounter", split="pretrain", cameras=(), terminate_on_success=False)
    env.reset(seed=100_011)
    obj = graspable(env, "obj")
    _, yaw = base_pose(env.data)
    ahead = floor_axes(yaw)[0]
    before, deep = abs(float(long_axis(env, obj)[0] @ ahead)), float(env.data.body(obj.name).xpos @ ahead)
    assert lies_across(env, obj)
    assert before < ACROSS_COS
    assert carry_out(env, turn_across(env, obj))
    assert abs(float(long_axis(env, obj)[0] @ ahead)) > before + TURNED_RAD
    assert float(env.data.body(obj.name).xpos @ ahead) > deep + DEEPER_M
    env.close()


def test_a_low_object_deep_in_a_cabinet_is_grasped_without_meeting_the_shelf() -> None:
    env = KitchenEnv("PickPlaceCabinetToCounter", split="pretrain", cameras=(), terminate_on_success=False)
    env.reset(seed=100_508)
    obj = graspable(env, "obj")
    assert obj.item is not None
    assert obj.item.size[2] < 0.04
    # A path that touches nothing costs less than 1; with the tilts of any approach it was 2.2.
    assert best_grasp(env, obj, OUT_OF_CABINET).cost < 1.0
    env.close()


def test_what_lies_deep_across_a_shelf_is_brought_to_its_front_before_it_is_held() -> None:
    env = KitchenEnv("PrepareSandwichStation", split="pretrain", cameras=(), terminate_on_success=False)
    env.reset(seed=150_002)
    obj = graspable(env, "baguette")
    _, yaw = base_pose(env.data)
    ahead = floor_axes(yaw)[0]
    deep = float(env.data.body(obj.name).xpos @ ahead)
    assert lies_across(env, obj)
    strategy = grasp_strategy(env, obj, OUT_OF_CABINET)
    assert strategy.nearer is not None
    assert strategy.nearer(env) > DEEPER_M
    placed = deep
    for action in pick(env, obj, strategy):
        env.step(action.astype(np.float32))
        if action[-1] < 0.0 and not is_held(env, obj.name):
            placed = float(env.data.body(obj.name).xpos @ ahead)
    assert is_held(env, obj.name)
    assert placed < deep - DEEPER_M
    env.close()


def test_what_lies_on_the_rack_of_a_toaster_oven_is_held_by_the_first_grasp() -> None:
    # By the flattest hand, whose own best grasp is poor, the loaf was held at its crest and crept out.
    env = KitchenEnv("PickPlaceToasterOvenToCounter", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=180_002)
    obj = graspable(env, "obj")
    closed = False
    for action in pick(env, obj, grasp_strategy(env, obj, OUT_OF_CABINET)):
        env.step(action.astype(np.float32))
        assert not (closed and action[-1] < 0.0)
        closed = bool(action[-1] > 0.0)
    assert is_held(env, obj.name)
    env.close()


def test_what_is_long_is_so_along_its_sides_not_along_its_diagonal() -> None:
    env = KitchenEnv("PickPlaceToasterOvenToCounter", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=180_004)
    obj = graspable(env, "obj")
    assert obj.item is not None
    axis, long, wide = long_axis(env, obj)
    assert (2 * long, 2 * wide) == pytest.approx(obj.item.size[:2], abs=0.01)
    sides = env.data.body(obj.name).xmat.reshape(3, 3)
    assert abs(float(axis @ sides[:, 0])) > 0.99
    env.close()
