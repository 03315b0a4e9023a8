"""Side by side on a plate: where an object leaves the most room for others, and lies on them the least."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, contents_of, filled, graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.objects import middle_of

FLAT_M = 0.035  # greatest height of what counts as a plate
SHARES, DIRECTIONS = (0.5, 0.9), 8  # of how far from the middle an object may come, and to which sides
OVERLAP_COST = 2.5  # of all points of the others under or over an object
ROOM_GAIN, ENOUGH_SHARE = 6.0, 0.5  # of a metre beside the middle, across the object, up to this share of that distance


def is_flat(env: KitchenEnv, holder: str) -> bool:
    """Whether things lie side by side on an object rather than heaped in it."""
    return env.scene.objects[holder].item.size[2] < FLAT_M


def offsets(most_m: float) -> list[Array]:
    """Places (2,) round a plate's middle, which comes first, no farther off than a distance, metres."""
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = [np.array([np.cos(angle), np.sin(angle)]) for angle in angles]
    return [np.zeros(2), *(share * most_m * way for share, way in itertools.product(SHARES, ways))]


def side_by_side(
    env: KitchenEnv, obj: Graspable, holder: str, most_m: float, *, more: bool
) -> Callable[[Array, Array], float]:
    """Cost of an object's origin (3,) and rotation (3, 3) on a plate by what lies there, and is to come if `more`.

    Args:
        env: the kitchen.
        obj: to be put down.
        holder: the plate's name.
        most_m: how far from its middle an object counts, metres.
        more: whether other objects come there later.
    """
    middle = middle_of(env.scene, env.data, holder)[:2].copy()
    others = _outlines(env, [name for name in contents_of(env, holder) if name != obj.name])
    half = np.abs(obj.cloud).max(axis=0)

    def cost(origin: Array, turn: Array) -> float:
        long = int(np.argmax(half * np.linalg.norm(turn[:2], axis=0)))  # of its axes, as it lies then
        along = turn[:2, long] / max(float(np.linalg.norm(turn[:2, long])), 1e-6)
        across = np.array([-along[1], along[0]])
        found = 0.0
        if len(others):
            wide = float(np.abs(obj.cloud @ turn[:2].T @ across).max())
            away = others - origin[:2]
            under = (np.abs(away @ along) < half[long]) & (np.abs(away @ across) < wide)
            found += OVERLAP_COST * float(under.mean())
        if more:
            beside = abs(float((origin[:2] - middle) @ across))
            found -= ROOM_GAIN * min(beside, ENOUGH_SHARE * most_m)
        return found

    return cost


def _outlines(env: KitchenEnv, names: Sequence[str]) -> Array:
    """Points (n, 2) of objects as seen from above."""
    found: list[Array] = [np.zeros((0, 2))]
    for name in names:
        body = env.data.body(name)
        turn = body.xmat.reshape(3, 3)
        found += [(filled(solid.cloud()) @ turn.T + body.xpos)[:, :2] for solid in graspable(env, name).solids]
    return np.concatenate(found)
