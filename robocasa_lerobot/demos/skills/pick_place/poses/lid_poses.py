"""Vessels with lids: a lid lies on the rim, and what is to be under it lies between the walls, beside what is there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.demos.skills.pick_place.poses.plate_poses import offsets, side_by_side
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

# Shares of a vessel's depth, with their costs: fingers that open low in it brace against its walls.
DROPS = ((0.3, 0.5), (0.7, 0.0), (1.0, 0.1))
ROUND_SHARE = 1.3  # of a round vessel's inside as objects have it, a square within its walls: the radius between these
WALL_COST, BESIDE_COST = 40.0, 1.0  # for each metre that something stands out beyond the walls; beside the middle


def is_lid(obj: Graspable) -> bool:
    """Whether an object is a lid, which is laid down level wherever it goes."""
    return obj.item is not None and "lid" in obj.item.category.groups


def is_lid_of(env: KitchenEnv, obj: Graspable, holder: str) -> bool:
    """Whether an object is made to lie on the rim of another one."""
    return obj.item is not None and env.scene.objects[holder].item.category.auxiliary == obj.item.category.name


def is_covered_later(env: KitchenEnv, stage: Stage, holder: str) -> bool:
    """Whether a later stage puts a lid onto the vessel that a stage puts something into."""
    stages = env.declaration.stages
    later = stages[stages.index(stage) + 1 :] if stage in stages else ()
    lid = env.scene.objects[holder].item.category.auxiliary
    named = (env.scene.objects.get(env.scene.fill(each.object)) for each in later if each.target == stage.target)
    return lid is not None and any(other is not None and other.item.category.name == lid for other in named)


def on_rim(env: KitchenEnv, holder: str) -> PlacePoses:
    """On the rim of a vessel, in the middle."""

    def poses() -> list[PlacePose]:
        return [PlacePose(_inside(env, holder, 2.0, np.zeros(2)))]

    return poses


def between_walls(env: KitchenEnv, obj: Graspable, holder: str) -> PlacePoses:
    """All over the floor of a vessel, and from higher up in it."""
    radius = _radius(env, holder)
    narrow = float(np.sort(np.abs(obj.cloud).max(axis=0)[:2])[0])

    def poses() -> list[PlacePose]:
        return [
            PlacePose(_inside(env, holder, 2 * drop, aside), extra + BESIDE_COST * float(np.linalg.norm(aside)))
            for aside in offsets(max(radius - narrow, 0.0))
            for drop, extra in DROPS
        ]

    return poses


def under_lid(env: KitchenEnv, obj: Graspable, holder: str, *, more: bool) -> Callable[[Array, Array], float]:
    """Cost of an object's origin (3,) and rotation (3, 3) in a vessel: beside what lies there, and between the walls.

    Args:
        env: the kitchen.
        obj: to be put down.
        holder: the vessel's name.
        more: whether other objects come there later.
    """
    radius, middle = _radius(env, holder), _inside(env, holder, 0.0, np.zeros(2))[:2]
    beside = side_by_side(env, obj, holder, radius, more=more)

    def cost(origin: Array, turn: Array) -> float:
        points = (obj.cloud @ turn.T + origin)[:, :2]
        out = float(np.linalg.norm(points - middle, axis=1).max()) - radius
        return beside(origin, turn) + WALL_COST * max(out, 0.0)

    return cost


def _radius(env: KitchenEnv, holder: str) -> float:
    """Between the walls at the floor, metres."""
    inside = env.scene.objects[holder].item.interior
    assert inside is not None
    return ROUND_SHARE * float(min(inside.half[:2]))


def _inside(env: KitchenEnv, holder: str, share: float, aside: Array) -> Array:
    """A point (3,) in a vessel, at half its depth times a share, beside its middle by (2,) metres."""
    body, inside = env.data.body(holder), env.scene.objects[holder].item.interior
    assert inside is not None
    floor = np.asarray(inside.center) - np.asarray(inside.half) * UP
    point: Array = floor + np.array([*aside, share * inside.half[2]])
    return body.xpos + body.xmat.reshape(3, 3) @ point
