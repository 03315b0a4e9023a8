"""What the robot knows of itself: the contract's state vector and robosuite's named observations.

All readings come from `data` as it stands: positions and velocities must be evaluated (`mj_forward`, `mj_step1`, or a
control step). Quaternions are xyzw with w >= 0, positions metres, angles radians.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.contract import STATE_PART_HDF5_KEYS, join_state
from robocasa_lerobot.envs.control.indices import joint_positions, joint_velocities
from robocasa_lerobot.envs.scene import robot_names as names

Array = NDArray[np.float64]


def read_state(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The contract's state (16,) float64: base pose in the world, end-effector pose in the base, finger positions."""
    observations = read_observations(model, data)
    return join_state({part: observations[key] for part, key in STATE_PART_HDF5_KEYS.items()})


def read_observations(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array]:
    """Proprioception under robosuite's names.

    The end effector's position is that of the grip site and its orientation that of the hand body; the keys that end
    in `_site` have the grip site's orientation, a quarter turn about the hand's z away.
    """
    base, grip = data.site(names.BASE_CENTER_SITE), data.site(names.GRIP_SITE)
    base_mat, grip_mat = base.xmat.reshape(3, 3), grip.xmat.reshape(3, 3)
    hand_mat = data.body(names.HAND).xmat.reshape(3, 3)
    arm_qpos = data.qpos[joint_positions(model, names.ARM_JOINTS)]
    return {
        "robot0_joint_pos": arm_qpos,
        "robot0_joint_pos_cos": np.cos(arm_qpos),
        "robot0_joint_pos_sin": np.sin(arm_qpos),
        "robot0_joint_vel": data.qvel[joint_velocities(model, names.ARM_JOINTS)],
        "robot0_eef_pos": grip.xpos.copy(),
        "robot0_eef_quat": _quaternion(hand_mat),
        "robot0_eef_quat_site": _quaternion(grip_mat),
        "robot0_gripper_qpos": data.qpos[joint_positions(model, names.FINGER_JOINTS)],
        "robot0_gripper_qvel": data.qvel[joint_velocities(model, names.FINGER_JOINTS)],
        "robot0_base_pos": base.xpos.copy(),
        "robot0_base_quat": _quaternion(base_mat),
        "robot0_base_to_eef_pos": base_mat.T @ (grip.xpos - base.xpos),
        "robot0_base_to_eef_quat": _quaternion(base_mat.T @ hand_mat),
        "robot0_base_to_eef_quat_site": _quaternion(base_mat.T @ grip_mat),
    }


def _quaternion(matrix: Array) -> Array:
    """Quaternion xyzw with w >= 0 of a rotation matrix (3, 3)."""
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(matrix).ravel())
    if wxyz[0] < 0.0:
        wxyz = -wxyz
    return wxyz[[1, 2, 3, 0]]
