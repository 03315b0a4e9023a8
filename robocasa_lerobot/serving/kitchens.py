"""Seeded trials in the kitchens, step by step, with the names of vla-eval's RoboCasa365 benchmark.

Nothing here imports vla-eval: `vla_eval_benchmark.py` makes its benchmark class of this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract, gl
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks import registry
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.planning.trials import noise_seed, trial_seed

TARGET_SETS: Final = ("atomic_seen", "composite_seen", "composite_unseen")
OTHER_SET: Final = "other"  # of tasks that belong to none of them


@dataclass
class Step:
    """What a control step gave; `success` stays true once the goal has held."""

    observation: dict[str, Any]
    reward: float
    done: bool
    success: bool
    info: dict[str, Any] = field(default_factory=dict)


class Kitchens:
    """The trials of our own evaluation: trial `i` of a task is that of `eval.py` with the same seed.

    Args:
        tasks: names of tasks and task sets; all target tasks of this version if None.
        camera_size: height and width of the pictures, pixels.
        max_steps: control steps at 20 Hz of all tasks; each task's own horizon if None.
        split: target or pretrain kitchens.
        seed: of the evaluation.
        render_preset: fast or quality.
        terminate_on_success: a trial ends when its goal holds, as in our evaluation; else at its horizon.

    Raises:
        UserError: an unknown task, split or render preset, or numbers out of their range.
    """

    def __init__(
        self,
        tasks: Sequence[str] | None = None,
        camera_size: int = contract.IMAGE_SIZE,
        max_steps: int | None = None,
        split: str = "target",
        seed: int = 0,
        render_preset: str = "fast",
        terminate_on_success: bool = True,
    ) -> None:
        if isinstance(tasks, str):
            raise UserError(f"tasks: found the text {tasks!r}, expected a list of names.")
        for name, number, least in (("seed", seed, 0), ("camera_size", camera_size, 1), ("max_steps", max_steps, 1)):
            if number is not None and number < least:
                raise UserError(f"{name}: found {number}, expected at least {least}.")
        self._suites = _suites(tasks)
        self.seed = seed
        self._arguments: dict[str, Any] = {
            "split": split,
            "image_size": camera_size,
            "horizon": max_steps,
            "render_preset": render_preset,
            "terminate_on_success": terminate_on_success,
        }
        # Fails here, once, where the runner says why: in a reset it would count as each trial's failure.
        KitchenEnv(next(iter(self._suites)), **self._arguments).close()
        self._env: KitchenEnv | None = None
        self._success = False

    def tasks(self) -> list[dict[str, Any]]:
        """Name and suite of each task."""
        return [{"name": name, "suite": suite} for name, suite in self._suites.items()]

    def horizon(self, task: str) -> int:
        """Control steps after which a trial of a task ends."""
        return int(self._arguments["horizon"] or registry.get_task(task).horizon)

    @property
    def longest(self) -> int:
        """The longest horizon of all tasks."""
        return max(self.horizon(task) for task in self._suites)

    def seeds(self, task: str, trial: int) -> dict[str, int]:
        """Seeds of a trial's scene and of the policy's noise."""
        return {"seed": trial_seed(self.seed, task, trial), "policy_seed": noise_seed(self.seed, task, trial)}

    def reset(self, task: str, trial: int) -> dict[str, Any]:
        """The first observation of a trial."""
        if self._env is None or self._env.task != task:
            self.close()
            gl.ensure_drawing()
            self._env = KitchenEnv(task, **self._arguments)
        self._success = False
        observation, info = self._env.reset(seed=self.seeds(task, trial)["seed"])
        return _named(observation, info)

    def step(self, actions: Any) -> Step:
        """Execute an action of 12 numbers in HDF5 order.

        Raises:
            UserError: another shape, or numbers that are not finite.
        """
        assert self._env is not None, "reset comes first"
        observation, reward, terminated, truncated, info = self._env.step(_action(actions))
        self._success = self._success or bool(info["success"])
        named = _named(observation, info)
        return Step(named, float(reward), bool(terminated or truncated), self._success, info)

    @staticmethod
    def held(actions: Any) -> NDArray[np.float32]:
        """The action that stands still in the place of one that came too late: the gripper stays as it was told."""
        out = np.zeros(contract.ACTION_SIZE, dtype=np.float32)
        if actions is not None:
            gripper = contract.ACTION_SLICES_HDF5["gripper_close"]
            out[gripper] = np.asarray(actions, dtype=np.float32)[gripper]
        return out

    def render(self) -> NDArray[np.uint8] | None:
        """A picture for people, None before the first trial."""
        return None if self._env is None else np.asarray(self._env.render(), dtype=np.uint8)

    def close(self) -> None:
        """Let go of the env."""
        if self._env is not None:
            env, self._env = self._env, None
            env.close()


def _suites(tasks: Sequence[str] | None) -> dict[str, str]:
    """Each task's set, by its name."""
    sets = {name: registry.task_set(name) for name in TARGET_SETS if name in registry.task_sets()}
    suite_of: dict[str, str] = {task: name for name, members in sets.items() for task in members}
    if tasks is None:
        return suite_of
    out: dict[str, str] = {}
    for name in tasks:
        members = registry.task_set(name) if name in registry.task_sets() else (registry.get_task(name).name,)
        out |= {task: suite_of.get(task, OTHER_SET) for task in members}
    if not out:
        raise UserError("tasks: found none, expected names of tasks or task sets.")
    return out


def _action(actions: Any) -> NDArray[np.float32]:
    if isinstance(actions, Mapping):
        actions = actions.get("actions", actions.get("action"))
    try:
        numbers = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"actions: found {actions!r:.60}, expected {contract.ACTION_SIZE} numbers.") from error
    if numbers.shape != (contract.ACTION_SIZE,) or not np.isfinite(numbers).all():
        raise UserError(
            f"actions: found an array of shape {numbers.shape}, expected {contract.ACTION_SIZE} finite numbers: "
            + ", ".join(f"{part.name} ({part.size})" for part in contract.ACTION_PARTS_HDF5)
            + "."
        )
    return contract.hdf5_to_stored(numbers).astype(np.float32)


def _named(observation: Mapping[str, Any], info: Mapping[str, Any]) -> dict[str, Any]:
    """An observation as vla-eval's RoboCasa365 benchmark names it."""
    state = contract.split_state(observation["agent_pos"])
    return {
        "images": {f"video.{camera}": picture for camera, picture in observation["pixels"].items()},
        "state": {f"state.{name}": values for name, values in state.items()},
        "task_description": str(info["instruction"]),
    }
