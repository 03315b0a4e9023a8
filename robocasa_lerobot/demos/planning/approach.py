"""The joint path to a plan's first pose: what it costs along the straight line, and a path round what that meets.

The controller is told the hand's poses alone, so every path is judged by the joint angles that it will go through,
not by those that were planned.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import UP, Array, turned_up
from robocasa_lerobot.demos.planning.connect import Free, connect
from robocasa_lerobot.demos.planning.costs import PlanCosts
from robocasa_lerobot.demos.planning.follow import Following, hand_poses
from robocasa_lerobot.demos.planning.kinematics import Arm

STRETCHES = 4  # of the line, in each of which a touched body counts once
TESTED = Following(spacing_m=0.03)  # between tested configurations
MOST_TESTED = 40
MOST_TILT_RAD, LEVEL_ITERATIONS = 0.45, 400  # of what is to stay level; samples, most of which are of no use then

Counts = Callable[[Array, float], NDArray[np.int64]]


@dataclass(frozen=True)
class Approach:
    """Paths of an arm in one place.

    Attributes:
        arm: its kinematics.
        counts: bodies that it touches at configurations (N, 7), with a margin in metres, (N,).
        costs: weights.
        level: whether what is held stays upright: led so as of `follow.hand_poses`, and not much tilted on a detour.
    """

    arm: Arm
    counts: Counts
    costs: PlanCosts
    level: bool = False

    def straight(self, start: Array, goal: Array) -> float:
        """Cost of the straight line between joint angles (7,) without its end, as the controller goes along it."""
        went = self._went(start, goal[None])
        if not len(went):
            return 0.0
        near = self.counts(went[:-1], self.costs.near_m)
        close = near > 0
        if not close.any():
            return self._astray(went, goal)
        hits = np.zeros_like(near)  # what is not even near does not touch
        hits[close] = self.counts(went[:-1][close], 0.0)
        worst, beside = _of_stretches(hits), _of_stretches(np.maximum(near - hits, 0))
        return self.costs.hit * worst + self.costs.near * beside + self._astray(went, goal)

    def detour(self, start: Array, goal: Array, key: Array) -> tuple[Array, float] | None:
        """A joint path (k, 7) round what the straight line meets, and its cost; None where none was found.

        Args:
            start: joint angles (7,).
            goal: joint angles (7,).
            key: what else the path depends on: equal questions have equal answers.
        """
        generator = np.random.default_rng(zlib.crc32(np.concatenate([start, goal, key]).round(9).tobytes()))
        low, high = self.arm.ranges.T
        margin = 0.0 if self.counts(goal[None], self.costs.near_m).any() else self.costs.near_m
        if self.level:
            path = self._level_path(start, goal, self._free(margin), generator)
        else:
            path = connect(start, goal, self._free(margin), low, high, generator)
        if path is None:
            return None
        went = self._went(start, path)
        if self._astray(went, goal) or self.counts(went[:-1], 0.0).any():
            return None
        ends = np.vstack([start, path])
        longer = float(np.abs(np.diff(ends, axis=0)).max(axis=1).sum() - np.abs(goal - start).max())
        close = 0.0 if margin else self.costs.near * STRETCHES
        return path, self.costs.detour + self.costs.detour_per_rad * max(longer, 0.0) + close

    def _level_path(self, start: Array, goal: Array, free: Free, generator: np.random.Generator) -> Array | None:
        """A joint path (k, 7) on which what is up in the hand at the start stays up, more or less."""
        _, hands = self.arm.forward(np.stack([start, goal]))
        up = hands[0].T @ UP
        least = min(float(np.cos(MOST_TILT_RAD)), float(UP @ hands[1] @ up) - 1e-3)

        def upright(joints: Array) -> NDArray[np.bool_]:
            _, turns = self.arm.forward(joints)
            return free(joints) & (UP @ turns @ up >= least)

        def levelled(joints: Array) -> Array:
            positions, turns = self.arm.forward(joints[None])
            solved = self.arm.solve(positions, turned_up(turns[0], up)[None], joints[None])
            return solved.joints[0]

        low, high = self.arm.ranges.T
        return connect(start, goal, upright, low, high, generator, iterations=LEVEL_ITERATIONS, project=levelled)

    def _free(self, margin_m: float) -> Free:
        return lambda joints: self.counts(joints, margin_m) == 0

    def _went(self, start: Array, path: Array) -> Array:
        """Joint angles (N, 7) as the hand is led along a path (k, 7)."""
        positions, turns = hand_poses(self.arm, start, path, TESTED, level=self.level)
        if len(positions) > MOST_TESTED:
            chosen = np.linspace(0, len(positions) - 1, MOST_TESTED).round().astype(int)
            positions, turns = positions[chosen], turns[chosen]
        return self.arm.along(start, positions, turns)

    def _astray(self, went: Array, goal: Array) -> float:
        return self.costs.astray * float(np.abs(went[-1] - goal).max() > self.costs.astray_rad)


def _of_stretches(counts: NDArray[np.int64]) -> int:
    """The largest of counts (N,) in each of the stretches of a line, together."""
    each, more = divmod(len(counts), STRETCHES)
    values, total, begin = counts.tolist(), 0, 0
    for stretch in range(STRETCHES):
        end = begin + each + (stretch < more)
        total += max(values[begin:end], default=0)
        begin = end
    return total
