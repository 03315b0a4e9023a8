"""Whether the fingers still come closer together as they carry something: they slide off a slope of it."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

CREEP_M, CREEP_STEPS = 0.0005, 12  # closer by this in so many steps, at the end of a move


class FingerWatch:
    """How far apart the fingers were in the steps of the last move.

    Args:
        env: the kitchen.
    """

    def __init__(self, env: KitchenEnv) -> None:
        self._env = env
        self._gaps: list[float] = []

    def over(self, move: Iterator[Array]) -> Iterator[Array]:
        """The same move, watched."""
        self._gaps = []
        for step in move:
            self._gaps.append(finger_gap(self._env))
            yield step
        self._gaps.append(finger_gap(self._env))

    def creeps(self) -> bool:
        """Whether the fingers still came closer together at the end of it."""
        last = self._gaps[-CREEP_STEPS - 1 :]
        return len(last) > CREEP_STEPS and last[0] - last[-1] > CREEP_M


def finger_gap(env: KitchenEnv) -> float:
    """How far apart the fingers are, metres."""
    return float(sum(abs(env.data.joint(name).qpos[0]) for name in env.scene.robot.names.finger_joints))
