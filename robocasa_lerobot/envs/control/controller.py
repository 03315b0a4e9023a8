"""The whole robot's controller: a 12-D action per policy step, actuator commands per physics step."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from robocasa_lerobot.contract import ACTION_SIZE, ACTION_SLICES_HDF5, ContractError
from robocasa_lerobot.envs.control import indices
from robocasa_lerobot.envs.control.base import BaseVelocity
from robocasa_lerobot.envs.control.gripper import Gripper
from robocasa_lerobot.envs.control.osc import OperationalSpaceArm
from robocasa_lerobot.envs.control.torso import Torso
from robocasa_lerobot.envs.scene import robot_names as names

_ARM = slice(ACTION_SLICES_HDF5["end_effector_position"].start, ACTION_SLICES_HDF5["end_effector_rotation"].stop)
_GRIPPER = ACTION_SLICES_HDF5["gripper_close"].start
_BASE = slice(ACTION_SLICES_HDF5["base_motion"].start, ACTION_SLICES_HDF5["base_motion"].start + 3)
_TORSO = ACTION_SLICES_HDF5["base_motion"].start + 3
_MODE = ACTION_SLICES_HDF5["control_mode"].start


class RobotController:
    """Arm, base, torso and gripper together; all four always execute what they are told.

    The control mode only chooses what an arm command is added to: its previous goal (> 0), so that the arm rides
    with a driving base, or the pose it has reached (<= 0). After a reset the goal is the pose of the reset.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._data = data
        self._arm_actuators = indices.actuators(model, names.ARM_ACTUATORS)
        self.arm = OperationalSpaceArm(model)
        self.base = BaseVelocity(model)
        self.torso = Torso(model)
        self.gripper = Gripper(model)

    def reset(self) -> None:
        """Forget all goals and hold the present pose; the data must be up to date (`mj_forward`)."""
        for part in (self.arm, self.base, self.torso, self.gripper):
            part.reset(self._data)

    def set_action(self, action: ArrayLike) -> None:
        """Take the action (12,) of a policy step, in HDF5 order; it is clipped to +-1.

        The data must be up to date in positions (after `mj_forward` or `mj_step1`).

        Raises:
            ContractError: the action has another shape or is not finite.
        """
        command = np.asarray(action, dtype=np.float64)
        if command.shape != (ACTION_SIZE,):
            raise ContractError(f"action: found shape {command.shape}, expected ({ACTION_SIZE},).")
        if not np.isfinite(command).all():
            raise ContractError(f"action: found {command}, expected finite numbers.")
        command = np.clip(command, -1.0, 1.0)
        self.arm.set_goal(self._data, command[_ARM], keep_goal=bool(command[_MODE] > 0.0))
        self.base.set_goal(self._data, command[_BASE])
        self.torso.set_goal(self._data, float(command[_TORSO]))
        self.gripper.set_goal(float(command[_GRIPPER]))

    def apply(self) -> None:
        """Write `data.ctrl` for the next physics step (between `mj_step1` and `mj_step2`)."""
        data = self._data
        data.ctrl[self._arm_actuators] = self.arm.torques(data)
        self.base.apply(data)
        self.torso.apply(data)
        self.gripper.apply(data)
