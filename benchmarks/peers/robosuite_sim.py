"""robosuite's PickPlace with its PandaOmron, for `sim_speed.py`. Runs in robosuite's own virtual environment.

Everything is robosuite's default where it has one: the composite controller, the physics settings, the reset that
loads the model again ("new scene"). A reset in the same scene is robosuite's soft reset.
"""

from __future__ import annotations

import importlib.metadata
from typing import Any

import numpy as np
import robosuite
import sim_loop
from numpy.typing import NDArray
from robosuite.controllers import load_composite_controller_config

ENV, ROBOT, CONTROL_HZ, IMAGE_SIZE = "PickPlace", "PandaOmron", 20, 256
# The policies' cameras where the robot has them (from 1.5.2 on), else two that see the arena and the wrist's.
POLICY_CAMERAS = ["robot0_agentview_left", "robot0_agentview_right", "robot0_eye_in_hand"]
OTHER_CAMERAS = ["agentview", "frontview", "robot0_eye_in_hand"]


class RobosuiteSimulator:
    """robosuite's env behind the benchmark's interface."""

    def __init__(self) -> None:
        self._env: Any = None
        self._cameras: list[str] = []
        self._order: list[int] = []

    def make(self, cameras: bool) -> None:
        if cameras:
            self._cameras = _choose_cameras()
        self._env = _make_env(self._cameras)
        self._order = _action_order(self._env)

    def reset(self, seed: int, same_scene: bool) -> None:
        np.random.seed(seed)  # noqa: NPY002 (the generator that robosuite 1.5.1 places objects with)
        self._env.hard_reset = not same_scene
        self._env.reset()

    def step(self, action: NDArray[np.float64]) -> None:
        observation, *_ = self._env.step(action[self._order])
        for camera in self._cameras:
            assert observation[f"{camera}_image"].shape == (IMAGE_SIZE, IMAGE_SIZE, 3)

    def model(self) -> Any:
        return self._env.sim.model._model

    def describe(self) -> dict[str, Any]:
        return {
            "env": f"{ENV}, {ROBOT}",
            "cameras": self._cameras,
            "controller": type(self._env.robots[0].composite_controller).__name__,
            "physics_timestep_s": float(self.model().opt.timestep),
            "control_hz": self._env.control_freq,
            "versions": {name: importlib.metadata.version(name) for name in ("robosuite", "mujoco", "numpy", "numba")},
        }

    def split(self, seed: int, steps: int) -> dict[str, float]:
        raise NotImplementedError("only our own time is split")


def _make_env(cameras: list[str]) -> Any:
    return robosuite.make(
        ENV,
        robots=ROBOT,
        controller_configs=load_composite_controller_config(robot=ROBOT),
        has_renderer=False,
        has_offscreen_renderer=bool(cameras),
        use_camera_obs=bool(cameras),
        camera_names=cameras or "agentview",
        camera_heights=IMAGE_SIZE,
        camera_widths=IMAGE_SIZE,
        control_freq=CONTROL_HZ,
        ignore_done=True,
        horizon=10**9,
    )


def _action_order(env: Any) -> list[int]:
    """Which number of the benchmark's actions stands at each place of the env's: the order is up to its config."""
    places = {"right": range(6), "right_gripper": [6], "base": range(7, 10), "torso": [10]}
    order = [11] * env.action_dim  # the base mode, which has no part of its own, is the last
    for part, (start, end) in env.robots[0].composite_controller._action_split_indexes.items():
        order[start:end] = places[part]
    if sorted(order) != list(range(sim_loop.ACTION_SIZE)):
        raise RuntimeError(f"unexpected parts of the action: {order}")
    return order


def _choose_cameras() -> list[str]:
    env = _make_env([])
    known = set(env.sim.model.camera_names)
    env.close()
    return POLICY_CAMERAS if known.issuperset(POLICY_CAMERAS) else OTHER_CAMERAS


if __name__ == "__main__":
    sim_loop.serve(RobosuiteSimulator())
