"""Where an object comes to rest on a shelf once it is let go: what leans far topples, and may fall off the front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, rotation_about
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

STEP_RAD, MOST_STEPS = float(np.deg2rad(5.0)), 36  # of an object that topples
GROUND_M = 0.003  # points as low as this over the lowest one carry an object
LEVEL_M, DROP_M = 0.002, 2e-4  # of its middle beside what carries it, and of its fall in a step: less is rest
BELOW = np.array([0.1, 0.1, 1.0])  # of the shelves that one is meant which is nearest so, each axis weighed
EDGE_M = 0.01  # that it is to come to rest behind the front
# For each metre that it stands out over the front, or that its middle falls as it topples; its middle over the edge.
OUT_COST, FALL_COST, OFF_COST = 20.0, 6.0, 4.0


class ShelfRest:
    """Where an object comes to rest that is let go on one of several shelves.

    Args:
        env: the kitchen.
        obj: that is let go.
        regions: over the shelves.
    """

    def __init__(self, env: KitchenEnv, obj: Graspable, regions: Sequence[Region]) -> None:
        self._cloud, self._mass = obj.cloud, np.array(env.model.body(obj.name).ipos)
        self._regions = regions
        self._floors = [region.world(env.data, (0.0, 0.0, -region.half[2])) for region in regions]
        self._inwards = [env.data.body(region.body).xmat.reshape(3, 3)[:, 1].copy() for region in regions]
        self._rests: dict[bytes, tuple[Array, Array, float]] = {}

    def cost(self, origin: Array, turn: Array) -> float:
        """Of letting it go with its origin (3,) and rotation (3, 3) there."""
        points, _, fall = self._rest(turn)
        inwards, front = self._front(origin)
        out = max(front + EDGE_M - float((points @ inwards).min()), 0.0)
        return OUT_COST * out + FALL_COST * fall + (OFF_COST if self.falls_off(origin, turn) else 0.0)

    def falls_off(self, origin: Array, turn: Array) -> bool:
        """Whether its middle comes to be before the front of the shelf."""
        inwards, front = self._front(origin)
        return front > float(self._rest(turn)[1] @ inwards)

    def _rest(self, turn: Array) -> tuple[Array, Array, float]:
        key = np.round(turn, 4).tobytes()
        if key not in self._rests:
            self._rests[key] = rest_of(self._cloud @ turn.T, turn @ self._mass)
        return self._rests[key]

    def _front(self, origin: Array) -> tuple[Array, float]:
        """The way inwards (3,) on the shelf below an origin, and how far from this its front edge is along it."""
        nearest = min(range(len(self._floors)), key=lambda i: float(np.abs(origin - self._floors[i]) @ BELOW))
        inwards = self._inwards[nearest]
        return inwards, float((self._floors[nearest] - origin) @ inwards) - self._regions[nearest].half[1]


def rest_of(points: Array, middle: Array) -> tuple[Array, Array, float]:
    """Where an object rolls to on a level floor that it touches, without sliding.

    Args:
        points: corners (n, 3) of it, world axes, from any origin, metres.
        middle: its centre of mass (3,), from the same.

    Returns:
        points and middle at rest, from the same origin, and how far the middle has come down, metres.
    """
    points, middle = points.copy(), middle.copy()
    floor = float(points[:, 2].min())
    start = float(middle[2])
    for _ in range(MOST_STEPS):
        foot = points[points[:, 2] < points[:, 2].min() + GROUND_M].mean(axis=0)
        aside = (middle - foot) * [1.0, 1.0, 0.0]
        if float(np.linalg.norm(aside)) < LEVEL_M:
            break
        step = rotation_about(np.cross(UP, aside) / float(np.linalg.norm(aside)), STEP_RAD)
        turned, moved = (points - foot) @ step.T + foot, step @ (middle - foot) + foot
        sunk = (floor - float(turned[:, 2].min())) * UP
        turned, moved = turned + sunk, moved + sunk
        if float(moved[2]) > float(middle[2]) - DROP_M:
            break
        points, middle = turned, moved
    return points, middle, start - float(middle[2])
