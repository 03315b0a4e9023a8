"""Wipe a surface with what is in the hand: pressed onto it, to and fro in lanes, then let go."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.carrying.level import levelled
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.pick import INTEGRAL_GAIN, is_held
from robocasa_lerobot.demos.skills.pick_place.place import RELEASE_STEPS, leave
from robocasa_lerobot.demos.skills.pick_place.tools.brought import bring
from robocasa_lerobot.demos.skills.pick_place.tools.surfaces import Surface, surface_of
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
YAWS = 8
ABOVE_M, OVER_M = 0.12, 0.02  # of the path in, and of the tool over the surface before it comes down on it
PRESS_M = 0.004  # of the tool's underside below the surface, as the hand is told
STROKE_M, EDGE_M = 0.16, 0.015  # of a stroke at most; what of the tool's middle stays within the surface's edge
LANES = (0.0, 0.03, -0.03)  # beside the first one, which goes through the middle
TURN_COST, SHORT_COST = 0.08, 4.0  # for each radian, and for each metre less of a stroke
STEP_M = 0.012  # of the hand along a stroke in a control step, which it follows behind
LIFTED_M = 0.10


def wipe(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Rub the stage's object over its target until enough is done; then let it go.

    The target is an object, wiped on its top or, a vessel, inside; a sink, or a counter where the tool lay on it.

    An object that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    target = env.scene.fill(stage.target)
    lay = env.data.body(env.scene.fill(stage.object)).xpos.copy()
    for attempt in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        surface = surface_of(env, target, lay)
        yield from bring(env, obj, (surface.middle, surface.fixture), ANY_APPROACH)
        choice = yield from approach(env, partial(_choose, env, obj, surface), CLOSED, Held.now(env.data, obj.name))
        yield from follow_with(env, choice.joints, Held.now(env.data, obj.name))
        yield from _rub(env, obj, *choice.path.targets, lane_first=attempt)
        at = HandTarget(grip_position(env.data), hand_rotation(env.data))
        yield from hold_hand(env.data, at, OPEN, RELEASE_STEPS)
        yield from move_hand(env.data, HandTarget(at.position + LIFTED_M * UP, at.rotation), OPEN, tolerance=0.03)
        yield from leave(env, obj)
        if stage_done(env, stage):
            return
    raise SkillError(
        f"{graspable(env, stage.object).title} has not rubbed enough of {surface.title} in {ATTEMPTS} attempts"
    )


def _rub(
    env: KitchenEnv, obj: Graspable, above: HandTarget, start: HandTarget, end: HandTarget, *, lane_first: int
) -> Iterator[Array]:
    """Down onto the surface, along the stroke, back beside it, and so on; one that is lost ends it."""
    data = env.data
    along = end.position - start.position
    aside = np.cross(UP, along / np.linalg.norm(along))
    yield from move_hand(data, above, CLOSED, tolerance=0.03, max_steps=60)
    over = HandTarget(start.position + OVER_M * UP, start.rotation)
    yield from move_hand(data, over, CLOSED, tolerance=0.015, max_steps=50)
    yield from move_hand(data, start, CLOSED, speed=0.5, tolerance=0.004, max_steps=25, integral_gain=INTEGRAL_GAIN)
    ends = (start.position, end.position)
    count = int(np.ceil(np.linalg.norm(along) / STEP_M))
    for index, lane in enumerate(LANES):
        here, there = ends if index % 2 == 0 else ends[::-1]
        for share in np.arange(1, count + 1) / count:
            if not is_held(env, obj.name):
                return
            point = here + share * (there - here) + (lane + 0.01 * lane_first) * aside
            yield from hold_hand(data, HandTarget(point, start.rotation), CLOSED, 1)
        yield from move_hand(data, HandTarget(point, start.rotation), CLOSED, speed=0.4, tolerance=0.012, max_steps=15)


def _choose(env: KitchenEnv, obj: Graspable, surface: Surface, blocked: Sequence[RobotPose]) -> MotionPlan:
    """The stroke along one of the surface's sides that the arm takes best, the tool level and turned in any way.

    Raises:
        SkillError: there is none.
    """
    data = env.data
    held = Held.now(data, obj.name)
    axes, top = surface.axes, surface.middle
    level = levelled(data.body(obj.name).xmat.reshape(3, 3))
    paths = []
    for axis, sign, index in itertools.product((0, 1), (1.0, -1.0), range(YAWS)):
        yaw = 2 * np.pi * index / YAWS
        turn = rotation_about(UP, yaw) @ level
        rotation = turn @ held.rotation.T
        length = min(STROKE_M, surface.size[axis] - 2 * EDGE_M)
        underside = (obj.below(turn) - PRESS_M) * UP
        low, high = (
            top + way * sign * length / 2 * axes[axis] + underside - rotation @ held.position for way in (-1.0, 1.0)
        )
        cost = TURN_COST * min(yaw, 2 * np.pi - yaw) + SHORT_COST * (STROKE_M - length)
        row = (low + ABOVE_M * UP, low, high)
        paths.append(WaypointPath(tuple(HandTarget(point, rotation) for point in row), cost))
    allowed = obj.bodies | surface.bodies
    found = plan_reach(env, paths, top, key=1, held=held, loaded=3, allowed=allowed, blocked=blocked)
    if not found:
        raise SkillError(f"{obj.title}: there is no way over {surface.title}")
    return found[0]
