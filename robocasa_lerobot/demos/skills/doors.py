"""Doors of a stage's fixture; lids, pushed shut from above."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, frame, rotation_about
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import plan_near
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart, push_around
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, move_hand
from robocasa_lerobot.demos.skills.levers import SHIFTS
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
HOVER_M = 0.06
TOUCH_M = 0.004  # of the finger tips from the lid, where planned: they push on from there
LEANS = (0.5, 1.0, 2.0, 5.0)  # inwards, for each metre down
TURNS_RAD = tuple(np.deg2rad((0.0, 35.0, -35.0)).tolist())
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
    local = np.array([0.0, 0.8 * far, lid.high[2]])
    gripper, allowed = env.robot.gripper, frozenset({lid.body})
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        rows = [_lid_row(lid, local, rotation, gripper) for rotation in _leaning(lid)]
        plan = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
        over, rotation = plan.targets[0], plan.targets[-1].rotation
        tried.append(rotation)
        yield from shift_base(env, plan.shift, CLOSED)
        yield from follow_joint_path(env, plan.joints, CLOSED)
        yield from move_hand(data, over, CLOSED, tolerance=0.03)
        yield from push_around(lid, data, local, SHUT_GOAL, _kept(rotation))
        if lid.share <= SHUT_GOAL:
            return
        yield from draw_back(data, CLOSED, 0.12)
    raise SkillError(f"{lid.name} is still {lid.share:.1%} open after {ATTEMPTS} attempts")


def _kept(rotation: Array) -> Callable[[float], Array]:
    return lambda _: rotation


def _leaning(lid: ArticulatedPart) -> list[Array]:
    """Rotations of the hand that pushes a lid down: from steep to level, since wall cabinets are low over the arm."""
    out = []
    for turn in TURNS_RAD:
        around = rotation_about(UP, turn)
        ahead, right = around @ lid.inwards, around @ lid.rightwards
        out += [frame(lean * ahead - UP, side) for lean in LEANS for side in (right, -right)]
    return out


def _lid_row(lid: ArticulatedPart, local: Array, rotation: Array, gripper: GripperGeometry) -> tuple[HandTarget, ...]:
    """Before the lid as it stands, at it, half way, and at the end of the push."""
    row = []
    for share, apart in ((1.0, HOVER_M), (1.0, TOUCH_M), (0.5, TOUCH_M), (0.0, TOUCH_M)):
        angle = lid.angle * share
        normal = lid.turned(angle) @ UP
        reach = gripper.closed_reach(rotation, normal) + apart
        row.append(HandTarget(lid.point(local, angle) + reach * normal, rotation))
    return tuple(row)
