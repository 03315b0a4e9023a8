"""Stir in a vessel with a long tool: its working end down in it, led round, so that it takes along what lies there."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, arm_action, grip_position, rotation_about
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.skills.common import SkillError, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.by_handle import TOOL_BY_THE_HANDLE, WorkingEnd, working_end
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, contents_of, graspable
from robocasa_lerobot.demos.skills.pick_place.tools.brought import bring
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.drawn import PlacedObject
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS, ROUNDS = 3, 8
RADII = (0.50, 0.65, 0.40, 0.58)  # shares of the room, from the middle
ROUND_RAD = 8.0  # how far round before it turns back
AHEAD_RAD, STILL_RAD, STILL_STEPS = 0.45, 0.01, 16  # of the tip; it turns back where it makes no headway
DIRECTIONS = 12
TILTS = tuple(float(np.deg2rad(tilt)) for tilt in (0.0, 15.0, 30.0, 45.0, 58.0))  # of the tool from the vertical
SPINS = tuple(float(np.deg2rad(spin)) for spin in (0.0, 90.0, 180.0, 270.0))  # of the tool about its own axis
TILT_COST, LOW_COST = 0.15, 20.0  # for a radian; for a metre that the grip is lower over the rim than it should be
RIM_ROOM_M = 0.055  # of the grip over the rim
OVER_M, FLOOR_M, WALL_M = 0.06, 0.012, 0.018  # of the tip: over the rim as it comes, over the floor, from the wall
REACH_SHARE = 0.6  # of the room inside, that the arm must reach to all sides
STEP_M, STEPS_MORE, MOST_AHEAD_M, RISE_M = 0.011, 6, 0.03, 0.05
LOST_M = 0.08  # of the tool's origin in the hand: it has slipped out


def stir(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Move what is in the stage's target, an object, about with the stage's object, until the stage is done.

    A tool that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    vessel = env.scene.fill(stage.target)
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        yield from bring(env, obj, vessel, TOOL_BY_THE_HANDLE)
        choice = yield from approach(env, partial(_choose, env, obj, vessel), CLOSED, Held.now(env.data, obj.name))
        yield from follow_with(env, choice.joints, Held.now(env.data, obj.name))
        over, inside, *_ = choice.path.targets
        yield from move_hand(env.data, over, CLOSED, tolerance=0.02, max_steps=80)
        yield from move_hand(env.data, inside, CLOSED, speed=0.6, tolerance=0.015, max_steps=50, start=over.position)
        yield from _rounds(env, stage, obj, vessel, inside)
        yield from move_hand(env.data, over, CLOSED, speed=0.7, tolerance=0.03, max_steps=50)
        if stage_done(env, stage):
            return
    raise SkillError(f"{graspable(env, stage.object).title} has stirred in {vessel} in vain {ATTEMPTS} times")


def _rounds(env: KitchenEnv, stage: Stage, obj: Graspable, vessel: str, inside: HandTarget) -> Iterator[Array]:
    """Lead the tip round in the vessel, one way and the other, so that it takes along what lies there."""
    data, end = env.data, working_end(obj)
    held, middle = Held.now(data, obj.name), _floor(env, vessel)  # which stays: the vessel is pushed back there, too

    def over() -> bool:
        slipped = float(np.linalg.norm(Held.now(data, obj.name).position - held.position))
        return slipped > LOST_M or stage_done(env, stage)

    for number in range(ROUNDS):
        share, way = RADII[number % len(RADII)], 1.0 if number % 2 == 0 else -1.0
        start = _at(env, vessel, middle, _gap(env, obj, vessel), share)
        for point in (_tip(env, obj, end) + RISE_M * UP, start + RISE_M * UP, start):
            yield from _lead_tip(env, obj, end, inside, point, over)
        turned, before, still = 0.0, _angle(middle, _tip(env, obj, end)), 0
        while turned < ROUND_RAD and still < STILL_STEPS:
            if over():
                return
            now = _angle(middle, _tip(env, obj, end))
            step = wrap(now - before) * way
            turned, before = turned + step, now
            still = still + 1 if step < STILL_RAD else 0
            yield _towards(env, obj, end, inside, _at(env, vessel, middle, now + way * AHEAD_RAD, share))


def _lead_tip(
    env: KitchenEnv, obj: Graspable, end: WorkingEnd, inside: HandTarget, goal: Array, over: Callable[[], bool]
) -> Iterator[Array]:
    """Lead the tip to a point along a straight line, the hand's rotation kept."""
    begin = _tip(env, obj, end)
    count = int(np.ceil(np.linalg.norm(goal - begin) / STEP_M))
    for step in range(1, count + 1 + STEPS_MORE):
        if over():
            return
        yield _towards(env, obj, end, inside, begin + min(step / max(count, 1), 1.0) * (goal - begin))


def _towards(env: KitchenEnv, obj: Graspable, end: WorkingEnd, inside: HandTarget, point: Array) -> Array:
    """The action that draws the tip to a point as the tool lies in the hand now."""
    ahead = np.clip(point - _tip(env, obj, end), -MOST_AHEAD_M, MOST_AHEAD_M)
    return arm_action(env.data, HandTarget(grip_position(env.data) + ahead, inside.rotation), CLOSED)


def _angle(middle: Array, point: Array) -> float:
    """The bearing of a point from a middle, radians."""
    away = point - middle
    return float(np.arctan2(away[1], away[0]))


def _at(env: KitchenEnv, vessel: str, middle: Array, angle: float, share: float) -> Array:
    """A point low in a vessel, at a bearing and a share of the room from a middle of its floor."""
    room = share * (float(min(_interior(env.scene.objects[vessel])[1][:2])) * np.sqrt(2.0) - WALL_M)
    point: Array = middle + np.array([room * np.cos(angle), room * np.sin(angle), FLOOR_M])
    return point


def _gap(env: KitchenEnv, obj: Graspable, vessel: str) -> float:
    """The bearing in a vessel that is farthest from all that lies there, radians."""
    middle = _floor(env, vessel)
    taken = [_angle(middle, env.data.body(n).xpos) for n in contents_of(env, vessel) if n != obj.name]
    bearings = np.linspace(-np.pi, np.pi, 24, endpoint=False)
    near = [max((float(np.cos(bearing - other)) for other in taken), default=0.0) for bearing in bearings]
    return float(bearings[int(np.argmin(near))])


def _tip(env: KitchenEnv, obj: Graspable, end: WorkingEnd) -> Array:
    body = env.data.body(obj.name)
    tip: Array = body.xpos + body.xmat.reshape(3, 3) @ end.tip
    return tip


def _floor(env: KitchenEnv, vessel: str) -> Array:
    """The middle of a vessel's floor inside, world."""
    body, inside = env.data.body(vessel), _interior(env.scene.objects[vessel])
    floor: Array = body.xpos + body.xmat.reshape(3, 3) @ (inside[0] - np.array([0.0, 0.0, inside[1][2]]))
    return floor


def _interior(placed: PlacedObject) -> tuple[Array, Array]:
    """Centre and half extents of a vessel's inside, in its own axes."""
    inside = placed.item.interior
    if inside is None:
        raise SkillError(f"{placed.name} has no inside to stir in")
    return np.array(inside.center), np.array(inside.half)


def _choose(env: KitchenEnv, obj: Graspable, vessel: str, blocked: Sequence[RobotPose]) -> MotionPlan:
    """How the tool stands in the vessel with its tip on the middle of the floor, best for the arm."""
    _, half = _interior(env.scene.objects[vessel])
    floor = _floor(env, vessel)
    side = REACH_SHARE * float(min(half[:2]))
    return plan_tip(
        env, obj, floor + FLOOR_M * UP, float(floor[2] + 2 * half[2]), side, blocked, where=f"into {vessel}"
    )


def plan_tip(
    env: KitchenEnv, obj: Graspable, bottom: Array, rim: float, side: float, blocked: Sequence[RobotPose], *, where: str
) -> MotionPlan:
    """How a held tool stands with its tip at a point, from above the rim of what is round that, best for the arm.

    The robot alone is tested: the tool comes from above the rim, and goes straight down.

    Args:
        env: the kitchen.
        obj: the tool.
        bottom: the point, world, metres.
        rim: height of the rim in the room, metres.
        side: how far the arm must also reach from there to all sides, metres.
        blocked: where the robot cannot stand.
        where: for messages.

    Raises:
        SkillError: there is no such way.
    """
    data, end = env.data, working_end(obj)
    held = Held.now(data, obj.name)
    # The tool as it stands with its axis up, then leant over, then turned about the vertical.
    upright = _turn_to_up(end.axis)
    paths = []
    for tilt, spin, index in itertools.product(TILTS, SPINS, range(DIRECTIONS)):
        if tilt == 0.0 and index * 4 >= DIRECTIONS:
            continue
        about = rotation_about(UP, 2 * np.pi * index / DIRECTIONS)
        turn = about @ rotation_about(np.array([0.0, 1.0, 0.0]), tilt) @ rotation_about(UP, spin) @ upright
        rotation = turn @ held.rotation.T
        at = bottom - turn @ end.tip - rotation @ held.position
        low = max(rim + RIM_ROOM_M - float(at[2]), 0.0)
        cost = TILT_COST * tilt + LOW_COST * low
        over = at + (rim - bottom[2] + FLOOR_M + OVER_M) * UP
        around = (at + side * np.array([x, y, 0.0]) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)))
        paths.append(WaypointPath(tuple(HandTarget(p, rotation) for p in (over, at, *around)), cost))
    found = plan_reach(env, paths, bottom, key=1, allowed=obj.bodies | obj.carried, blocked=blocked)
    if not found:
        raise SkillError(f"{obj.title}: there is no way {where}")
    return found[0]


def _turn_to_up(axis: Array) -> Array:
    """A rotation that brings a direction of the object straight up."""
    across = np.cross(axis, UP)
    sine = float(np.linalg.norm(across))
    if sine < 1e-6:
        return np.eye(3) if axis @ UP > 0 else rotation_about(np.array([1.0, 0.0, 0.0]), np.pi)
    return rotation_about(across / sine, float(np.arctan2(sine, axis @ UP)))
