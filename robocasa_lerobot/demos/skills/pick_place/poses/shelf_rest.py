"""Where an object comes to rest on a shelf once it is let go: what leans far topples, and may fall off the front."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, rotation_about
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Region

STEP_RAD, MOST_STEPS = float(np.deg2rad(5.0)), 36  # of an object that topples
GROUND_M = 0.003  # points as low as this over the lowest one carry an object
LEVEL_M, DROP_M = 0.002, 2e-4  # of its middle beside what carries it, and of its fall in a step: less is rest
EDGE_M = 0.01  # that it is to come to rest behind the front
# For each metre that it stands out over the front, or that its middle falls as it topples; its middle over the edge.
OUT_COST, FALL_COST, OFF_COST = 20.0, 6.0, 4.0


def stays_on_shelf(env: KitchenEnv, obj: Graspable, regions: Sequence[Region]) -> Callable[[Array, Array], float]:
    """The cost of an object that is let go on one of several shelves, by its origin (3,) and rotation (3, 3)."""
    mass = np.array(env.model.body(obj.name).ipos)
    floors = [region.world(env.data, (0.0, 0.0, -region.half[2])) for region in regions]
    turns = [env.data.body(region.body).xmat.reshape(3, 3).copy() for region in regions]
    rests: dict[bytes, tuple[Array, Array, float]] = {}

    def cost(origin: Array, turn: Array) -> float:
        key = np.round(turn, 4).tobytes()
        if key not in rests:
            rests[key] = rest_of(obj.cloud @ turn.T, turn @ mass)
        points, middle, fall = rests[key]
        index = min(range(len(regions)), key=lambda i: float(np.abs(origin - floors[i]) @ [0.1, 0.1, 1.0]))
        inwards = turns[index][:, 1]
        front = float((floors[index] - origin) @ inwards) - regions[index].half[1] + EDGE_M
        out = max(front - float((points @ inwards).min()), 0.0)
        off = front - EDGE_M > float(middle @ inwards)
        return OUT_COST * out + FALL_COST * fall + (OFF_COST if off else 0.0)

    return cost


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
