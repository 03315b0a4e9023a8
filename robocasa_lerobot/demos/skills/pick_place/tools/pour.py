"""Pour what lies in a held vessel onto an object: the vessel's edge over it, then the vessel tilted over that."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    arm_action,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import SkillError, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.by_handle import pan_grasp
from robocasa_lerobot.demos.skills.pick_place.carrying.level import level_out, levelled
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.tools.brought import bring
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
YAWS, EDGES = 12, 16  # turns of the vessel about the vertical; points of its edge that it may be poured over
# How far a vessel is tilted in the end: its wall must slope down more than food sticks to it; with costs.
STEEP_RAD = tuple((float(np.deg2rad(angle)), cost) for angle, cost in ((140.0, 0.0), (120.0, 0.25), (105.0, 0.7)))
CLEARANCES_M = (0.045, 0.08)  # of the vessel's lowest point over the receptacle, with a cost for each metre
HIGH_COST, TURN_COST = 4.0, 0.08
SHORT_SHARE = 0.35  # of the vessel's radius, by which its edge ends short of the middle: what slides off goes on
TILT_STEPS, WAIT_STEPS, SHAKES = 45, 12, 3
SHAKE_M = 0.02
DONE_STEPS = 6  # on end, for which a stage is done before the vessel turns back: what hops in it lies in it again
AGAIN, AGAIN_M = 0.4, 0.03  # cost of a hand that goes where it went without success, as near as this


@dataclass(frozen=True)
class Tilting:
    """How a vessel is tilted: about an axis through a point of its edge.

    Attributes:
        pivot: world, metres.
        axis: unit vector, world.
        angle: radians.
    """

    pivot: Array
    axis: Array
    angle: float

    def after(self, hand: HandTarget, share: float) -> HandTarget:
        """Where the hand is when a share of the angle is done."""
        turn = rotation_about(self.axis, share * self.angle)
        return HandTarget(self.pivot + turn @ (hand.position - self.pivot), turn @ hand.rotation)


def pour(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Empty the stage's object, a vessel, over the stage's target, an object or a sink, and hold it upright again.

    A vessel that is not in the hand is picked up first.

    Raises:
        SkillError: the stage is not done after all attempts, or there is nothing in the vessel any more.
    """
    target = env.scene.fill(stage.target)
    failed: list[Array] = []
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        if not obj.contents:
            raise SkillError(f"{obj.title} is empty, but what was in it is not where it belongs")
        top, fixture = _top(env, target)
        yield from bring(env, obj, target if fixture is None else (top, fixture), pan_grasp(obj), towards_target=True)
        obj = graspable(env, stage.object)
        held = Held.now(env.data, obj.name, obj.contents)
        yield from approach(env, partial(_plan, env, obj, target, failed), CLOSED, held)
        yield from level_out(env, obj)
        choice, tilting = _choose(env, obj, target, failed, may_drive=False)
        held = Held.now(env.data, obj.name, obj.contents)
        yield from follow_with(env, choice.joints, held)
        over, level, *_ = choice.path.targets
        failed.append(level.position)
        yield from move_hand(env.data, over, CLOSED, tolerance=0.03, max_steps=80)
        yield from move_hand(env.data, level, CLOSED, speed=0.6, tolerance=0.015, max_steps=60, start=over.position)
        yield from _tilt(env, stage, level, tilting)
        yield from move_hand(env.data, over, CLOSED, speed=0.7, tolerance=0.03, max_steps=50)
        yield from level_out(env, graspable(env, stage.object))
        if stage_done(env, stage):
            return
    raise SkillError(f"{graspable(env, stage.object).title} was poured out in vain {ATTEMPTS} times")


def _tilt(env: KitchenEnv, stage: Stage, level: HandTarget, tilting: Tilting) -> Iterator[Array]:
    """Tilt slowly, until the stage is done; shake what does not come off; turn back."""
    share, done = 0.0, 0
    for step in range(TILT_STEPS):
        done = done + 1 if stage_done(env, stage) else 0
        if done == DONE_STEPS:
            break
        share = (step + 1) / TILT_STEPS
        yield arm_action(env.data, tilting.after(level, share), CLOSED)
    steep = tilting.after(level, share)
    for step in range(WAIT_STEPS * (1 + SHAKES)):
        if done == DONE_STEPS:
            break
        shaken = SHAKE_M * np.sin(2 * np.pi * step / WAIT_STEPS) if step >= WAIT_STEPS else 0.0
        yield arm_action(env.data, HandTarget(steep.position + shaken * UP, steep.rotation), CLOSED)
        done = done + 1 if stage_done(env, stage) else 0
    for step in range(TILT_STEPS // 2):
        yield arm_action(env.data, tilting.after(level, share * (1 - (step + 1) / (TILT_STEPS // 2))), CLOSED)


def _plan(
    env: KitchenEnv, obj: Graspable, target: str, failed: list[Array], blocked: Sequence[RobotPose]
) -> MotionPlan:
    return _choose(env, obj, target, failed, blocked)[0]


def _top(env: KitchenEnv, target: str) -> tuple[Array, Fixture | None]:
    """Over what is poured, world, metres, and the fixture if it is one; of a sink the middle of the basin's edge."""
    if target in env.scene.objects:
        return env.data.body(target).xpos + UP * env.scene.objects[target].item.size[2] / 2, None
    sink = env.scene.fixture(target, Sink)
    return sink.basin.world(env.data, (0.0, 0.0, sink.basin.half[2])), sink


def _choose(
    env: KitchenEnv,
    obj: Graspable,
    target: str,
    failed: list[Array],
    blocked: Sequence[RobotPose] = (),
    *,
    may_drive: bool = True,
) -> tuple[MotionPlan, Tilting]:
    """The edge, turn and height for pouring that the arm takes best.

    Raises:
        SkillError: there is none.
    """
    data, item = env.data, env.scene.objects[obj.name].item
    held = Held.now(data, obj.name, obj.contents)
    inside = item.interior
    if inside is None:
        raise SkillError(f"{obj.title} is no vessel")
    top, _ = _top(env, target)
    center, half = np.array(inside.center), np.array(inside.half)
    radius = float(min(half[:2])) * np.sqrt(2.0)  # the box is the one that a round inside holds
    rim = center[2] + half[2]
    upright = levelled(data.body(obj.name).xmat.reshape(3, 3))
    found: dict[int, Tilting] = {}
    paths = []
    for index, edge, clearance, (steep, less) in itertools.product(range(YAWS), range(EDGES), CLEARANCES_M, STEEP_RAD):
        yaw = 2 * np.pi * index / YAWS
        turn = rotation_about(UP, yaw) @ upright
        bearing = 2 * np.pi * edge / EDGES
        out = turn @ np.array([np.cos(bearing), np.sin(bearing), 0.0])
        lip = turn @ np.array([center[0] + radius * np.cos(bearing), center[1] + radius * np.sin(bearing), rim])
        pivot = top + (clearance + 0.02) * UP - SHORT_SHARE * radius * out
        rotation = turn @ held.rotation.T
        at = pivot - lip - rotation @ held.position
        level = HandTarget(at, rotation)
        tilting = Tilting(pivot, np.cross(UP, out) / np.linalg.norm(np.cross(UP, out)), steep)
        half_way, end = tilting.after(level, 0.5), tilting.after(level, 1.0)
        again = sum(np.linalg.norm(at - other) < AGAIN_M for other in failed)
        cost = less + HIGH_COST * clearance + TURN_COST * min(yaw, 2 * np.pi - yaw) + AGAIN * float(again)
        path = WaypointPath((HandTarget(at + 0.10 * UP, rotation), level, half_way, end), cost)
        found[id(path)] = tilting
        paths.append(path)
    allowed = obj.bodies | obj.carried
    plans = plan_reach(
        env, paths, top, key=2, held=held, loaded=2, allowed=allowed, blocked=blocked, may_drive=may_drive
    )
    if not plans:
        raise SkillError(f"{obj.title}: there is no way to pour it out over {target}")
    return plans[0], found[id(plans[0].path)]
