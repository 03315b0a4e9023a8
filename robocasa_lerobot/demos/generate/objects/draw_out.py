"""Out of where something was taken: as far as a demonstrator draws it before the arm goes its own way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import move_hand
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import GraspStrategy, entry
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

SPEED, NEAR_M = 0.8, 0.03
LEAST_M = 0.02  # that is left: less is not gone


def draw_out(env: KitchenEnv, strategy: GraspStrategy, moved: Array) -> Iterator[Array]:
    """Lead a hand that holds something along a line out of a cavity.

    A segment of a source ends when its object has been lifted, or drawn a hand's breadth: on its way from there the
    arm would lead it through a shelf's side.

    Args:
        env: the kitchen.
        strategy: by which it is grasped there; it says how far, and which way.
        moved: (3,) that it has gone already, metres.
    """
    turn = hand_rotation(env.data)
    if strategy.narrow and "up" in strategy.entries:
        way, length_m = UP, strategy.lift_m
    elif "along" in strategy.entries:
        way, length_m = -turn[:, 2], strategy.out_m
    else:
        way, length_m = entry(env, "out"), strategy.out_m
    left_m = length_m - float(np.dot(moved, way))
    if left_m > LEAST_M:
        start = grip_position(env.data)
        end = HandTarget(start + left_m * way, turn)
        yield from move_hand(env.data, end, CLOSED, speed=SPEED, tolerance=NEAR_M, start=start)
