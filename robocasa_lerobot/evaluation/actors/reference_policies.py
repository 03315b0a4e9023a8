"""Policies that need no checkpoint and no torch: the engine's own sanity check, and bounds for every other result."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ActingTime, Observation
from robocasa_lerobot.evaluation.actors.stored_episodes import one_per_scene, read_episodes


def action_bounds(env: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest actions of an env; -1 and 1 where it sets no bound, the kitchens' where there is no env."""
    space = getattr(env, "action_space", None)
    if space is None:
        return -np.ones(contract.ACTION_SIZE), np.ones(contract.ACTION_SIZE)
    low, high = np.asarray(space.low, np.float64), np.asarray(space.high, np.float64)
    return np.where(np.isfinite(low), low, -1.0), np.where(np.isfinite(high), high, 1.0)


class _Blind:
    """A policy that never looks at pictures."""

    def __init__(self) -> None:
        self.time = ActingTime()

    def sees(self, step: int) -> bool:
        """Never looks."""
        return False


class ZeroPolicy(_Blind):
    """Every component zero: in our kitchens the arm holds still and the gripper opens."""

    def __init__(self) -> None:
        super().__init__()
        self._zeros: NDArray[np.float32] = np.zeros(contract.ACTION_SIZE, dtype=np.float32)

    def reset(self, seed: int, env: Any) -> None:
        """As many as the env takes."""
        low, _ = action_bounds(env)
        self._zeros = np.zeros(low.shape, dtype=np.float32)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """Zeros."""
        return self._zeros


class RandomPolicy(_Blind):
    """Actions uniform between the env's bounds, [-1, 1] in our kitchens, independent at each step."""

    def __init__(self) -> None:
        super().__init__()
        self._rng = np.random.default_rng(0)
        self._low, self._high = action_bounds(None)

    def reset(self, seed: int, env: Any) -> None:
        """Start the stream of this trial."""
        self._rng = np.random.default_rng(seed)
        self._low, self._high = action_bounds(env)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """A uniform sample."""
        return self._rng.uniform(self._low, self._high).astype(np.float32)


class DemonstratorPolicy(_Blind):
    """The demonstrator that recordings are made with, without their action noise: an upper bound.

    It reads the simulator's state, which no policy sees. Where a skill gives up, the arm holds still until the
    horizon: the trial fails, as one of a policy would.
    """

    def __init__(self) -> None:
        super().__init__()
        self._actions: Iterator[NDArray[np.float64]] = iter(())
        self._last: NDArray[np.float64] = np.zeros(contract.ACTION_SIZE)
        self._expert: Callable[[], NDArray[np.float32]] | None = None

    def reset(self, seed: int, env: Any) -> None:
        """Plan for the scene that the env has been reset to; an env with an expert of its own is shown by that.

        Raises:
            UnknownNameError: a stage of the task needs a skill that does not exist.
        """
        from robocasa_lerobot.demos.demonstrator import demonstrate

        self._expert = getattr(env, "expert_action", None)
        if self._expert is None:
            self._actions, self._last = demonstrate(env), np.zeros(contract.ACTION_SIZE)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The demonstrator's next action, in single precision as it is recorded."""
        if self._expert is not None:
            return self._expert()
        from robocasa_lerobot.demos.demonstrator import SkillError

        try:
            self._last = np.clip(next(self._actions), -1.0, 1.0)
        except (SkillError, StopIteration):
            gripper = contract.ACTION_SLICES["gripper_close"]
            held = np.zeros(contract.ACTION_SIZE)
            held[gripper] = self._last[gripper]
            self._last = held
        return self._last.astype(np.float32)


class ReplayPolicy(_Blind):
    """Stored actions, in the scenes that they were recorded in; zeros when they have ended."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._episodes = one_per_scene(read_episodes(path))
        self._actions: Iterator[NDArray[np.float32]] = iter(())

    def reset(self, seed: int, env: Any) -> None:
        """Find the episode of the env's task and scene."""
        self._actions = iter(self._episodes[env.task, env.split, env.scene.seed].actions)

    def act(self, observation: Observation, instruction: str) -> NDArray[np.float32]:
        """The next stored action."""
        return next(self._actions, np.zeros(contract.ACTION_SIZE, dtype=np.float32))
