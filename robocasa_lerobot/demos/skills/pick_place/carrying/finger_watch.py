"""Whether the fingers still come closer together as they carry something: they slide off a slope of it."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.motion import CLOSED, Array, HandTarget, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import hold_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

CREEP_STEPS = 12  # at the end of a move, in which what the fingers come closer by is asked, metres
# Between a place and the next one nothing was lost that crept by less than this.
NEAR_CREEP_M = 0.0022
# What goes along on a drive may creep less fast, and half as fast on a long way, which takes ten times as many steps.
CREEP_M, LONG_CREEP_M = 0.0005, 0.00025
DOUBTFUL_STEPS, DOUBTFUL_M = 4, 0.00003  # closer by more than this in the last steps: the watch goes on


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

    def go_on(self) -> Iterator[Array]:
        """Hold still after a short move until there are steps enough to tell; if nothing stirs, not a step."""
        hand = HandTarget(grip_position(self._env.data), hand_rotation(self._env.data))
        while len(self._gaps) <= CREEP_STEPS and self._closed_in(DOUBTFUL_STEPS) > DOUBTFUL_M:
            yield from hold_hand(self._env.data, hand, CLOSED, 1)
            self._gaps.append(finger_gap(self._env))

    def creeps(self, most_m: float) -> bool:
        """Whether the fingers still came closer together at the end of it, by more than `most_m` in `CREEP_STEPS`."""
        return len(self._gaps) > CREEP_STEPS and self._closed_in(CREEP_STEPS) > most_m

    def _closed_in(self, steps: int) -> float:
        """How much closer together the fingers came in the last steps, metres."""
        last = self._gaps[-steps - 1 :]
        return last[0] - last[-1]


def finger_gap(env: KitchenEnv) -> float:
    """How far apart the fingers are, metres."""
    return float(sum(abs(env.data.joint(name).qpos[0]) for name in env.scene.robot.names.finger_joints))
