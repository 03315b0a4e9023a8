"""Our kitchens of many tasks, for `task_scenes.py`: the seed of a reset names the task, the split and the scene.

The 32 composite target tasks, in the order of `TASKS`; `reset_seed` makes the seed.
"""

from __future__ import annotations

from typing import Any

import ours_sim
from peers import sim_loop

from robocasa_lerobot import contract
from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

TASKS = tuple(expand_names("composite_seen,composite_unseen"))
SPLITS = ("target", "pretrain")


def reset_seed(task: int, split: int, scene: int) -> int:
    """The seed that stands for a task (its number), a split (its number) and a scene."""
    return (scene * len(SPLITS) + split) * len(TASKS) + task


class TasksSimulator(ours_sim.KitchenSimulator):
    """The kitchen env, of another task at nearly every reset; constructing it is part of the reset."""

    def make(self, cameras: bool) -> None:
        self._has_cameras = cameras

    def reset(self, seed: int, same_scene: bool) -> None:
        if same_scene:
            raise RuntimeError("only new scenes are measured here")
        rest, task = divmod(seed, len(TASKS))
        scene, split = divmod(rest, len(SPLITS))
        if self._env is not None:
            self._env.close()
        self._env = KitchenEnv(
            TASKS[task],
            split=SPLITS[split],
            cameras=contract.CAMERAS if self._has_cameras else (),
            horizon=10**9,
            terminate_on_success=False,
        )
        self._env.reset(seed=scene)

    def describe(self) -> dict[str, Any]:
        return {**super().describe(), "env": f"{len(TASKS)} composite target tasks, {contract.ROBOT_TYPE}"}


if __name__ == "__main__":
    sim_loop.serve(TasksSimulator())
