"""Stir in a vessel with a long tool: its working end down in it, led through what lies there, to and fro."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, HandTarget, arm_action, grip_position, rotation_about
from robocasa_lerobot.demos.skills.common import SkillError, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.by_handle import TOOL_BY_THE_HANDLE, WorkingEnd, working_end
from robocasa_lerobot.demos.skills.pick_place.carrying.carry import carry_to, in_reach, standing_pose_for
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, contents_of, graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.verbs import take
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import ObjectTouches
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.scene.drawn import PlacedObject
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS, STROKES = 3, 14
DIRECTIONS = 12
TILTS = tuple(float(np.deg2rad(tilt)) for tilt in (0.0, 15.0, 30.0, 45.0, 58.0))  # of the tool from the vertical
SPINS = tuple(float(np.deg2rad(spin)) for spin in (0.0, 90.0, 180.0, 270.0))  # of the tool about its own axis
TILT_COST, LOW_COST = 0.15, 20.0  # for a radian; for a metre that the grip is lower over the rim than it should be
RIM_ROOM_M = 0.055  # of the grip over the rim
OVER_M, FLOOR_M, WALL_M = 0.06, 0.012, 0.018  # of the tip: over the rim as it comes, over the floor, from the wall
REACH_SHARE = 0.6  # of the room inside, that the arm must reach to all sides
BEHIND_M = 0.035  # of the tip before it meets what it pushes
STEP_M, STEPS_MORE, LIFT_STEPS = 0.011, 6, 25


def stir(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Move what is in the stage's target, an object, about with the stage's object, until the stage is done.

    A tool that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    vessel = env.scene.fill(stage.target)
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        if not is_held(env, obj.name):
            yield from take(env, obj, TOOL_BY_THE_HANDLE)
        middle = env.data.body(vessel).xpos.copy()
        fixture = locate(env, vessel).fixture
        if fixture is not None and not in_reach(env, middle):
            yield from carry_to(env, obj, standing_pose_for(env, fixture, middle))
        choice = yield from approach(env, partial(_choose, env, obj, vessel), CLOSED, Held.now(env.data, obj.name))
        yield from follow_with(env, choice.joints, Held.now(env.data, obj.name))
        over, inside, *_ = choice.path.targets
        yield from move_hand(env.data, over, CLOSED, tolerance=0.02, max_steps=80)
        yield from move_hand(env.data, inside, CLOSED, speed=0.6, tolerance=0.015, max_steps=50, start=over.position)
        yield from _strokes(env, stage, obj, vessel, inside)
        yield from move_hand(env.data, over, CLOSED, speed=0.7, tolerance=0.03, max_steps=50)
        if stage_done(env, stage):
            return
    raise SkillError(f"{graspable(env, stage.object).title} has stirred in {vessel} in vain {ATTEMPTS} times")


def _strokes(env: KitchenEnv, stage: Stage, obj: Graspable, vessel: str, inside: HandTarget) -> Iterator[Array]:
    """Push what lies in the vessel against each other, in turn from all sides, until the stage is done."""
    data, end, first = env.data, working_end(obj), _wanted(env, stage, obj)
    for number in range(STROKES):
        pushed = sorted((name for name in contents_of(env, vessel) if name != obj.name), key=lambda n: n not in first)
        if not pushed or not is_held(env, obj.name):
            return
        at = data.body(pushed[0]).xpos.copy()
        others = [data.body(name).xpos for name in pushed[1:]]
        to = others[number % len(others)] if others else _floor(env, vessel)
        along = (to - at) * [1.0, 1.0, 0.0]
        along = along / max(float(np.linalg.norm(along)), 1e-6)
        # Not always straight at it: what is pushed beside its middle gives way to the side, and is met there next.
        along = rotation_about(UP, float(np.deg2rad((0.0, 25.0, -25.0, 90.0, 0.0, -90.0, 180.0)[number % 7]))) @ along
        start = _within(env, vessel, at - (BEHIND_M + _radius(env, pushed[0])) * along)
        yield from _lead_tip(env, stage, obj, end, inside, start, lifted=True)
        yield from _lead_tip(env, stage, obj, end, inside, _within(env, vessel, at + 0.3 * along), lifted=False)
        if stage_done(env, stage):
            return


def _lead_tip(
    env: KitchenEnv, stage: Stage, obj: Graspable, end: WorkingEnd, inside: HandTarget, goal: Array, *, lifted: bool
) -> Iterator[Array]:
    """Lead the tip to a point, the hand's rotation kept; `lifted` goes over what lies in between."""
    data = env.data
    start, rise = _tip(env, obj, end), 0.06 * UP if lifted else 0.0 * UP
    points = [start + rise, goal + rise, goal] if lifted else [goal]
    for point in points:
        begin = _tip(env, obj, end)
        count = int(np.ceil(np.linalg.norm(point - begin) / STEP_M))
        for step in range(1, count + 1 + STEPS_MORE):
            if stage_done(env, stage) or not is_held(env, obj.name):
                return
            wanted = begin + min(step / max(count, 1), 1.0) * (point - begin)
            ahead = np.clip(wanted - _tip(env, obj, end), -0.03, 0.03)
            yield arm_action(data, HandTarget(grip_position(data) + ahead, inside.rotation), CLOSED)


def _tip(env: KitchenEnv, obj: Graspable, end: WorkingEnd) -> Array:
    body = env.data.body(obj.name)
    tip: Array = body.xpos + body.xmat.reshape(3, 3) @ end.tip
    return tip


def _wanted(env: KitchenEnv, stage: Stage, obj: Graspable) -> set[str]:
    """What the stage's condition wants the tool to touch."""
    terms = every_goal_in(stage_condition(env.declaration, stage))
    return {
        env.scene.fill(t.what) for t in terms if isinstance(t, ObjectTouches) and env.scene.fill(t.object) == obj.name
    }


def _radius(env: KitchenEnv, name: str) -> float:
    return float(min(env.scene.objects[name].item.size[:2])) / 2


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


def _within(env: KitchenEnv, vessel: str, point: Array) -> Array:
    """The nearest point to another where a tip may be: over the floor, and not at the wall."""
    floor, room = _floor(env, vessel), float(min(_interior(env.scene.objects[vessel])[1][:2])) - WALL_M
    away = (point - floor) * [1.0, 1.0, 0.0]
    far = float(np.linalg.norm(away))
    near: Array = floor + away * min(1.0, room / max(far, 1e-6)) + FLOOR_M * UP
    return near


def _choose(env: KitchenEnv, obj: Graspable, vessel: str, blocked: Sequence[RobotPose]) -> MotionPlan:
    """How the tool stands in the vessel with its tip on the middle of the floor, best for the arm.

    The robot alone is tested: the tool comes from above the rim, and goes straight down.

    Raises:
        SkillError: there is no such way.
    """
    data, end = env.data, working_end(obj)
    held = Held.now(data, obj.name)
    _, half = _interior(env.scene.objects[vessel])
    floor = _floor(env, vessel)
    bottom, rim = floor + FLOOR_M * UP, floor[2] + 2 * half[2]
    side = REACH_SHARE * float(min(half[:2]))
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
        over = at + (rim - floor[2] + OVER_M) * UP
        around = (at + side * np.array([x, y, 0.0]) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)))
        paths.append(WaypointPath(tuple(HandTarget(p, rotation) for p in (over, at, *around)), cost))
    found = plan_reach(env, paths, bottom, key=1, allowed=obj.bodies | obj.carried, blocked=blocked)
    if not found:
        raise SkillError(f"{obj.title}: there is no way into {vessel}")
    return found[0]


def _turn_to_up(axis: Array) -> Array:
    """A rotation that brings a direction of the object straight up."""
    across = np.cross(axis, UP)
    sine = float(np.linalg.norm(across))
    if sine < 1e-6:
        return np.eye(3) if axis @ UP > 0 else rotation_about(np.array([1.0, 0.0, 0.0]), np.pi)
    return rotation_about(across / sine, float(np.arctan2(sine, axis @ UP)))
