"""robosuite's `OSC_POSE` for a Panda that stands still: deltas of the hand's pose as actions, torques as commands.

O. Khatib, "A unified approach for motion and force control of robot manipulators" (1987), with position and orientation
decoupled, a null-space posture and gravity compensation; gains, scales and goal rules are those of robosuite 1.4.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from robocasa_lerobot.demos.generate.sources.transform import make_pose, target_of
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import ARM_KD, ARM_KP, NULLSPACE_KD, NULLSPACE_KP

SUBSTEPS = 25  # of 2 ms: 20 Hz
FINGER_SPEED = 0.01  # of the command's range -1..1, per physics step
_ARM = tuple(f"robot0_joint{number}" for number in range(1, 8))
_TORQUES = tuple(f"robot0_torq_j{number}" for number in range(1, 8))
_FINGERS = tuple(f"gripper0_gripper_finger_joint{number}" for number in (1, 2))
GRIP_SITE = "gripper0_grip_site"


class ArmController:
    """Carries out actions (7,): move of the grip site, its turn, fingers; each component between -1 and 1.

    Raises:
        KeyError: the model has no Panda under robosuite's names.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        joints = [model.joint(name).id for name in _ARM]
        self._qvel, self._qpos = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
        self._site = model.site(GRIP_SITE).id
        self._torques = np.array([model.actuator(name).id for name in _TORQUES])
        self._fingers = np.array([model.actuator(name).id for name in _FINGERS])
        self.reset()

    def reset(self) -> None:
        """Hold the present pose, with the fingers half open."""
        mujoco.mj_forward(self._model, self._data)
        self._posture = self._data.qpos[self._qpos].copy()
        self._goal = self.hand()
        self._grip: Array = np.zeros(2)

    def hand(self) -> Array:
        """Pose (4, 4) of the grip site."""
        data = self._data
        return make_pose(data.site_xpos[self._site], data.site_xmat[self._site].reshape(3, 3))

    def step(self, action: ArrayLike) -> None:
        """Control and advance the physics for a control step."""
        command = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        goal = target_of(command[:3], command[3:6], self.hand())
        if not np.any(command[3:6]):
            goal[:3, :3] = self._goal[:3, :3]  # without a turn the last goal's orientation stays
        self._goal = goal
        for _ in range(SUBSTEPS):
            mujoco.mj_step1(self._model, self._data)
            self._control(float(np.sign(command[6])))
            mujoco.mj_step2(self._model, self._data)

    def _control(self, closing: float) -> None:
        model, data, dofs = self._model, self._data, self._qvel
        moves, turns = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, moves, turns, self._site)
        moves, turns = moves[:, dofs], turns[:, dofs]
        whole = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, whole)
        mass = whole[np.ix_(dofs, dofs)]
        light = np.linalg.inv(mass)
        speed, hand = data.qvel[dofs], self.hand()
        off = _turn_between(hand[:3, :3], self._goal[:3, :3])
        force = ARM_KP * (self._goal[:3, 3] - hand[:3, 3]) - ARM_KD * (moves @ speed)
        torque = ARM_KP * off - ARM_KD * (turns @ speed)
        wrench = [_inertia(moves, light) @ force, _inertia(turns, light) @ torque]
        jacobian = np.vstack([moves, turns])
        out: Array = jacobian.T @ np.concatenate(wrench) + data.qfrc_bias[dofs]
        rest = np.eye(len(dofs)) - light @ jacobian.T @ _inertia(jacobian, light) @ jacobian
        out += rest.T @ (mass @ (NULLSPACE_KP * (self._posture - data.qpos[self._qpos]) - NULLSPACE_KD * speed))
        low, high = model.actuator_ctrlrange[self._torques].T
        data.ctrl[self._torques] = np.clip(out, low, high)
        self._grip += np.array([-1.0, 1.0]) * FINGER_SPEED * closing
        np.clip(self._grip, -1.0, 1.0, out=self._grip)
        low, high = model.actuator_ctrlrange[self._fingers].T
        data.ctrl[self._fingers] = 0.5 * (high + low) + 0.5 * (high - low) * self._grip


def _turn_between(now: Array, goal: Array) -> Array:
    """Half the sum of the cross products of two rotations' axes, (3,): about the turn between them, radians."""
    lead = goal @ now.T
    return 0.5 * np.array([lead[2, 1] - lead[1, 2], lead[0, 2] - lead[2, 0], lead[1, 0] - lead[0, 1]])


def _inertia(jacobian: Array, light: Array) -> Array:
    """Inertia that a jacobian's directions feel, from the inverse of the joints' mass matrix."""
    mobility = jacobian @ light @ jacobian.T
    try:
        return np.asarray(np.linalg.inv(mobility), dtype=np.float64)
    except np.linalg.LinAlgError:  # a stretched arm
        return np.asarray(np.linalg.pinv(mobility), dtype=np.float64)
