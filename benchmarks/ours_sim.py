"""Our kitchen env, for `sim_speed.py`: a full kitchen with doors, drawers and objects, three cameras or none.

What measures is the peers' own loop (`peers/sim_loop.py`): all simulators are measured by the same lines.
"""

from __future__ import annotations

import copy
import importlib.metadata
import statistics
import time
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from peers import sim_loop

import robocasa_lerobot
from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.physics.nearby import Nearby
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.panda_omron.control.controller import PandaOmronController

TASK = "PickPlaceCounterToSink"
SPLIT_PASSES = 3


class KitchenSimulator:
    """The kitchen env behind the benchmark's interface."""

    def __init__(self) -> None:
        self._env: Any = None
        self._seed: int | None = None

    def make(self, cameras: bool) -> None:
        self._env = KitchenEnv(
            TASK, cameras=contract.CAMERAS if cameras else (), horizon=10**9, terminate_on_success=False
        )
        self._env.render_observations = cameras

    def reset(self, seed: int, same_scene: bool) -> None:
        if same_scene != (seed == self._seed):  # the env itself would take the short way for the running seed
            raise RuntimeError(f"seed {seed} after {self._seed} is not what same_scene={same_scene} means")
        self._env.reset(seed=seed)
        self._seed = seed

    def step(self, action: NDArray[np.float64]) -> None:
        observation, *_ = self._env.step(contract.hdf5_to_stored(action))
        for picture in observation.get("pixels", {}).values():
            assert picture.shape == (contract.IMAGE_SIZE, contract.IMAGE_SIZE, 3)

    def model(self) -> Any:
        return self._env.model

    def describe(self) -> dict[str, Any]:
        return {
            "env": f"{TASK}, {contract.ROBOT_TYPE}",
            "cameras": list(self._env.cameras),
            "render_preset": self._env.render_preset,
            "physics_timestep_s": float(self._env.model.opt.timestep),
            "control_hz": contract.CONTROL_HZ,
            "versions": {
                "robocasa_lerobot": robocasa_lerobot.__version__,
                **{name: importlib.metadata.version(name) for name in ("mujoco", "numpy", "numba")},
            },
        }

    def split(self, seed: int, steps: int) -> dict[str, float]:
        """Seconds per control step, the median of three passes over one episode; the env must have cameras.

        The episode is run in three ways from the same start with the same actions, and so through the same states:
        the whole step with pictures, without them, and the controlled physics alone. At every state of the last one
        MuJoCo's own 25 steps are timed as well, on a copy, with the controls held, and with contacts searched for among
        the same bodies (`physics/nearby.py`; choosing these counts as control). Parts are differences of these:
        rendering, Python (observation without pictures, goal, info, checks), control, physics.
        """
        if self._seed != seed:
            self.reset(seed, same_scene=False)
        actions = sim_loop.episode_actions(seed, steps)
        self._controlled_physics(seed, actions)  # caches warm, nothing counted
        passes: dict[str, list[float]] = {"with_pictures": [], "without": [], "controlled": [], "physics": []}
        for _ in range(SPLIT_PASSES):
            passes["with_pictures"].append(self._whole_steps(seed, actions, pictures=True))
            passes["without"].append(self._whole_steps(seed, actions, pictures=False))
            controlled, physics = self._controlled_physics(seed, actions)
            passes["controlled"].append(controlled)
            passes["physics"].append(physics)
        self._env.render_observations = True
        whole, without, controlled, physics = (statistics.median(values) / steps for values in passes.values())
        return {
            "physics_s": physics,
            "control_s": controlled - physics,
            "python_s": without - controlled,
            "rendering_s": whole - without,
            "step_without_pictures_s": without,
            "step_s": whole,
        }

    def _whole_steps(self, seed: int, actions: NDArray[np.float64], pictures: bool) -> float:
        self._env.render_observations = True
        self.reset(seed, same_scene=True)
        self._env.render_observations = pictures
        stored = [contract.hdf5_to_stored(action) for action in actions]
        start = time.perf_counter()
        for action in stored:
            self._env.step(action)
        return time.perf_counter() - start

    def _controlled_physics(self, seed: int, actions: NDArray[np.float64]) -> tuple[float, float]:
        self.reset(seed, same_scene=True)
        model, data = self._env.model, self._env.data
        controller = PandaOmronController(model, data)
        controller.set_state(self._env.get_state().controller)
        held = copy.copy(data)
        nearby = Nearby(model, held)
        controlled = physics = 0.0
        for action in actions:
            mujoco.mj_copyData(held, model, data)
            nearby.leave_out()
            start = time.perf_counter()
            mujoco.mj_step(model, held, contract.SUBSTEPS)
            physics += time.perf_counter() - start
            nearby.look_at_all()
            start = time.perf_counter()
            control_step(model, data, controller, action)
            controlled += time.perf_counter() - start
        return controlled, physics


if __name__ == "__main__":
    sim_loop.serve(KitchenSimulator())
