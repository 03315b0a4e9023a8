"""Vessels with others in them stay upright in the hand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, grip_position, hand_rotation, turned_up
from robocasa_lerobot.demos.skills.common import hold_hand
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

STEEPEST_COS = 0.7  # an object that leans more than 45 degrees is carried as it lies in the hand
LEVEL_COS, LEVEL_STEPS = float(np.cos(np.deg2rad(2.0))), 12


def level_out(env: KitchenEnv, obj: Graspable) -> Iterator[Array]:
    """Turn the hand until a vessel with others in it stands upright again: its load turns it between the fingers."""
    if obj.contents and float(env.data.body(obj.name).xmat[8]) < LEVEL_COS:
        target = HandTarget(grip_position(env.data), level_hand(env, obj))
        yield from hold_hand(env.data, target, CLOSED, LEVEL_STEPS)


def levelled(turn: Array) -> Array:
    """A rotation that stands upright with the least turn from the present one; what lies, stays as it is."""
    return turn if float(turn[:, 2] @ UP) < STEEPEST_COS else turned_up(turn, UP)


def level_hand(env: KitchenEnv, obj: Graspable) -> Array:
    """The hand's rotation (3, 3), turned so far that a vessel that it holds stands upright with what is in it."""
    present = hand_rotation(env.data)
    if not obj.contents:
        return present
    turn = env.data.body(obj.name).xmat.reshape(3, 3)
    upright: Array = levelled(turn) @ turn.T @ present
    return upright
