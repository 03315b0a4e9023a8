"""Position control of the torso lift."""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.envs.control import indices
from robocasa_lerobot.envs.scene import robot_names as names

KP = 2000.0
KD = 2.0 * np.sqrt(KP)
SCALE_M = 0.05  # goal displacement at a full command


class Torso:
    """Torque control of the lift towards a height; friction of 1000 N holds it when idle."""

    def __init__(self, model: mujoco.MjModel) -> None:
        dofs = indices.joint_velocities(model, (names.TORSO_JOINT,))
        self._qpos = int(indices.joint_positions(model, (names.TORSO_JOINT,))[0])
        self._qvel = int(dofs[0])
        self._mass = int(indices.mass_matrix_addresses(model, dofs)[0, 0])
        self._actuator = int(indices.actuators(model, (names.TORSO_ACTUATOR,))[0])
        self._goal = 0.0

    def reset(self, data: mujoco.MjData) -> None:
        """Hold the present height."""
        self._goal = float(data.qpos[self._qpos])

    def set_goal(self, data: mujoco.MjData, command: float) -> None:
        """Move the goal to the present height plus `command` (within +-1) times 5 cm."""
        self._goal = float(data.qpos[self._qpos]) + SCALE_M * command

    def apply(self, data: mujoco.MjData) -> None:
        """Write the lift force to `data.ctrl`: the wanted acceleration times the mass above, plus gravity."""
        wanted = KP * (self._goal - data.qpos[self._qpos]) - KD * data.qvel[self._qvel]
        data.ctrl[self._actuator] = data.M[self._mass] * wanted + data.qfrc_bias[self._qvel]
