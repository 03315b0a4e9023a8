"""Operational-space pose control of the arm: goals in the base frame, torques in the joints.

After O. Khatib, "A unified approach for motion and force control of robot manipulators" (1987), with position and
orientation decoupled, a null-space posture and gravity compensation. Gains and goal rules are those of robosuite's
OSC_POSE as RoboCasa 1.0.1 configures it for the PandaOmron.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.control import indices
from robocasa_lerobot.envs.scene import robot_names as names

KP = 150.0
KD = 2.0 * np.sqrt(KP)  # critical damping
NULLSPACE_KP = 10.0
NULLSPACE_KD = 2.0 * np.sqrt(NULLSPACE_KP)
POSITION_SCALE_M = 0.05  # goal displacement at a full command
ROTATION_SCALE_RAD = 0.5

_SITE = mujoco.mjtObj.mjOBJ_SITE


class OperationalSpaceArm:
    """Torque control of the seven arm joints towards a pose of the grip site, held in the arm's base frame.

    The base frame is the site at the arm's mount: it moves with base yaw and torso, and the goal with it.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._grip = model.site(names.GRIP_SITE).id
        self._base = model.site(names.ARM_CENTER_SITE).id
        self._qpos = indices.joint_positions(model, names.ARM_JOINTS)
        self._qvel = indices.joint_velocities(model, names.ARM_JOINTS)
        self._mass = indices.mass_matrix_addresses(model, self._qvel)
        self._jacobian = np.zeros((6, model.nv))
        self._velocity = np.zeros((2, 6))  # of grip and base site; MuJoCo's order: angular, linear
        self._wanted = np.zeros((2, 6, 1))  # accelerations of the grip site: of the task, and due to the posture
        self._inverse_inertia = np.zeros((2, 6, 6))  # decoupled, and whole
        self._base_pos = np.zeros(3)
        self._base_mat = np.eye(3)
        self._goal_pos: NDArray[np.float64] = np.zeros(3)
        self._goal_mat: NDArray[np.float64] = np.eye(3)
        self._posture: NDArray[np.float64] = np.zeros(7)

    def reset(self, data: mujoco.MjData) -> None:
        """Take the present pose as goal and the present joint angles as null-space posture."""
        self._posture = data.qpos[self._qpos]
        self._remember_base(data)
        self._goal_pos, self._goal_mat = self._pose_in_base(data)

    def set_goal(self, data: mujoco.MjData, command: NDArray[np.float64], keep_goal: bool) -> None:
        """Move the goal by `command` (6,): translation and axis-angle rotation in the base frame, each within +-1.

        With `keep_goal` the motion is added to the previous goal (RoboCasa's "desired"), otherwise to the pose that
        the arm has reached ("achieved"), which forgets what was not followed. As in robosuite, the reached pose is
        taken relative to the base of the last physics step, which a moving base or torso has just left: the goal
        then trails by up to 2 mm.
        """
        if not keep_goal:
            self._goal_pos, self._goal_mat = self._pose_in_base(data)
        self._goal_pos = self._goal_pos + POSITION_SCALE_M * command[:3]
        self._goal_mat = _rotation_matrix(ROTATION_SCALE_RAD * command[3:]) @ self._goal_mat

    def goal_in_base(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Goal position (3,) metres and rotation matrix (3, 3) of the grip site in the arm's base frame."""
        return self._goal_pos.copy(), self._goal_mat.copy()

    def torques(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Joint torques (7,) in Nm for the present state."""
        model, jacobian, velocity = self._model, self._jacobian, self._velocity
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._grip)
        mujoco.mj_objectVelocity(model, data, _SITE, self._grip, velocity[0], 0)
        mujoco.mj_objectVelocity(model, data, _SITE, self._base, velocity[1], 0)
        arm_jacobian = jacobian.take(self._qvel, axis=1)
        mass = data.M[self._mass]
        positions, matrices = data.site_xpos, data.site_xmat
        self._remember_base(data)
        base_mat = self._base_mat

        # Accelerations wanted at the grip site; the damping acts on the velocity relative to the base site's.
        wanted = self._wanted[0]
        wanted[:3, 0] = base_mat @ self._goal_pos + (self._base_pos - positions[self._grip])
        wanted[3:, 0] = _rotation_error(base_mat @ self._goal_mat, matrices[self._grip].reshape(3, 3))
        wanted *= KP
        damping = KD * (velocity[1] - velocity[0])
        wanted[:3, 0] += damping[3:]
        wanted[3:, 0] += damping[:3]

        # Posture accelerations a: their torques M a, less the part that would move the grip site, are
        # N^T M a = M a - J^T L J a, where L is the operational-space inertia.
        posture = NULLSPACE_KP * (self._posture - data.qpos[self._qpos]) - NULLSPACE_KD * data.qvel[self._qvel]
        self._wanted[1, :, 0] = arm_jacobian @ posture

        # L^-1 = J M^-1 J^T; the task's force uses its position and orientation blocks alone (decoupled). Both
        # systems are solved in one call.
        inverse = self._inverse_inertia
        inverse[1] = arm_jacobian @ np.linalg.solve(mass, arm_jacobian.T)
        inverse[0, :3, :3] = inverse[1, :3, :3]
        inverse[0, 3:, 3:] = inverse[1, 3:, 3:]
        try:
            forces = np.linalg.solve(inverse, self._wanted)
        except np.linalg.LinAlgError:  # a stretched arm to the last digit: the least-squares answer
            forces = np.linalg.pinv(inverse) @ self._wanted
        wrench = forces[0, :, 0] - forces[1, :, 0]
        return wrench @ arm_jacobian + mass @ posture + data.qfrc_bias[self._qvel]

    def _remember_base(self, data: mujoco.MjData) -> None:
        self._base_pos[:] = data.site_xpos[self._base]
        self._base_mat[:] = data.site_xmat[self._base].reshape(3, 3)

    def _pose_in_base(self, data: mujoco.MjData) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        grip_mat = data.site_xmat[self._grip].reshape(3, 3)
        return self._base_mat.T @ (data.site_xpos[self._grip] - self._base_pos), self._base_mat.T @ grip_mat


def _rotation_error(goal: NDArray[np.float64], present: NDArray[np.float64]) -> tuple[float, float, float]:
    """Half the sum of the cross products of the present axes with the wanted ones (sine of the angle, times axis).

    The sum of cross products of columns is the axial vector of G P^T, which needs one product instead of three.
    """
    (_, g01, g02), (g10, _, g12), (g20, g21, _) = (goal @ present.T).tolist()
    return 0.5 * (g21 - g12), 0.5 * (g02 - g20), 0.5 * (g10 - g01)


def _rotation_matrix(axis_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) of an axis-angle vector (3,) in radians."""
    angle = float(np.linalg.norm(axis_angle))
    if angle == 0.0:
        return np.eye(3)
    quat, matrix = np.empty(4), np.empty(9)
    mujoco.mju_axisAngle2Quat(quat, axis_angle / angle, angle)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)
