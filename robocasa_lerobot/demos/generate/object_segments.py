"""Segments about objects: taken hold of as in a source where the new object can be grasped, put down as there.

A grasp of the source is brought to the nearest place where the gripper fits the object that is there now; what is put
down goes as the source's object went, by its underside, so that another size or hold makes no difference.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.generate.bridge import bridged
from robocasa_lerobot.demos.generate.course import BRIDGE, DRIVE, Course
from robocasa_lerobot.demos.generate.execute import as_target, carry_out_segment, hand_now
from robocasa_lerobot.demos.generate.lid_places import COVER, LID_VERBS, knob_grasps, lid_strategy, lid_turns
from robocasa_lerobot.demos.generate.segment_paths import (
    STEEP_RAD,
    SegmentPath,
    after_letting_go,
    along,
    cheapest,
    led_ahead,
    poses_at,
)
from robocasa_lerobot.demos.generate.sources.segments import PICK, PLACE
from robocasa_lerobot.demos.generate.sources.source import Piece, pieces_for
from robocasa_lerobot.demos.generate.sources.transform import heading, make_pose
from robocasa_lerobot.demos.generate.sources.uses import RINSE, USES, where_it_lay
from robocasa_lerobot.demos.generate.use_segments import use
from robocasa_lerobot.demos.motion import (
    CLOSED,
    HALF_TURN,
    OPEN,
    UP,
    Array,
    axis_angle,
    base_pose,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, hold_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import move_torso
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH, GraspStrategy
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose, PlaceStrategy, leave
from robocasa_lerobot.demos.skills.pick_place.strategies import grasp_strategy, place_strategy
from robocasa_lerobot.demos.skills.pick_place.tools.rinse import parts_of_rinsing
from robocasa_lerobot.demos.skills.pick_place.verbs import BY_USE, bring, come_to, free_grasp
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, approach, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

TRIES = 5  # of picking up and putting down together
TURNS = tuple(np.deg2rad((0.0, 30.0, -30.0, 60.0, -60.0)))  # of a flatter one, to the sides
MOST_ASKEW_RAD = 0.45  # of a grasp from the source's, beside a turn about the vertical
ASKEW_COST, WORSE_GRASP, TRIED_COST, ALIKE_M = 0.3, 0.45, 1.2, 0.015
MOST_GRASPS, MOST_SPOTS, YAWS = 10, 12, 8
TURN_COST, LEANING_COST, AGAIN_COST, AGAIN_M = 0.08, 0.35, 0.5, 0.03  # a radian of turn, of tilt, ...
RELEASE_STEPS = 8


def object_stage(env: KitchenEnv, stage: Stage, course: Course) -> Iterator[Array]:
    """Take hold of the stage's object, and use it or put it down if the stage says so, with segments of sources.

    Raises:
        SkillError: no source has such segments, none is within reach, or it is not done after all tries.
    """
    if stage.verb == RINSE:
        for part in parts_of_rinsing(env, stage):
            yield from object_stage(env, part, course)
        return
    name = graspable(env, stage.object).name
    if name not in course.rest:
        course.rest[name] = env.data.body(name).xmat.reshape(3, 3).copy()
    tried: list[Array] = []
    put_down: list[Array] = []
    in_vain: dict[int, int] = {}
    for _ in range(TRIES):
        if stage_done(env, stage):
            return
        obj = graspable(env, stage.object)
        if not is_held(env, obj.name):
            yield from _pick(env, stage, obj, course, tried)
            if not is_held(env, obj.name):
                continue
        if stage.verb == "pick":
            return
        if stage.verb in USES:
            yield from use(env, stage, obj, course, in_vain)
        else:
            yield from _place(env, stage, obj, course, put_down)
        for _ in range(15):
            if stage_done(env, stage):
                return
            yield from hold_hand(env.data, as_target(hand_now(env)), CLOSED if is_held(env, obj.name) else OPEN, 1)
    what = "was used in vain" if stage.verb in USES else "is not where it belongs"
    raise SkillError(f"{graspable(env, stage.object).title} {what} after {TRIES} tries")


def _pick(env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, tried: list[Array]) -> Iterator[Array]:
    pieces = course.most_alike(pieces_for(course.sources, stage, PICK), env, stage)
    if not pieces:
        raise SkillError("no source picks anything up")
    strategy = grasp_strategy(env, obj, _free_grasp(env, stage, obj), kept=stage.verb == "pick" or stage.verb in USES)
    if course.manner.base != "fixed":
        yield from course.labelled(come_to(env, obj), DRIVE)
    if strategy.first is not None:
        yield from course.labelled(strategy.first(env), BRIDGE)
    origin = env.data.body(obj.name).xpos.copy()
    ways = _pick_ways(env, obj, strategy, pieces, course, tried, lid=stage.verb in LID_VERBS)
    if not ways:
        raise SkillError(f"{obj.title}: no source's grasp fits it")

    def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
        drives = course.manner.base != "fixed"
        found = plan_reach(env, ways, origin, key=2, allowed=obj.bodies, blocked=blocked, may_drive=drives)
        if not found:
            raise SkillError(f"{obj.title}: no source's grasp is within reach")
        return found[0]

    choice = yield from course.choosing(approach(env, plan, OPEN), DRIVE)
    way = choice.path
    assert isinstance(way, SegmentPath)
    tried.append(way.targets[2].position - origin)
    yield from course.labelled(bridged(env, course.manner, choice, way.first, OPEN), BRIDGE)
    body = env.data.body(obj.name)
    start, turn = body.xpos.copy(), body.xmat.reshape(3, 3).copy()
    course.lay[obj.name] = where_it_lay(make_pose(start, turn), float(start[2]) - obj.below(turn))
    row = course.begin(way.piece, cost=round(choice.cost, 3))
    yield from carry_out_segment(env, course, along(way, lambda: start - origin))
    row["held"] = is_held(env, obj.name)
    if not row["held"]:
        at = as_target(hand_now(env))
        yield from course.labelled(hold_hand(env.data, at, OPEN, RELEASE_STEPS), BRIDGE)
        yield from course.labelled(draw_back(env.data, OPEN, 0.08), BRIDGE)


def _free_grasp(env: KitchenEnv, stage: Stage, obj: Graspable) -> GraspStrategy:
    """How an object that stands free is grasped best for its stage."""
    if stage.verb in LID_VERBS:
        return ANY_APPROACH
    if stage.verb in USES:
        return BY_USE.get(stage.verb, ANY_APPROACH)
    return free_grasp(env, stage) if stage.verb == "pick" else _strategy(env, stage, obj).grasp


def _pick_ways(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    pieces: list[Piece],
    course: Course,
    tried: list[Array],
    *,
    lid: bool,
) -> list[SegmentPath]:
    """The segments brought to grasps of the object; of a lid, of its knob."""
    _, yaw = base_pose(env.data)
    known: dict[tuple[float, ...], list[GraspPose]] = {}
    ways: list[SegmentPath] = []
    for piece in pieces:
        segment, data = piece.segment, piece.data
        source = data.eef[segment.contact][:3, :3]
        tilt = float(np.arccos(np.clip(-source[2, 2], -1.0, 1.0)))
        for turn in (0.0,) if tilt < STEEP_RAD else dict.fromkeys((*TURNS, *strategy.turns)):
            about = rotation_about(UP, yaw - float(data.base[segment.contact, 2]) + turn)
            comes = -UP if tilt < STEEP_RAD else about @ source[:, 2]
            key = tuple(np.round(comes, 2).tolist())
            if key not in known:
                known[key] = knob_grasps(env, obj, comes) if lid else strategy.poses(env, obj, comes)
            best = max((pose.score for pose in known[key]), default=0.0)
            for pose in known[key][:MOST_GRASPS]:
                again = sum(
                    float(np.linalg.norm(pose.position - env.data.body(obj.name).xpos - other)) < ALIKE_M
                    for other in tried
                )
                extra = WORSE_GRASP * (best - pose.score) + TRIED_COST * again + 0.1 * abs(turn)
                extra += float(course.bias[piece.source.number])
                for rotation in (pose.rotation, pose.rotation @ HALF_TURN):
                    way = _pick_way(piece, pose.position, rotation, extra)
                    if way is not None:
                        ways.append(way)
    return cheapest(env, ways, course)


def _pick_way(piece: Piece, position: Array, rotation: Array, extra: float) -> SegmentPath | None:
    """A segment brought to a grasp; None where that would tip the hand over."""
    segment, data = piece.segment, piece.data
    source = data.eef[segment.contact]
    turn = rotation @ source[:3, :3].T
    level = rotation_about(UP, heading(turn))
    askew = float(np.linalg.norm(axis_angle(turn @ level.T)))
    if askew > MOST_ASKEW_RAD:
        return None

    def here(pose: Array) -> Array:
        return make_pose(position + level @ (pose[:3, 3] - source[:3, 3]), turn @ pose[:3, :3])

    def hand(step: int) -> Array:
        return here(data.eef[step])

    lead, contact = segment.lead, segment.contact
    chosen = poses_at(piece, hand, (lead, lead + (contact - lead) // 2, contact, segment.end))
    extra += ASKEW_COST * askew
    return SegmentPath(chosen, extra, piece=piece, hand=hand, target=lambda step: here(data.target[step]))


def _place(env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, put_down: list[Array]) -> Iterator[Array]:
    pieces = course.most_alike(pieces_for(course.sources, stage, PLACE), env, stage)
    if not pieces:
        raise SkillError("no source puts anything down")
    strategy = _strategy(env, stage, obj)
    if course.manner.base != "fixed":
        yield from course.labelled(bring(env, stage, obj, strategy), DRIVE)
        yield from course.labelled(move_torso(env, 0.0, CLOSED, Held.now(env.data, obj.name, obj.contents)), DRIVE)
    held = Held.now(env.data, obj.name, obj.contents)

    def ways() -> list[SegmentPath]:
        return _place_ways(env, stage, obj, held, strategy, pieces, course, put_down)

    found = ways()
    if not found:
        raise SkillError(f"{obj.title}: nowhere to put it")
    middle = np.mean([way.targets[2].position for way in found], axis=0)
    mine = obj.bodies | obj.carried

    def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
        drives = course.manner.base != "fixed"
        plans = plan_reach(
            env, found, middle, key=2, held=held, loaded=3, allowed=mine, blocked=blocked, may_drive=drives
        )
        if not plans:
            raise SkillError(f"{obj.title}: no source's way to put it down is within reach")
        return plans[0]

    choice = yield from course.choosing(approach(env, plan, CLOSED, held), DRIVE)
    if not is_held(env, obj.name):
        return
    way = choice.path
    assert isinstance(way, SegmentPath)
    yield from course.labelled(bridged(env, course.manner, choice, way.first, CLOSED, held), BRIDGE)
    if not is_held(env, obj.name):
        return
    put_down.append(way.targets[2].position)
    course.begin(way.piece, cost=round(choice.cost, 3))
    yield from carry_out_segment(env, course, replace(along(way), keeps=True))
    if is_held(env, obj.name):
        return
    yield from course.labelled(leave(env, obj), BRIDGE)


def _strategy(env: KitchenEnv, stage: Stage, obj: Graspable) -> PlaceStrategy:
    return lid_strategy(env, stage, obj) if stage.verb in LID_VERBS else place_strategy(env, stage, obj)


def _turns(env: KitchenEnv, stage: Stage, held: Held, rest: Array) -> list[float]:
    """Turns about the vertical, radians, of an object from how it is held now."""
    if stage.verb != COVER:
        return [2 * np.pi * number / YAWS for number in range(YAWS)]
    now = rotation_about(UP, heading(hand_rotation(env.data) @ held.rotation @ rest.T)) @ rest
    return lid_turns(env, stage, heading(now))


def _place_ways(
    env: KitchenEnv,
    stage: Stage,
    obj: Graspable,
    held: Held,
    strategy: PlaceStrategy,
    pieces: list[Piece],
    course: Course,
    put_down: list[Array],
) -> list[SegmentPath]:
    """The segments brought to the places where the object may come to lie, turned about the vertical."""
    _, yaw = base_pose(env.data)
    rest = course.rest[obj.name]
    spots = sorted(strategy.poses(), key=lambda pose: pose.extra)[:MOST_SPOTS]
    ways = []
    present = hand_rotation(env.data)
    turns = _turns(env, stage, held, rest)
    for piece, spot, turn in itertools.product(pieces, spots, turns):
        about = rotation_about(UP, yaw - float(piece.data.base[piece.segment.contact, 2]))
        way = _place_way(obj, held, rest, present, piece, spot, strategy, about, turn)
        again = sum(float(np.linalg.norm(way.targets[2].position - other)) < AGAIN_M for other in put_down)
        extra = way.extra + AGAIN_COST * again + float(course.bias[piece.source.number])
        ways.append(replace(way, extra=extra))
    return cheapest(env, ways, course)


def _place_way(
    obj: Graspable,
    held: Held,
    rest: Array,
    present: Array,
    piece: Piece,
    spot: PlacePose,
    strategy: PlaceStrategy,
    about: Array,
    yaw: float,
) -> SegmentPath:
    """A segment that puts an object down at a spot, turned by `yaw` radians from how it is held now."""
    segment, data = piece.segment, piece.data
    poses, low = data.poses[segment.ref], data.undersides[segment.ref]
    begin = _rest_step(piece)
    upright = rest @ held.rotation.T  # the hand's turn with the object as it lay
    spin = rotation_about(UP, yaw + heading(present @ upright.T))
    lean = lean_of(poses[begin][:3, :3], poses[segment.contact][:3, :3], about)
    turned = spin @ rest
    end = spot.point + strategy.gap_m * UP

    def hand(step: int) -> Array:
        if step > segment.contact:
            return after_letting_go(hand(segment.contact), data.eef[segment.contact], data.eef[step], about)
        turn = about @ poses[step][:3, :3] @ poses[segment.contact][:3, :3].T @ about.T @ lean @ turned
        under = end + about @ (low[step] - low[segment.contact])
        hand_turn = turn @ held.rotation.T
        return make_pose(under + obj.below(turn) * UP - hand_turn @ held.position, hand_turn)

    lead, contact = segment.lead, segment.contact
    steps = (lead, lead + (contact - lead) // 2, contact, contact + 12, segment.end)
    tilt = float(np.arccos(np.clip(lean[2, 2], -1.0, 1.0)))
    cost = spot.extra + TURN_COST * min(yaw, 2 * np.pi - yaw) + LEANING_COST * tilt
    if strategy.fit is not None:
        let = hand(min(contact, segment.end - 1))
        cost += strategy.fit(let[:3, 3] + let[:3, :3] @ held.position, let[:3, :3] @ held.rotation)
    return SegmentPath(
        poses_at(piece, hand, steps),
        cost,
        piece=piece,
        hand=hand,
        target=lambda step: led_ahead(piece, hand(step), about, step),
    )


def lean_of(lay: Array, put: Array, about: Array) -> Array:
    """How far an object leans where it is put down, (3, 3), without its turn about the vertical.

    It leans to the same side of the robot as in the source, wherever it points itself.

    Args:
        lay: (3, 3) as it lay in the source.
        put: (3, 3) as it was put down there.
        about: (3, 3) turn about the vertical from the source's robot to this one.
    """
    change = put @ lay.T
    leant: Array = about @ change @ rotation_about(UP, -heading(change)) @ about.T
    return leant


def _rest_step(piece: Piece) -> int:
    """The step at which the object lay as it was found, before it was taken hold of."""
    for one in piece.source.segments:
        if one.kind == PICK and one.ref == piece.segment.ref:
            return one.contact
    return 0
