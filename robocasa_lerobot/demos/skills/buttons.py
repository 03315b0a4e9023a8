"""Buttons: pressed with the closed finger tips, then left alone.

A microwave's stop button is low over the counter and beside the door's handle: there the hand has to come from above
and from the other side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    frame,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import plan_near
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.levers import level_and_down, push_row
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
STANDOFF_M, RETREAT_M = 0.07, 0.20
PRESS_M = 0.012  # deeper than the button goes: the servo's goal, not where the finger ends
PRESS_SPEED = 0.4
# Of the hand from a front's normal: tilts downwards and turns to both sides, radians. Level hands meet what stands out
# beside a button: a door's handle, for one.
TILTS = tuple(np.deg2rad((0.0, 20.0, 40.0, 55.0, 70.0)))
TURNS = tuple(np.deg2rad((0.0, 25.0, -25.0, 50.0, -50.0)))
SHIFTS = ((0.0, 0.0), (-0.12, 0.0), (-0.25, 0.0), (-0.12, -0.2), (-0.12, 0.2), (-0.4, 0.0), (-0.3, -0.25), (-0.3, 0.25))


def press_button(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Press the stage's part until the task's goal follows, or would but for the hand, and draw back.

    Raises:
        SkillError: the goal does not hold after four attempts.
    """
    data, fixture = env.data, env.scene.fixture(stage.target, Appliance)
    part = env.scene.fill(stage.part)
    body = data.body(f"{fixture.name}_{part}")
    joint = data.joint(fixture.joint(part))
    allowed = frozenset({int(body.id)})
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        inwards = joint.xaxis.copy()
        face = body.xpos.copy() - inwards * fixture.position(data, part)
        if abs(inwards[2]) > 0.7:  # on top
            rows = [push_row(env.robot.gripper, face, inwards, rotation, PRESS_M) for rotation in level_and_down(env)]
        else:
            rows = [_row(env.robot.gripper, face, inwards, rotation) for rotation in rotations(inwards)]
        plan = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
        tried.append(plan.targets[-1].rotation)
        yield from shift_base(env, plan.shift, CLOSED)
        yield from follow_joint_path(env, plan.joints, CLOSED)
        *before, at = plan.targets
        yield from move_hand(data, before[0], CLOSED, tolerance=0.04)
        for target in before[1:]:
            yield from move_hand(data, target, CLOSED, tolerance=0.01)
        pressed = _pressed(env, stage, part)
        yield from move_hand(data, at, CLOSED, speed=PRESS_SPEED, tolerance=0.003, max_steps=50, until=pressed)
        yield from retreat(env, -inwards)
        for _ in range(40):
            if stage_done(env, stage):
                return
            yield from hold_hand(data, HandTarget(grip_position(data), hand_rotation(data)), CLOSED, 1)
    raise SkillError(f"{part} of {fixture.name}: nothing came of {ATTEMPTS} presses")


def rotations(inwards: Array) -> list[Array]:
    """Rotations of the hand that press along `inwards`: tilts and turns, each with four rolls."""
    out = []
    for turn in TURNS:
        level = rotation_about(UP, turn) @ inwards
        left = np.cross(UP, level)
        for tilt in TILTS:
            approach = np.cos(tilt) * level - np.sin(tilt) * UP
            other = np.cross(approach, left)
            out += [frame(approach, opening) for opening in (left, -left, other, -other)]
    return out


def retreat(env: KitchenEnv, outwards: Array) -> Iterator[Array]:
    """Draw the hand back along a direction by more than the goals ask for."""
    data = env.data
    away = HandTarget(grip_position(data) + outwards * RETREAT_M + UP * 0.03, hand_rotation(data))
    yield from move_hand(data, away, CLOSED, tolerance=0.02, max_steps=50)


def _row(gripper: GripperGeometry, face: Array, inwards: Array, rotation: Array) -> tuple[HandTarget, ...]:
    touch = face - inwards * gripper.closed_reach(rotation, inwards)
    return tuple(HandTarget(touch + inwards * deep, rotation) for deep in (-2 * STANDOFF_M, -STANDOFF_M, PRESS_M))


def _pressed(env: KitchenEnv, stage: Stage, part: str) -> Callable[[], bool]:
    """Whether the button is in by most of its travel."""
    fixture = env.scene.fixture(stage.target, Appliance)
    return lambda: fixture.share(env.data, part) > 0.7
