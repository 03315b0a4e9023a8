"""Deflections move the hand and the base as an operator means them, with the zeros that human data have."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from teleop_support import SEED, SPLIT, TASK

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import axis_angle, base_pose, grip_position, hand_rotation
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.teleop.driving.steering import NOTHING, Held, Steering, motion_axes
from robocasa_lerobot.teleop.messages import parse

STEPS = 6
BASE, MODE = contract.ACTION_SLICES["base_motion"], contract.ACTION_SLICES["control_mode"]
ARM = slice(contract.ACTION_SLICES["end_effector_position"].start, contract.ACTION_SLICES["end_effector_rotation"].stop)


@pytest.fixture(scope="module")
def kitchen() -> Iterator[KitchenEnv]:
    env = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    yield env
    env.close()


@pytest.fixture
def env(kitchen: KitchenEnv) -> KitchenEnv:
    kitchen.reset(seed=SEED)
    return kitchen


def held(**fields: Any) -> Held:
    return Held.of(parse(json.dumps({"type": "input", "frame": 0, **fields})))


def move(env: KitchenEnv, steering: Steering, what: Held) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far the hand goes and turns in the world, metres and radians."""
    position, rotation = grip_position(env.data), hand_rotation(env.data)
    for _ in range(STEPS):
        env.step(steering.action(env.model, env.data, env.robot.names, what).astype(np.float32))
    return grip_position(env.data) - position, axis_angle(hand_rotation(env.data) @ rotation.T)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(
    ("frame", "camera"),
    [
        ("base", ""),
        ("camera", "robot0_agentview_left"),
        ("camera", "robot0_agentview_right"),
        ("camera", "robot0_eye_in_hand"),
        ("gripper", ""),
    ],
)
def test_the_hand_goes_where_the_frame_of_motion_says(env: KitchenEnv, frame: str, camera: str, axis: int) -> None:
    data = env.data
    if frame == "base":
        _, yaw = base_pose(data)
        world = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    else:
        seen = data.cam(camera or "robot0_eye_in_hand").xmat.reshape(3, 3)  # x right, y up, z backwards
        world = np.column_stack([-seen[:, 2], -seen[:, 0], seen[:, 1]])
    arm = [0.0] * 6
    arm[axis] = 1.0
    went, _ = move(env, Steering(frame=frame, camera=camera, speed=1.0), held(arm=arm))
    assert np.linalg.norm(went) > 0.03
    assert went @ world[:, axis] / np.linalg.norm(went) > 0.9


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("frame", "camera"), [("base", ""), ("camera", "robot0_agentview_left"), ("gripper", "")])
def test_the_hand_turns_about_the_axes_of_the_frame(env: KitchenEnv, frame: str, camera: str, axis: int) -> None:
    axes = motion_axes(env.model, env.data, env.robot.names, frame, camera)
    assert np.allclose(axes.T @ axes, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    arm = [0.0] * 6
    arm[3 + axis] = 1.0
    room = env.data.site(env.robot.names.arm_center_site).xmat.reshape(3, 3)
    went, turned = move(env, Steering(frame=frame, camera=camera, speed=1.0), held(arm=arm))
    assert turned @ (room @ axes)[:, axis] / np.linalg.norm(turned) > 0.9
    assert np.linalg.norm(went) < 0.03


def test_modes_have_the_zeros_that_human_data_have(env: KitchenEnv) -> None:
    everything = held(arm=[1, 0.5, 0, 0, 1, 0], base=[1, -0.5, 0.2], torso=1)

    def action(mode: str, what: Held = everything) -> NDArray[np.float64]:
        return Steering(mode=mode, speed=1.0).action(env.model, env.data, env.robot.names, what)

    assert not action("arm")[BASE].any()
    assert action("arm")[ARM].any()
    assert action("arm")[MODE] == -1.0
    assert not action("base")[ARM].any()
    assert action("base")[BASE].all()
    assert action("base")[MODE] == 1.0
    assert action("both")[ARM].any()
    assert action("both")[BASE].all()
    assert action("both")[MODE] == 1.0
    assert action("both", held(arm=[1, 0, 0, 0, 0, 0]))[MODE] == -1.0
    for mode, value in (("arm", -1.0), ("base", 1.0), ("both", -1.0)):
        assert action(mode, NOTHING)[MODE] == value
        assert not action(mode, NOTHING)[BASE].any()
    assert np.abs(action("both")).max() <= 1.0


@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (0, -1), (1, 1), (2, -1)])
def test_small_deflections_move_the_base_slowly_and_not_at_all_is_still(env: KitchenEnv, axis: int, sign: int) -> None:
    def driven(deflection: float) -> float:
        env.reset(seed=SEED)
        start, yaw = base_pose(env.data)
        base = [0.0] * 3
        base[axis] = sign * deflection
        move(env, Steering(mode="base", speed=1.0), held(base=base))
        end, turned = base_pose(env.data)
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0]) if axis == 0 else np.array([-np.sin(yaw), np.cos(yaw), 0])
        return sign * float((end - start) @ ahead if axis < 2 else turned - yaw)

    still, slow, fast = driven(0.0), driven(0.1), driven(1.0)
    assert abs(still) < 1e-4
    assert 0.003 < slow < 0.5 * fast
    half = Steering(mode="base", speed=0.5).action(env.model, env.data, env.robot.names, held(base=[1, 0, 0]))
    assert half[BASE][0] == pytest.approx(0.25 + 0.75 * 0.5)
