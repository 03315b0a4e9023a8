"""Hold an object, kept level, where its stage's condition can come about, and stay there until it has: under water."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    arm_action,
    base_pose,
    floor_axes,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import HOLD_SPEED, SkillError, move_hand, stage_done, wait_for_stage
from robocasa_lerobot.demos.skills.pick_place.carrying.carry import carry_to, in_reach, standing_pose_for
from robocasa_lerobot.demos.skills.pick_place.carrying.level import levelled
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH, entry, steep
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable, half_length
from robocasa_lerobot.demos.skills.pick_place.pick import INTEGRAL_GAIN, is_held
from robocasa_lerobot.demos.skills.pick_place.verbs import take
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.predicates import UnderWater
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
PATIENCE_STEPS = 30  # without headway, before the object is held elsewhere
YAWS = 12
ENTRIES, IN_M = ("up", "across", "out"), 0.22
# Under a stream: of the highest object below the spout's tip, with costs; shares of half the length beside the stream.
BELOW_M = ((0.03, 0.0), (0.06, 0.02), (0.10, 0.05), (0.15, 0.1))
ASIDE_SHARES, ASIDE_COST = (0.0, 0.5), 0.3
# How far what nothing lies in leans with the hand, so that this reaches under a spout from before it; with costs.
LEANS_RAD = tuple((float(np.deg2rad(angle)), cost) for angle, cost in ((0.0, 0.0), (35.0, 0.1), (65.0, 0.2)))
AGAIN, AGAIN_M = 0.5, 0.03  # cost of a hand that goes where it went without success, as near as this
MOST_SLIP_M = 0.04


@dataclass(frozen=True)
class HoldPose:
    """Where a point of the held object is to be.

    Attributes:
        point: world, metres.
        local: the same point in the held object's axes, from its origin, metres.
        extra: cost.
    """

    point: Array
    local: Array
    extra: float = 0.0


def hold_object(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Bring the stage's object to where the stage's condition can hold, and stay until it does.

    An object that is not in the hand is picked up first; what lies in it comes along.

    Raises:
        SkillError: the condition does not hold after all attempts, or says nothing of where the object is to be.
    """
    failed: list[Array] = []
    for _ in range(ATTEMPTS):
        obj = graspable(env, stage.object)
        if not is_held(env, obj.name):
            yield from take(env, obj, ANY_APPROACH)
            obj = graspable(env, stage.object)
        yield from _bring(env, stage, obj)
        choice = _choose(env, stage, obj, failed)
        if choice.base is not None:
            yield from carry_to(env, obj, choice.base)
            choice = _choose(env, stage, obj, failed, may_drive=False)
        failed.append(choice.path.targets[1].position)
        yield from follow_with(env, choice.joints, Held.now(env.data, obj.name, obj.contents))
        yield from _stay(env, stage, obj, *choice.path.targets)
        if stage_done(env, stage):
            return
    raise SkillError(f"{graspable(env, stage.object).title} was held in vain {ATTEMPTS} times")


def _stay(env: KitchenEnv, stage: Stage, obj: Graspable, far: HandTarget, at: HandTarget) -> Iterator[Array]:
    """Move in along a straight line and stand still until the condition holds, or nothing comes of it."""
    data, held = env.data, Held.now(env.data, obj.name)

    def done() -> bool:
        return stage_done(env, stage)

    line = None if steep(far, at) else far.position
    yield from move_hand(data, far, CLOSED, tolerance=0.03, max_steps=60, until=done)
    yield from move_hand(
        data, at, CLOSED, speed=0.7, tolerance=0.01, max_steps=80, integral_gain=INTEGRAL_GAIN, start=line, until=done
    )
    # What has slipped in the hand goes to where it was meant to be, not the hand.
    slipped = at.rotation @ (held.position - Held.now(data, obj.name).position)
    at = HandTarget(at.position + np.clip(slipped, -MOST_SLIP_M, MOST_SLIP_M), at.rotation)
    yield from wait_for_stage(env, stage, lambda: arm_action(data, at, CLOSED, speed=HOLD_SPEED), PATIENCE_STEPS)


def _bring(env: KitchenEnv, stage: Stage, obj: Graspable) -> Iterator[Array]:
    """Carry the held object to before where it is to be held, where that is out of reach."""
    middle = np.mean([pose.point for pose in hold_poses(env, stage, obj)], axis=0)
    if not in_reach(env, middle):
        yield from carry_to(env, obj, standing_pose_for(env, env.scene.fixture(stage.target), middle))


def hold_poses(env: KitchenEnv, stage: Stage, obj: Graspable) -> list[HoldPose]:
    """Where the stage's condition can hold of an object in the hand, or of what lies in it.

    Raises:
        SkillError: the condition says nothing of where either is to be.
    """
    names = (obj.name, *obj.contents)
    found: list[HoldPose] = []
    for term in every_goal_in(stage_condition(env.declaration, stage)):
        if isinstance(term, UnderWater) and env.scene.fill(term.object) in names:
            found += _under_stream(env, obj, env.scene.fixture(term.fixture, Sink), env.scene.fill(term.object))
    if not found:
        raise SkillError(f"{obj.title}: nothing that is in the hand belongs anywhere by the stage's condition")
    return found


def _under_stream(env: KitchenEnv, obj: Graspable, sink: Sink, washed: str) -> list[HoldPose]:
    """Under the spout, all of the held object below its tip; the stream falls onto the middle, or near it."""
    data = env.data
    body = data.body(obj.name)
    turn = body.xmat.reshape(3, 3)
    local = turn.T @ (middle_of(env.scene, data, washed) - body.xpos)
    upright = levelled(turn)
    above = _top(env, obj) - float((upright @ local)[2])  # from the point to the highest of it
    tip, reach = data.site(f"{sink.name}_water").xpos, half_length(env, washed)
    _, yaw = base_pose(data)
    ahead, left = floor_axes(yaw)
    poses = []
    for (below, extra), share, way in itertools.product(BELOW_M, ASIDE_SHARES, (-ahead, ahead, left, -left)):
        if share == 0.0 and way is not ahead:
            continue
        point = tip + share * reach * way - (above + below) * UP
        poses.append(HoldPose(point, local, extra + ASIDE_COST * share * (1.0 if way @ ahead <= 0 else 2.0)))
    return poses


def _top(env: KitchenEnv, obj: Graspable) -> float:
    """Height of the highest point of an object and its contents over its origin when it is level, metres."""
    body = env.data.body(obj.name)
    turn = body.xmat.reshape(3, 3)
    points = [obj.cloud @ levelled(turn).T]
    for name in obj.contents:
        other, cloud = env.data.body(name), graspable(env, name).cloud
        inside = (cloud @ other.xmat.reshape(3, 3).T + other.xpos - body.xpos) @ turn
        points.append(inside @ levelled(turn).T)
    return float(np.concatenate(points)[:, 2].max())


def _choose(
    env: KitchenEnv, stage: Stage, obj: Graspable, failed: list[Array], *, may_drive: bool = True
) -> MotionPlan:
    """The path in that the arm takes best, in all directions that the object may be turned to, and leant.

    Raises:
        SkillError: there is none.
    """
    data = env.data
    held = Held.now(data, obj.name, obj.contents)
    level = levelled(data.body(obj.name).xmat.reshape(3, 3))
    poses = hold_poses(env, stage, obj)
    paths = []
    _, left = floor_axes(base_pose(data)[1])
    for pose, index, (lean, less) in itertools.product(
        poses, range(YAWS), LEANS_RAD[:1] if obj.contents else LEANS_RAD
    ):
        yaw = 2 * np.pi * index / YAWS
        upright = rotation_about(UP, yaw) @ level
        turn = rotation_about(-left, lean) @ upright  # a hand that looks down looks ahead then
        higher = float((obj.cloud @ turn[2]).max() - turn[2] @ pose.local)
        higher -= float((obj.cloud @ upright[2]).max() - upright[2] @ pose.local)
        rotation = turn @ held.rotation.T
        at = pose.point - higher * UP - turn @ pose.local - rotation @ held.position
        again = sum(np.linalg.norm(at - other) < AGAIN_M for other in failed)
        cost = pose.extra + less + AGAIN * float(again) + 0.08 * min(yaw, 2 * np.pi - yaw)
        for name in ENTRIES:
            far = at + IN_M * entry(env, name)
            paths.append(WaypointPath((HandTarget(far, rotation), HandTarget(at, rotation)), cost))
    middle = np.mean([pose.point for pose in poses], axis=0)
    found = plan_reach(
        env, paths, middle, key=1, held=held, loaded=2, allowed=obj.bodies | obj.carried, may_drive=may_drive
    )  # fmt: skip
    if not found:
        raise SkillError(f"{obj.title}: there is no path to where it is to be held")
    return found[0]
