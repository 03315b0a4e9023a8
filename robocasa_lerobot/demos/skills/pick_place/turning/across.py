"""What is long and lies across behind a front, where hardly a hand that comes through the front fits round it.

It is held about its middle, or, where that cannot be reached, brought nearer by whatever hold there is; at last, closed
fingers push its farther end on, until the hand can close on both of its sides from in front.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, HALF_TURN, OPEN, UP, Array, HandTarget, frame, rotation_about
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.common import SkillError, close_fingers, move_hand
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import (
    ANY_APPROACH,
    GraspStrategy,
    ahead_of,
    entry,
    in_radians,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, filled
from robocasa_lerobot.demos.skills.pick_place.level_grasps import level_grasps
from robocasa_lerobot.demos.skills.pick_place.location import Location
from robocasa_lerobot.demos.skills.pick_place.pick import HOPELESS, best_grasp
from robocasa_lerobot.demos.skills.reaching import MotionPlan, WaypointPath, approach, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

LONG, ACROSS_COS = 1.25, 0.8  # long by wide; cosine of the long axis and the heading, above which it lies well enough
END_SHARES = (0.75, 0.6)  # of half its length from the middle, where it is pushed
PUSH_SHARES = (1.1, 0.8, 0.5)  # of half its length, how far; with a cost for each share less
LESS_COST = 0.5
TILTS = in_radians((65, 0.0), (78, 0.05), (52, 0.05))
TURNS = tuple(float(np.deg2rad(turn)) for turn in (0.0, 20.0, -20.0))
BEFORE_M, IN_M, RISES_M = 0.03, 0.25, (0.004, 0.012)
HOPELESS_PUSH = 2.5  # cost from which on it is not tried
PUSH_STEPS = 45

# Between the two steep and the two flat ones of any approach: a palm that is level meets the shelf before low objects.
_CABINET_TILTS = in_radians((0, 0.0), (35, 0.1), (42, 0.1), (50, 0.15), (65, 0.2), (88, 0.3))
OUT_OF_CABINET = replace(ANY_APPROACH, tilts=_CABINET_TILTS, narrow=True, poses=level_grasps)
# What is long and lies across has to be held near its middle: its end, which is easier to reach, turns out of the hand.
ACROSS_OUT_OF_CABINET = replace(
    OUT_OF_CABINET, tilts=(_CABINET_TILTS[0], *in_radians((27, 0.1)), *_CABINET_TILTS[1:]), among_tilts=True
)
BEHIND_FRONT_M, MOST_NEARER_M = 0.02, 0.15
MOST_TURNS = 2  # of what lies across behind a front


def between_shelves(env: KitchenEnv, obj: Graspable, place: Location) -> GraspStrategy:
    """How an object is grasped between shelves as it lies."""
    if not lies_across(env, obj):
        return replace(OUT_OF_CABINET, first=turn_first(obj, OUT_OF_CABINET))
    return replace(ACROSS_OUT_OF_CABINET, first=turn_first(obj, ACROSS_OUT_OF_CABINET), nearer=to_front(obj, place))


def to_front(obj: Graspable, place: Location) -> Callable[[KitchenEnv], float] | None:
    """How far an object lies behind where it is easiest to grasp, just behind its region's front, metres."""
    region = place.fixture.regions.get(place.region) if place.fixture is not None else None
    if region is None:
        return None

    def nearer(env: KitchenEnv) -> float:
        body = env.data.body(obj.name)
        points = body.xpos + obj.cloud @ body.xmat.reshape(3, 3).T
        before = float(region.all_local(env.data, points)[:, 1].min()) + region.half[1]
        return float(np.clip(before - BEHIND_FRONT_M, 0.0, MOST_NEARER_M))

    return nearer


def turn_first(obj: Graspable, strategy: GraspStrategy) -> Callable[[KitchenEnv], Iterator[Array]]:
    """Before a grasp through a front: turn what lies across where no grasp is worth a try.

    Where one has failed, another one is tried first: a push takes as long as two grasps.
    """
    left = MOST_TURNS

    def first(env: KitchenEnv) -> Iterator[Array]:
        nonlocal left
        while left and lies_across(env, obj) and _is_hopeless(env, obj, strategy):
            left -= 1
            if not (yield from turn_across(env, obj)):
                break

    return first


def _is_hopeless(env: KitchenEnv, obj: Graspable, strategy: GraspStrategy) -> bool:
    """Whether no grasp is worth a try as an object lies."""
    try:
        return best_grasp(env, obj, strategy).cost > HOPELESS
    except SkillError:
        return True


def turn_across(env: KitchenEnv, obj: Graspable) -> Generator[Array, None, bool]:
    """Push the farther end of an object that lies across; returns whether it does and a push was free."""
    if not lies_across(env, obj) or not _pushes(env, obj):
        return False

    def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
        point = env.data.body(obj.name).xpos.copy()
        plans = plan_reach(env, _pushes(env, obj), point, key=1, allowed=obj.bodies, blocked=blocked)
        if not plans:
            raise SkillError(f"{obj.title} lies across, and no push of it is free")
        return plans[0]

    choice = yield from approach(env, plan, OPEN)
    if choice.cost > HOPELESS_PUSH:
        return False
    data = env.data
    far, before, pushed, away = choice.path.targets
    yield from follow_joint_path(env, choice.joints, CLOSED)
    yield from move_hand(data, far, CLOSED, tolerance=0.03)
    yield from close_fingers(data, far, 0)
    yield from move_hand(data, before, CLOSED, tolerance=0.01, start=far.position)
    yield from move_hand(data, pushed, CLOSED, speed=0.5, tolerance=0.01, max_steps=PUSH_STEPS, start=before.position)
    yield from move_hand(data, before, CLOSED, tolerance=0.03, max_steps=30)
    yield from move_hand(data, away, OPEN, tolerance=0.04, start=before.position)
    return True


def lies_across(env: KitchenEnv, obj: Graspable) -> bool:
    """Whether an object is long and shows a side of its length to the robot."""
    axis, long, wide = long_axis(env, obj)
    return long > LONG * wide and abs(float(axis @ ahead_of(env))) < ACROSS_COS


def long_axis(env: KitchenEnv, obj: Graspable) -> tuple[Array, float, float]:
    """The horizontal direction (3,) across which an object is narrowest, and half its extents along and across that.

    A loaf is longer along its diagonal, across which it is nearly as wide.
    """
    points = (obj.cloud @ env.data.body(obj.name).xmat.reshape(3, 3).T)[:, :2]
    angles = np.linspace(0.0, np.pi, 24, endpoint=False)
    reach = points @ np.array([np.cos(angles), np.sin(angles)])
    half = (reach.max(axis=0) - reach.min(axis=0)) / 2
    best = int(np.argmin(half)) - 12
    return np.array([np.cos(angles[best]), np.sin(angles[best]), 0.0]), float(half[best]), float(half[best - 12])


def _pushes(env: KitchenEnv, obj: Graspable) -> list[WaypointPath]:
    """Paths of the closed hand: to the front of the object's farther end, against it, and out again."""
    body, ahead, gripper = env.data.body(obj.name), ahead_of(env), env.robot.gripper
    turn = body.xmat.reshape(3, 3)
    points = np.concatenate([filled(solid.cloud()) for solid in obj.solids]) @ turn.T + body.xpos
    axis, long, _ = long_axis(env, obj)
    axis = axis if axis @ ahead > 0.0 else -axis
    middle = points.mean(axis=0)
    floor = float(points[:, 2].min())
    found = []
    for share, (tilt, extra), yaw, rise in itertools.product(END_SHARES, TILTS, TURNS, RISES_M):
        end = middle + share * long * axis
        near = points[np.linalg.norm((points - end)[:, :2] @ _across(ahead), axis=-1) < gripper.closed_half[1]]
        if not len(near):
            continue
        front = end + (float((near @ ahead).min()) - float(end @ ahead)) * ahead
        heading = rotation_about(UP, yaw) @ ahead
        z = np.sin(tilt) * heading - np.cos(tilt) * UP
        rotation = frame(z, np.cross(UP, heading))
        height = floor + gripper.tips_below_grip * np.cos(tilt) + gripper.finger_half_width * np.sin(tilt) + rise
        at = np.array([*front[:2], height]) - gripper.tips_below_grip * np.sin(tilt) * heading
        before = at - BEFORE_M * ahead
        for length, name in itertools.product(PUSH_SHARES, ("across", "out")):
            cost = extra + LESS_COST * (PUSH_SHARES[0] - length) + 0.2 * abs(yaw) + 10.0 * rise
            far = before + IN_M * entry(env, name)
            pushed = at + length * long * ahead
            for flip in (rotation, rotation @ HALF_TURN):
                found.append(WaypointPath(tuple(HandTarget(p, flip) for p in (far, before, pushed, far)), cost))
    return found


def _across(ahead: Array) -> Array:
    """(2, 1) along the floor, across a direction."""
    return np.array([[-ahead[1]], [ahead[0]]])
