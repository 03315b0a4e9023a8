"""The robot on an empty floor, for the tests of robot and controllers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.panda_omron.control.controller import PandaOmronController
from robocasa_lerobot.envs.robots.panda_omron.proprioception import read_observations, read_state
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

SHARED = Path(__file__).parents[3] / "shared"
SETTLE_STEPS = 10


def arena_spec(quality: str = "fast") -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    apply_simulation_options(spec)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(20, 20, 0.1))
    PANDA_OMRON.add_to(spec, quality)
    return spec


def action(mode: float = -1.0, **parts: float | tuple[float, ...]) -> NDArray[np.float64]:
    """An action in HDF5 order from the names of its runs."""
    where = {"position": slice(0, 3), "rotation": slice(3, 6), "gripper": 6, "base": slice(7, 10), "torso": 10}
    out = np.zeros(12)
    out[11] = mode
    for name, value in parts.items():
        out[where[name]] = value
    return out


@dataclass
class Arena:
    """A settled robot at the world's origin."""

    model: mujoco.MjModel
    data: mujoco.MjData
    controller: PandaOmronController

    @classmethod
    def settled(cls, model: mujoco.MjModel, yaw: float = 0.0, steps: int = SETTLE_STEPS) -> Arena:
        data = mujoco.MjData(model)
        PANDA_OMRON.set_home(model, data)
        PANDA_OMRON.place_base(model, data, 0.0, 0.0, yaw)
        mujoco.mj_forward(model, data)
        controller = PandaOmronController(model, data)
        controller.reset()
        arena = cls(model, data, controller)
        arena.run(action(), steps)
        return arena

    def run(self, command: NDArray[np.float64], steps: int = 1) -> None:
        for _ in range(steps):
            control_step(self.model, self.data, self.controller, command)

    def state(self) -> NDArray[np.float64]:
        return read_state(self.model, self.data)

    def observations(self) -> dict[str, NDArray[np.float64]]:
        return read_observations(self.model, self.data)

    def joint(self, name: str) -> float:
        return float(self.data.joint(name).qpos[0])
