"""Doors that fold down nearly to the floor, shut: lifted at their free edge by the finger tips, then pushed.

The hand points down before the edge and presses its finger tips inwards against the outer corner while it goes up: the
arm does not get below the door. Where there is no room before the door, the robot stands beside it and reaches over.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    base_pose,
    floor_axes,
    frame,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.articulated import LET_DOWN, ContactPath, Shift, Waypoint, plan_contact
from robocasa_lerobot.demos.planning.contact_paths import arc_waypoints, push_path
from robocasa_lerobot.demos.planning.follow import Following, follow_joint_path
from robocasa_lerobot.demos.skills.arc_motion import follow_arc, spots, take_stance, working_height
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart, StallDetector
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.demos.skills.doors import SHUT_GOAL, doors
from robocasa_lerobot.demos.skills.drop_down_doors import stances_beside
from robocasa_lerobot.demos.skills.force_servo import ForceServo
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 6
FORWARDS = np.array([0.0, -1.0, 0.0])  # to the room, in the fixture's axes: outwards for a door that is shut
LIFTED_RAD = 0.45  # from which on the hand rises no more, so that its tips come to push the face
LAST_LEAN = 45.0  # inwards, when it is shut, degrees
ENOUGH_RAD = 0.45  # up to which the face can be pushed at once
# Of a hand that points down: lean inwards and to the right, degrees.
LIFTS = ((25, 0), (15, 0), (35, 0), (15, 25), (15, -25), (15, 45), (15, -45))
# Of the hand: turn from inwards to the right and pitch downwards, degrees.
PUSHES = ((0, 20), (0, 0), (30, 10), (-30, 10), (0, 45))
XS = (0.0, 0.5, -0.5, 0.8, -0.8)  # shares of half of the door's width, from its middle to the right
TIP_M = 0.008  # of the grip site past the corner that is lifted
OFF_M, BACK_M = 0.02, 0.10
PRESS_M = 0.06  # that the hand is led beyond the corner at the beginning: the edge must not slip off the fingers
DASH = Following(spacing_m=0.2, per_m=0.0, per_rad_m=1.0, near_m=0.08, near_rad=0.4, most_steps=8)
RETREAT: Shift = (-0.15, 0.0)
WEDGED_STEPS = 10  # without movement
SLIPPED = 0.5  # cost of a lift from which the edge has slipped off
# Lean of the hand, share of half the door's width, and which of its flat sides is to the right.
Lift = tuple[tuple[float, float], float, float]


def lift_low(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Lift a door that lies low at its free edge, from before it or from beside it, and push it shut.

    Raises:
        SkillError: it is not shut after six attempts.
    """
    for door in doors(env, stage):
        slipped: list[Lift] = []
        for attempt in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            try:
                yield from _push(env, door, slipped)
            except SkillError:
                if attempt == ATTEMPTS - 1:
                    raise
                yield from _dash(env, np.array(env.robot.home.arm))
                yield from shift_base(env, RETREAT, CLOSED)  # from elsewhere other places are reached
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def _push(env: KitchenEnv, door: ArticulatedPart, slipped: list[Lift]) -> Iterator[Array]:
    """Push the door shut: at its edge while it lies low, else at its face.

    A lift from which the edge slips off is noted in `slipped`, and is the last choice from then on.
    """
    data = env.data
    lifts = [(lift, x, roll) for lift in LIFTS for x in XS for roll in (1, -1)]
    low = door.angle > ENOUGH_RAD
    if low:
        paths = [_lift_path(env.robot.gripper, door, lift, bias=SLIPPED * (lift in slipped)) for lift in lifts]
        plan = plan_contact(env, door, paths, _stances(env, door), bends=LET_DOWN)
    else:
        paths = [_push_path(env, door, push, roll) for push in PUSHES for roll in (1, -1)]
        plan = plan_contact(env, door, paths, stances_beside(env, door))
    spot = spots(env, plan)
    yield from take_stance(env, plan, CLOSED)
    yield from _dash(env, plan.joints)
    back, off = plan.path.waypoints[0].target, plan.path.waypoints[1].target
    yield from move_hand(data, back, CLOSED, tolerance=0.02, max_steps=30)
    exact = 0.004 if low else 0.015  # a face is met anywhere
    yield from move_hand(data, off, CLOSED, tolerance=exact, max_steps=40, integral_gain=0.12)
    goal, headway = SHUT_GOAL * door.full, StallDetector(door, -1.0)

    def wedged() -> bool:
        # Between the edge and the counter: the face is pushed instead.
        headway.ends()
        return low and door.angle < ENOUGH_RAD and headway.since >= WEDGED_STEPS

    yield from follow_arc(env, door, plan, goal, gripper=CLOSED, spot=spot, lead_rad=0.0, firm=True, until=wedged)
    away = HandTarget(grip_position(data) - 0.16 * door.inwards, hand_rotation(data))
    yield from move_hand(data, away, CLOSED, tolerance=0.04, max_steps=20)
    if low and door.angle > ENOUGH_RAD:
        slipped.append(lifts[paths.index(plan.path)])


def _dash(env: KitchenEnv, joints: Array) -> Iterator[Array]:
    """Move the hand fast as it goes when all joints turn evenly to some angles: straight paths end in joint limits."""
    yield from follow_joint_path(env, joints, CLOSED, DASH, ForceServo(env.data).action)


def _stances(env: KitchenEnv, door: ArticulatedPart) -> tuple[tuple[Shift, Shift], ...]:
    """Moves of the base, before and by the end: before the free edge, then beside it; the base goes along inwards."""
    shape = env.robot.shape
    base, yaw = base_pose(env.data)
    axes = floor_axes(yaw)
    hinge = door.point(np.zeros(3), 0.0)
    out = door.high[2] * np.sin(door.angle)

    def shift(x: float, y: float) -> Shift:
        ahead, left = axes @ (hinge + x * door.rightwards + y * door.inwards - base)
        return float(ahead), float(left)

    near = float(np.sign((base - hinge) @ door.rightwards)) or 1.0
    found = []
    for before in (0.20, 0.26, 0.14):
        for aside in (0.15, 0.0, 0.3, 0.45, -0.15):
            y = -out - shape.base_x[1] - before
            found.append((shift(near * aside, y), shift(near * aside, max(y, -0.60))))
    for side in (near, -near):
        for gap in (0.04, 0.10):
            for y in (-out, -out - 0.2, -out + 0.1, -out + 0.2):
                x = side * (door.high[0] + shape.base_y[1] + gap)
                found.append((shift(x, y), shift(x, max(y, -0.35))))
    return tuple(found)


def _lift_path(gripper: GripperGeometry, door: ArticulatedPart, lift: Lift, *, bias: float = 0.0) -> ContactPath:
    """At the free edge.

    The inward side of the fingers bears on the edge's outer corner, their tips just below it.
    """
    (inwards, rightwards), x, roll = lift
    start = door.angle
    local = np.array([x * door.high[0], door.low[1], door.high[2]])
    highest = door.point(local, LIFTED_RAD)[2]
    aside = np.tan(np.deg2rad(rightwards)) * door.rightwards

    def target_at(angle: float, press: float = PRESS_M) -> HandTarget:
        share = float(np.clip(angle / LIFTED_RAD, 0.0, 1.0))
        lean = np.deg2rad(share * inwards + (1.0 - share) * LAST_LEAN)
        rotation = frame(np.tan(lean) * door.inwards + aside - UP, roll * door.rightwards)
        side = roll * rotation[:, 0]
        corner = door.point(local, angle)
        corner[2] = min(corner[2], highest)
        beyond = press * angle / start - gripper.closed_half[0]
        return HandTarget(corner + beyond * side + TIP_M * rotation[:, 2], rotation)

    at = target_at(start, 0.0)
    off = HandTarget(at.position - OFF_M * door.inwards, at.rotation)
    back = HandTarget(off.position - BACK_M * at.rotation[:, 2], at.rotation)
    arc = arc_waypoints(start, SHUT_GOAL * door.full, lambda angle: target_at(angle, 0.0), (0.0, 0.5, 1.0))
    return ContactPath((Waypoint(start, back), Waypoint(start, off), *arc), 2, target_at, bias)


def _push_path(env: KitchenEnv, door: ArticulatedPart, push: tuple[float, float], roll: float) -> ContactPath:
    """On the face, below the handle."""
    turn, pitch = np.deg2rad(push)
    low, _ = door.handle()
    z = working_height(env, door, 0.4 * door.high[2], low[2] - 0.08)
    base, _ = base_pose(env.data)
    x = float(np.clip((base - door.point(np.zeros(3), 0.0)) @ door.rightwards, 0.6 * door.low[0], 0.6 * door.high[0]))
    level = np.cos(turn) * door.inwards + np.sin(turn) * door.rightwards
    rotation = frame(np.cos(pitch) * level - np.sin(pitch) * UP, roll * np.cross(level, UP))
    local = np.array([x, door.low[1], z])
    return push_path(
        env.robot.gripper, door, local, FORWARDS, lambda _: rotation, SHUT_GOAL * door.full, off_m=0.03, back_m=0.05
    )
