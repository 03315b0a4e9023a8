"""Noticing at once that an object has left the hand, and whether it lies where no arm reaches it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.errors import LostError, SlippedError
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

FLOOR_M = 0.3  # an object's origin that is lower, and in no fixture, is on the floor
LEFT_M = 0.15  # of an object's origin from where it was in the hand


def touched_by_hand(env: KitchenEnv, obj: Graspable) -> tuple[bool, bool]:
    """Whether the hand touches an object, and whether something else does but what lies in the object."""
    hand = env.scene.subtree(env.scene.robot.names.hand)
    mine = np.zeros(env.model.nbody, dtype=np.bool_)
    mine[list(obj.bodies | obj.carried)] = True
    pairs = env.model.geom_bodyid[env.data.contact.geom].reshape(-1, 2)
    sides = np.concatenate([pairs, pairs[:, ::-1]])
    met = sides[mine[sides[:, 0]] & ~mine[sides[:, 1]], 1]
    return bool(hand[met].any()), not bool(hand[met].all())


def hangs(env: KitchenEnv, obj: Graspable) -> bool:
    """Whether an object touches the hand, and nothing else but what lies in it: it falls when the fingers open."""
    hand, other = touched_by_hand(env, obj)
    return hand and not other


def on_floor(env: KitchenEnv, obj: Graspable) -> bool:
    """Whether an object has fallen to where the arm cannot pick it up."""
    if env.data.body(obj.name).xpos[2] > FLOOR_M or touched_by_hand(env, obj)[0]:
        return False
    return locate(env, obj.name).fixture is None


def require_off_floor(env: KitchenEnv, obj: Graspable) -> None:
    """Raise where an object lies on the floor.

    Raises:
        LostError: it does.
    """
    if on_floor(env, obj):
        raise LostError(f"{obj.title} fell to the floor")


def unless_lost(env: KitchenEnv, obj: Graspable, move: Iterator[Array]) -> Iterator[Array]:
    """A move with an object in the hand, which ends as soon as that has left it.

    Raises:
        SlippedError: it has left the hand.
    """
    start = Held.now(env.data, obj.name).position
    for step in move:
        yield step
        away = float(np.linalg.norm(Held.now(env.data, obj.name).position - start))
        if away > LEFT_M and not touched_by_hand(env, obj)[0]:
            raise SlippedError(f"{obj.title} slipped out of the hand on its way")
