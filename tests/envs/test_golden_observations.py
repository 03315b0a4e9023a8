"""What the robot observes, as RoboCasa 1.0.1 has it: initial values, frames, quaternion signs, order of the vectors.

The numbers stand here as data. Known disagreements are tests of their own: `test_known_...`, with the reason.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, action, arena_spec

from robocasa_lerobot import contract

TORSO = "mobilebase0_joint_torso_height"
ARM_HOME = (-0.01612974, -1.03446714, -0.02397936, -2.27550888, 0.03932365, 1.51639493, 0.69615947)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


INITIAL_OBSERVATIONS = {
    "robot0_base_pos": (0, 0, 0.70),
    "robot0_base_quat": (0, 0, 0, 1),
    "robot0_base_to_eef_pos": (0.2471, -0.00426, 0.59611),
    "robot0_base_to_eef_quat": (-0.98957, -0.0327, -0.13869, 0.02136),
    "robot0_base_to_eef_quat_site": (0.6766, 0.7229, 0.1132, 0.0830),
    "robot0_gripper_qpos": (0.020833, -0.020833),
    "robot0_joint_pos": ARM_HOME,
    "robot0_joint_pos_cos": np.cos(ARM_HOME),
    "robot0_joint_pos_sin": np.sin(ARM_HOME),
    "robot0_joint_vel": (0,) * 7,
    "robot0_gripper_qvel": (0, 0),
}


@pytest.mark.parametrize("key", INITIAL_OBSERVATIONS)
def test_noise_free_initial_observation(model: mujoco.MjModel, key: str) -> None:
    observations = Arena.settled(model, steps=0).observations()
    np.testing.assert_allclose(observations[key], INITIAL_OBSERVATIONS[key], atol=1e-3)


def test_known_disagreement_sign_of_the_world_quaternion(model: mujoco.MjModel) -> None:
    """The facts print eef_quat with w < 0, against their own rule; ours is the same rotation with w >= 0."""
    printed = np.array((0.98957, 0.0327, 0.13869, -0.02136))
    np.testing.assert_allclose(Arena.settled(model, steps=0).observations()["robot0_eef_quat"], -printed, atol=1e-3)


def _matrix(xyzw: np.ndarray) -> np.ndarray:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, xyzw[[3, 0, 1, 2]])
    return out.reshape(3, 3)


@pytest.mark.parametrize("yaw", [0.0, 1.1, -2.4, np.pi])
def test_frames_of_the_observations(model: mujoco.MjModel, yaw: float) -> None:
    arena = Arena.settled(model, yaw=yaw, steps=2)
    arena.run(action(1.0, position=(0.5, -0.6, 0.4), rotation=(0.4, 0.3, -0.5), torso=0.6), 6)
    seen, data = arena.observations(), arena.data
    base, grip = data.site("mobilebase0_center"), data.site("gripper0_right_grip_site")
    base_mat, grip_mat = base.xmat.reshape(3, 3), grip.xmat.reshape(3, 3)
    hand_mat = data.body("robot0_right_hand").xmat.reshape(3, 3)
    np.testing.assert_allclose(seen["robot0_base_pos"], base.xpos)
    assert seen["robot0_base_pos"][2] == pytest.approx(0.70 + arena.joint(TORSO), abs=1e-9)
    np.testing.assert_allclose(seen["robot0_eef_pos"], grip.xpos)
    np.testing.assert_allclose(seen["robot0_base_to_eef_pos"], base_mat.T @ (grip.xpos - base.xpos), atol=1e-12)
    expected = {
        "robot0_base_quat": base_mat,
        "robot0_eef_quat": hand_mat,
        "robot0_eef_quat_site": grip_mat,
        "robot0_base_to_eef_quat": base_mat.T @ hand_mat,
        "robot0_base_to_eef_quat_site": base_mat.T @ grip_mat,
    }
    for key, matrix in expected.items():
        np.testing.assert_allclose(_matrix(seen[key]), matrix, atol=1e-9, err_msg=key)
        assert seen[key][3] >= 0.0
    # The site is a quarter turn to the right about the hand's z axis.
    np.testing.assert_allclose(hand_mat.T @ grip_mat, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-5)
    assert seen["robot0_gripper_qpos"][0] > 0.0 > seen["robot0_gripper_qpos"][1]


def test_the_quaternion_flips_where_its_w_would_pass_zero(model: mujoco.MjModel) -> None:
    """With the gripper down w is near zero: a small rotation there changes the sign of the whole quaternion."""
    arena = Arena.settled(model)
    before = arena.observations()["robot0_base_to_eef_quat"]
    for rotation in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0, 0), (-1.0, 0, 0)):
        turned = Arena.settled(model)
        flipped = False
        for _ in range(6):
            turned.run(action(1.0, rotation=rotation))
            after = turned.observations()["robot0_base_to_eef_quat"]
            assert after[3] >= 0.0
            flipped |= bool(after @ before < 0.0)
        if flipped:
            return
    raise AssertionError("no rotation passed through w = 0")


STATE = {
    "base_position": (slice(0, 3), "robot0_base_pos"),
    "base_rotation": (slice(3, 7), "robot0_base_quat"),
    "end_effector_position_relative": (slice(7, 10), "robot0_base_to_eef_pos"),
    "end_effector_rotation_relative": (slice(10, 14), "robot0_base_to_eef_quat"),
    "gripper_qpos": (slice(14, 16), "robot0_gripper_qpos"),
}
# Components of the 12-D action: stored (LeRobot) place, HDF5 place.
ACTION = {
    "base_motion": (slice(0, 4), slice(7, 11)),
    "control_mode": (slice(4, 5), slice(11, 12)),
    "end_effector_position": (slice(5, 8), slice(0, 3)),
    "end_effector_rotation": (slice(8, 11), slice(3, 6)),
    "gripper_close": (slice(11, 12), slice(6, 7)),
}


def test_order_of_state_and_action(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model, steps=0)
    state, observations = arena.state(), arena.observations()
    assert state.shape == (16,)
    for where, key in STATE.values():
        np.testing.assert_array_equal(state[where], observations[key])
    assert set(contract.STATE_SLICES.items()) == {(name, where) for name, (where, _) in STATE.items()}
    values = np.arange(12.0)
    for name, (stored, hdf5) in ACTION.items():
        assert contract.ACTION_SLICES[name] == stored
        np.testing.assert_array_equal(contract.stored_to_hdf5(values)[hdf5], values[stored])


@pytest.mark.parametrize(("value", "expected"), [(-1, -1), (0, -1), (0.49, -1), (0.5, 1), (1, 1)])
def test_binary_parts_switch_at_a_half(value: float, expected: float) -> None:
    stored = np.full(12, 0.25)
    stored[[4, 11]] = value
    out = contract.binarize(stored)
    np.testing.assert_array_equal(out[[4, 11]], expected)
    np.testing.assert_array_equal(np.delete(out, [4, 11]), 0.25)
