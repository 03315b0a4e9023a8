"""Doors of a stage's fixture; lids, pushed shut from above."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    frame,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart, push_around
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
HOVER_M = 0.06
LEAN = 0.5  # inwards, for each metre down
SHUT_GOAL = 0.002  # below the 0.005 that tasks ask for


def doors(env: KitchenEnv, stage: Stage) -> list[ArticulatedPart]:
    """Doors of the stage's fixture, or of the stage's part of it, such as its "freezer"."""
    fixture = env.scene.fixture(stage.target)
    names = fixture.doors_of(env.scene.fill(stage.part))
    return [ArticulatedPart(env.data, fixture, fixture.door_joint(name)) for name in names]


def push_lid(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push a lid over and down.

    Raises:
        SkillError: it is not shut after three attempts.
    """
    data = env.data
    appliance = env.scene.fixture(stage.target, Appliance)
    lid = ArticulatedPart(data, appliance, appliance.joint(stage.part))
    far = lid.high[1] if abs(lid.high[1]) > abs(lid.low[1]) else lid.low[1]

    def rotation(angle: float) -> Array:
        # From above, leaning so that the forearm keeps below wall cabinets.
        return nearer_turn(frame(LEAN * lid.inwards - UP, lid.rightwards), hand_rotation(data))

    for _ in range(ATTEMPTS):
        top = lid.high[2]
        local = np.array([0.0, 0.8 * far, top])
        start = lid.angle
        over = HandTarget(lid.point(local + HOVER_M * UP, start), rotation(start))
        yield from move_hand(data, over, CLOSED, tolerance=0.03)
        yield from push_around(lid, data, local, SHUT_GOAL, rotation)
        if lid.share <= SHUT_GOAL:
            return
        yield from draw_back(data, CLOSED, 0.12)
    raise SkillError(f"{lid.name} is still {lid.share:.1%} open after {ATTEMPTS} attempts")
