"""The gripper: an integrated opening command for two position actuators."""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.envs.control import indices
from robocasa_lerobot.envs.scene import robot_names as names

SPEED = 0.2  # of the command's range -1..1, per policy step: ten steps from open to closed
_TOWARDS_CLOSED = np.array((-1.0, 1.0))


class Gripper:
    """Finger targets that move at a fixed speed in the direction of the command's sign."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._actuators = indices.actuators(model, names.FINGER_ACTUATORS)
        limits = model.actuator_ctrlrange[self._actuators]
        self._middle = limits.mean(axis=1)
        self._half_range = 0.5 * (limits[:, 1] - limits[:, 0])
        self._command = np.zeros(2)

    def reset(self, data: mujoco.MjData) -> None:
        """Start from the half-open command, whatever the fingers' position."""
        self._command = np.zeros(2)

    def set_goal(self, command: float) -> None:
        """Advance the targets by one policy step: positive closes, negative opens, zero holds."""
        self._command = np.clip(self._command + SPEED * np.sign(command) * _TOWARDS_CLOSED, -1.0, 1.0)

    def apply(self, data: mujoco.MjData) -> None:
        """Write the finger targets to `data.ctrl`."""
        data.ctrl[self._actuators] = self._middle + self._half_range * self._command
