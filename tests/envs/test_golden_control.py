"""The controllers' numbers as RoboCasa 1.0.1 has them: gains, scales, targets and what the control mode means.

Each is read off `data.ctrl` or the arm's goal. The gains of the whole arm controller against explicit matrices:
`test_control.py`; how the robot then moves: `test_golden_response.py`.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, action, arena_spec

from robocasa_lerobot.envs.robots.panda_omron import names

TORSO_KP, TORSO_KD = 2000.0, 2.0 * np.sqrt(2000.0)  # 89.4
POSITION_STEP_M, ROTATION_STEP_RAD, TORSO_STEP_M = 0.05, 0.5, 0.05
BASE_SPEED = (1.0, 1.0, 1.5)  # m/s, m/s, rad/s
GRIPPER_STEP = 0.2  # of the command's half range


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


def _controls(arena: Arena, actuators: tuple[str, ...]) -> np.ndarray:
    return np.array([float(arena.data.actuator(name).ctrl[0]) for name in actuators])


def _command(arena: Arena, command: np.ndarray) -> None:
    arena.controller.set_action(command)
    arena.controller.apply()


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("index", range(3))
@pytest.mark.parametrize("size", [1.0, -0.4])
def test_base_targets(model: mujoco.MjModel, yaw: float, index: int, size: float) -> None:
    """Forward and left of the present heading, turned into the directions of the slides."""
    arena = Arena.settled(model, yaw=yaw, steps=0)
    base = [0.0, 0.0, 0.0]
    base[index] = size
    _command(arena, action(base=tuple(base)))
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ base
    np.testing.assert_allclose(_controls(arena, names.BASE_ACTUATORS), turned * BASE_SPEED, atol=1e-12)


@pytest.mark.parametrize("command", [0.0, 0.3, 1.0, -1.0])
def test_torso_force(model: mujoco.MjModel, command: float) -> None:
    """M (kp e - kd v) + bias, with the goal set from the present height whatever the previous goal was."""
    arena = Arena.settled(model)
    arena.run(action(torso=1.0), 4)
    data = arena.data
    dof = int(model.joint(names.TORSO_JOINT).dofadr[0])
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    _command(arena, action(torso=command))
    wanted = TORSO_KP * TORSO_STEP_M * command - TORSO_KD * data.qvel[dof]
    force = mass[dof, dof] * wanted + data.qfrc_bias[dof]
    assert abs(data.qvel[dof]) > 0.01
    assert _controls(arena, (names.TORSO_ACTUATOR,))[0] == pytest.approx(force, rel=1e-9)


def test_gripper_targets(model: mujoco.MjModel) -> None:
    """The command moves by 0.2 of its half range per policy step, by the sign alone, and stops at the ends."""
    arena = Arena.settled(model, steps=0)
    expected = 0.0
    for given in [0.0, 1.0, 0.01, 0.0, *[1.0] * 6, -0.3, *[-1.0] * 12, 0.0, 1.0]:
        _command(arena, action(gripper=given))
        expected = float(np.clip(expected + GRIPPER_STEP * np.sign(given), -1.0, 1.0))  # +1 is closed
        opening = 0.02 * (1.0 - expected)
        np.testing.assert_allclose(_controls(arena, names.FINGER_ACTUATORS), [opening, -opening], atol=1e-12)


def test_a_full_traverse_of_the_gripper_takes_ten_steps(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model, steps=0)
    for _ in range(10):
        _command(arena, action(gripper=1.0))
    for step in range(10):
        assert _controls(arena, names.FINGER_ACTUATORS)[0] == pytest.approx(0.004 * step, abs=1e-12)
        _command(arena, action(gripper=-1.0))
    assert _controls(arena, names.FINGER_ACTUATORS)[0] == pytest.approx(0.04)


def _reached(arena: Arena) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation of the grip site in the frame of the arm's mount."""
    base, grip = arena.data.site(names.ARM_CENTER_SITE), arena.data.site(names.GRIP_SITE)
    rotation = base.xmat.reshape(3, 3).T
    return rotation @ (grip.xpos - base.xpos), rotation @ grip.xmat.reshape(3, 3)


def _rotation(vector: tuple[float, float, float]) -> np.ndarray:
    angle = float(np.linalg.norm(vector))
    quat, out = np.empty(4), np.empty(9)
    mujoco.mju_axisAngle2Quat(quat, np.array(vector) / angle, angle)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


@pytest.mark.parametrize("mode", [-1.0, 0.0, 1e-9, 1.0])
def test_the_mode_chooses_what_an_arm_command_is_added_to(model: mujoco.MjModel, mode: float) -> None:
    """Above 0 the previous goal, else (0 included) the pose that is reached; rotations multiply from the left."""
    arena = Arena.settled(model, yaw=0.5)
    arena.run(action(1.0, position=(1.0, 0.6, -0.8), rotation=(0.3, 0.5, -0.4)), 3)
    reached, goal = _reached(arena), arena.controller.goal_in_base()
    assert np.linalg.norm(goal[0] - reached[0]) > 0.03
    step, turn = (0.2, -1.0, 0.6), (-0.8, 0.1, 0.3)
    arena.controller.set_action(action(mode, position=step, rotation=turn))
    position, rotation = arena.controller.goal_in_base()
    start = goal if mode > 0.0 else reached
    # The reached pose is taken relative to the base of the last physics step, which the arm's recoil has just moved.
    tolerance = 1e-12 if mode > 0.0 else 1e-5
    np.testing.assert_allclose(position, start[0] + POSITION_STEP_M * np.array(step), atol=tolerance)
    scaled = (ROTATION_STEP_RAD * turn[0], ROTATION_STEP_RAD * turn[1], ROTATION_STEP_RAD * turn[2])
    np.testing.assert_allclose(rotation, _rotation(scaled) @ start[1], atol=tolerance)


def test_base_torso_and_gripper_are_carried_out_in_either_mode(model: mujoco.MjModel) -> None:
    controls = []
    for mode in (-1.0, 1.0):
        arena = Arena.settled(model, yaw=0.4)
        _command(arena, action(mode, base=(0.5, -0.3, 0.8), torso=0.7, gripper=1.0))
        controls.append(_controls(arena, (*names.BASE_ACTUATORS, names.TORSO_ACTUATOR, *names.FINGER_ACTUATORS)))
    np.testing.assert_array_equal(*controls)
    assert np.abs(controls[0][:3]).min() > 0.05


def test_known_disagreement_the_goal_after_a_reset_is_already_in_the_base_frame(model: mujoco.MjModel) -> None:
    """RoboCasa keeps a world pose until the first command in mode -1; ours may start in mode +1 anywhere."""
    arena = Arena.settled(model, yaw=2.0, steps=0)
    arena.data.joint(names.BASE_JOINTS[0]).qpos[0] += 3.0
    mujoco.mj_forward(model, arena.data)
    before = _reached(arena)
    arena.run(action(1.0), 10)
    np.testing.assert_allclose(_reached(arena)[0], before[0], atol=1e-4)
