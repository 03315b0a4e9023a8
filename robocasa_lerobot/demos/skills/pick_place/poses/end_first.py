"""What is long and is to stand in a narrow vessel goes in with one end first, and is let go when that end is inside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

# Depths of the underside below the rim at which it is let go, metres, with their costs: the hand stays above.
DEPTHS_M = ((0.055, 0.0), (0.040, 0.1), (0.020, 0.3), (-0.003, 0.6))
BESIDE_COST = 30.0  # for each metre that it reaches beyond the wall


def into_mouth(env: KitchenEnv, holder: str) -> PlacePoses:
    """In the middle of a vessel's mouth, from well below its rim to just over it."""

    def poses() -> list[PlacePose]:
        return [PlacePose(_mouth(env, holder) - depth * UP, cost) for depth, cost in DEPTHS_M]

    return poses


def within_mouth(env: KitchenEnv, obj: Graspable, holder: str) -> Callable[[Array, Array], float]:
    """A cost of an object's origin and rotation: for how far it reaches beyond the wall of a vessel."""
    inside = env.scene.objects[holder].item.interior
    assert inside is not None
    wide = float(np.linalg.norm(inside.half[:2]))  # the corners of what is inscribed in it are at its wall

    def cost(origin: Array, turn: Array) -> float:
        points = obj.cloud @ turn.T + origin
        beyond = float(np.linalg.norm((points - _mouth(env, holder))[:, :2], axis=1).max()) - wide
        return BESIDE_COST * max(beyond, 0.0)

    return cost


def _mouth(env: KitchenEnv, holder: str) -> Array:
    body, inside = env.data.body(holder), env.scene.objects[holder].item.interior
    assert inside is not None
    middle: Array = body.xpos + body.xmat.reshape(3, 3) @ (np.array(inside.center) + inside.half[2] * UP)
    return middle
