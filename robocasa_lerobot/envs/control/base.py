"""Velocity control of the mobile base: commands in its own heading, targets for its slides and its hinge."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.control import indices
from robocasa_lerobot.envs.scene import robot_names as names

MAX_YAW_RATE = 1.5  # rad/s at a full command; 1 m/s for the two slides


class BaseVelocity:
    """Targets of the three base velocity actuators.

    Friction of 250 N (Nm) in the joints against servos of 1000 N s/m (1500 Nm s/rad) leaves the base slower than
    its command by 0.25 m/s (0.167 rad/s), and still below that: the dead zone is part of RoboCasa's data.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._yaw = int(indices.joint_positions(model, names.BASE_JOINTS[2:])[0])
        self._actuators = indices.actuators(model, names.BASE_ACTUATORS)
        self._target = np.zeros(3)

    def reset(self, data: mujoco.MjData) -> None:
        """Stand still."""
        self._target = np.zeros(3)

    def set_goal(self, data: mujoco.MjData, command: NDArray[np.float64]) -> None:
        """Set targets from `command` (3,): forward, left and yaw within +-1, in the present heading."""
        yaw = data.qpos[self._yaw]
        cos, sin = np.cos(yaw), np.sin(yaw)
        forward, left, turn = command
        # The slides lie below the hinge: their axes keep the direction of zero yaw.
        self._target = np.array((cos * forward - sin * left, sin * forward + cos * left, MAX_YAW_RATE * turn))

    def apply(self, data: mujoco.MjData) -> None:
        """Write the targets to `data.ctrl`; MuJoCo clamps each to its actuator's range."""
        data.ctrl[self._actuators] = self._target
