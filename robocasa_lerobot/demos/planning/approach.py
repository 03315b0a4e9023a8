"""The joint path to a plan's first pose: what it costs along the straight line, and a path round what that meets.

The controller is told the hand's poses alone, so every path is judged by the joint angles that it will go through,
not by those that were planned.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.connect import Free, connect
from robocasa_lerobot.demos.planning.costs import PlanCosts
from robocasa_lerobot.demos.planning.follow import Following, joint_line
from robocasa_lerobot.demos.planning.kinematics import Arm

STRETCHES = 4  # of the line, in each of which what is touched counts once
TESTED = Following(spacing_m=0.03)  # between tested configurations
MOST_TESTED = 40

Counts = Callable[[Array, float], NDArray[np.int64]]


@dataclass(frozen=True)
class Approach:
    """Paths of an arm in one place.

    Attributes:
        arm: its kinematics.
        counts: bodies that it touches at configurations (N, 7), with a margin in metres, (N,).
        costs: weights.
    """

    arm: Arm
    counts: Counts
    costs: PlanCosts

    def straight(self, start: Array, goal: Array) -> float:
        """Cost of the straight line between joint angles (7,) without its end, as the controller goes along it."""
        went = self._went(start, goal[None])
        if not len(went):
            return 0.0
        hits, near = self.counts(went[:-1], 0.0), self.counts(went[:-1], self.costs.near_m)
        worst = sum(int(part.max()) for part in np.array_split(hits, STRETCHES) if len(part))
        close = sum(int(part.max()) for part in np.array_split(np.maximum(near - hits, 0), STRETCHES) if len(part))
        return self.costs.hit * worst + self.costs.near * close + self._astray(went, goal)

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

    def _free(self, margin_m: float) -> Free:
        return lambda joints: self.counts(joints, margin_m) == 0

    def _went(self, start: Array, path: Array) -> Array:
        """Joint angles (N, 7) as the hand is led along a path (k, 7)."""
        lines = [joint_line(self.arm, a, b, TESTED) for a, b in itertools.pairwise([start, *path])]
        line = np.concatenate(lines)
        if len(line) > MOST_TESTED:
            line = line[np.linspace(0, len(line) - 1, MOST_TESTED).round().astype(int)]
        return self.arm.along(start, line)

    def _astray(self, went: Array, goal: Array) -> float:
        return self.costs.astray * float(np.abs(went[-1] - goal).max() > self.costs.astray_rad)
