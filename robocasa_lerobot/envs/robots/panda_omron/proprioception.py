"""What the robot knows of itself: the contract's state vector and robosuite's named observations.

All readings come from `data` as it stands: positions and velocities must be evaluated (`mj_forward`, `mj_step1`, or a
control step). Quaternions are xyzw with w >= 0, positions metres, angles radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.contract import STATE_PART_HDF5_KEYS, join_state
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.control.indices import joint_positions, joint_velocities

Array = NDArray[np.float64]
_XYZW = np.array([1, 2, 3, 0])  # of wxyz


def read_state(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The contract's state (16,) float64: base pose in the world, end-effector pose in the base, finger positions."""
    readings = _state_observations(_indices(model), data)
    return join_state({part: readings[key] for part, key in STATE_PART_HDF5_KEYS.items()})


def read_observations(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array]:
    """Proprioception under robosuite's names.

    The end effector's position is that of the grip site and its orientation that of the hand body; the keys that end
    in `_site` have the grip site's orientation, a quarter turn about the hand's z away.
    """
    at = _indices(model)
    base_mat, grip_mat, hand_mat = at.matrices(data)
    arm_qpos = data.qpos[at.arm_qpos]
    return {
        "robot0_joint_pos": arm_qpos,
        "robot0_joint_pos_cos": np.cos(arm_qpos),
        "robot0_joint_pos_sin": np.sin(arm_qpos),
        "robot0_joint_vel": data.qvel[at.arm_qvel],
        "robot0_eef_pos": data.site_xpos[at.grip_site].copy(),
        "robot0_eef_quat": _quaternion(hand_mat),
        "robot0_eef_quat_site": _quaternion(grip_mat),
        "robot0_gripper_qvel": data.qvel[at.finger_qvel],
        "robot0_base_to_eef_quat_site": _quaternion(base_mat.T @ grip_mat),
        **_state_observations(at, data),
    }


@dataclass(frozen=True)
class _Indices:
    """Where the robot's readings lie in the arrays of one model's data."""

    arm_qpos: NDArray[np.intp]
    arm_qvel: NDArray[np.intp]
    finger_qpos: NDArray[np.intp]
    finger_qvel: NDArray[np.intp]
    base_site: int
    grip_site: int
    hand_body: int

    def matrices(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Rotation matrices (3, 3) in the world of base centre, grip site and hand body."""
        return (
            data.site_xmat[self.base_site].reshape(3, 3),
            data.site_xmat[self.grip_site].reshape(3, 3),
            data.xmat[self.hand_body].reshape(3, 3),
        )


_CACHE: WeakKeyDictionary[mujoco.MjModel, _Indices] = WeakKeyDictionary()  # finding names costs more than reading


def _indices(model: mujoco.MjModel) -> _Indices:
    found = _CACHE.get(model)
    if found is None:
        found = _CACHE[model] = _Indices(
            arm_qpos=joint_positions(model, names.ARM_JOINTS),
            arm_qvel=joint_velocities(model, names.ARM_JOINTS),
            finger_qpos=joint_positions(model, names.FINGER_JOINTS),
            finger_qvel=joint_velocities(model, names.FINGER_JOINTS),
            base_site=model.site(names.BASE_CENTER_SITE).id,
            grip_site=model.site(names.GRIP_SITE).id,
            hand_body=model.body(names.HAND).id,
        )
    return found


def _state_observations(at: _Indices, data: mujoco.MjData) -> dict[str, Array]:
    """The observations that make up the contract's state."""
    base_mat, _, hand_mat = at.matrices(data)
    base_pos = data.site_xpos[at.base_site]
    return {
        "robot0_base_pos": base_pos.copy(),
        "robot0_base_quat": _quaternion(base_mat),
        "robot0_base_to_eef_pos": base_mat.T @ (data.site_xpos[at.grip_site] - base_pos),
        "robot0_base_to_eef_quat": _quaternion(base_mat.T @ hand_mat),
        "robot0_gripper_qpos": data.qpos[at.finger_qpos],
    }


def _quaternion(matrix: Array) -> Array:
    """Quaternion xyzw with w >= 0 of a rotation matrix (3, 3)."""
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(matrix).ravel())
    if wxyz[0] < 0.0:
        wxyz = -wxyz
    return wxyz[_XYZW]
