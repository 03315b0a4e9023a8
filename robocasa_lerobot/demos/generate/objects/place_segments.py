"""Putting down an object as in a source, by its underside, so that another size or hold makes no difference."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from robocasa_lerobot.demos.generate.bridge import bridged
from robocasa_lerobot.demos.generate.course import BRIDGE, DRIVE, Course
from robocasa_lerobot.demos.generate.execute import carry_out_segment
from robocasa_lerobot.demos.generate.objects.lid_places import COVER, LID_VERBS, lid_strategy, lid_turns
from robocasa_lerobot.demos.generate.segment_paths import (
    SegmentPath,
    after_letting_go,
    along,
    best_plan,
    cheapest,
    led_ahead,
    poses_at,
)
from robocasa_lerobot.demos.generate.sources.segments import PICK, PLACE
from robocasa_lerobot.demos.generate.sources.source import Piece, pieces_for
from robocasa_lerobot.demos.generate.sources.transform import heading, make_pose
from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    base_pose,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.errors import LostError, SlippedError
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import move_torso
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose, PlaceStrategy, leave
from robocasa_lerobot.demos.skills.pick_place.strategies import place_strategy
from robocasa_lerobot.demos.skills.pick_place.verbs import bring
from robocasa_lerobot.demos.skills.reaching import Held, approach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

MOST_SPOTS, YAWS = 12, 8
TURN_COST, LEANING_COST, AGAIN_COST, AGAIN_M = 0.08, 0.35, 0.5, 0.03  # a radian of turn, of tilt, ...
MOST_SLIP_M = 0.03  # in the fingers, that is made up for


def place_as_shown(
    env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, put_down: list[Array]
) -> Iterator[Array]:
    """Put the held object down where the stage says, with a source's segment; what is blocked on its way is kept.

    Where it is let go is added to `put_down`, and avoided from then on.

    Raises:
        SkillError: no source puts anything down, there is no place, or none is within reach.
        LostError: it fell to the floor.
    """
    pieces = course.most_alike(pieces_for(course.sources, stage, PLACE), env, stage)
    if not pieces:
        raise SkillError("no source puts anything down")
    strategy = place_strategy_of(env, stage, obj)
    if course.manner.base != "fixed":
        try:
            yield from course.labelled(bring(env, stage, obj, strategy), DRIVE)
        except LostError:
            raise
        except SlippedError:
            return  # it is picked up where it lies
        except SkillError:
            pass  # the planner may know a place
        yield from course.labelled(move_torso(env, 0.0, CLOSED, Held.now(env.data, obj.name, obj.contents)), DRIVE)
    held = Held.now(env.data, obj.name, obj.contents)

    ways = _place_ways(env, stage, obj, held, strategy, pieces, course, put_down)
    if not ways:
        raise SkillError(f"{obj.title}: nowhere to put it")
    middle = np.mean([way.targets[2].position for way in ways], axis=0)
    mine = obj.bodies | obj.carried
    lacking = f"{obj.title}: no source's way to put it down is within reach"
    plan = partial(best_plan, env, course, ways, middle, key=2, held=held, loaded=3, allowed=mine, lacking=lacking)
    choice = yield from course.choosing(approach(env, plan, CLOSED, held), DRIVE)
    if not is_held(env, obj.name):
        return
    way = choice.path
    assert isinstance(way, SegmentPath)
    yield from course.labelled(bridged(env, course.manner, choice, way.first, CLOSED, held), BRIDGE)
    if not is_held(env, obj.name):
        return
    put_down.append(way.targets[2].position)
    row = course.begin(way.piece, object=obj.name, cost=round(choice.cost, 3))
    slip = _slip(env, obj, held, way)
    yield from carry_out_segment(env, course, replace(along(way, lambda: slip), keeps=True))
    row["in_vain"] = is_held(env, obj.name)
    if not row["in_vain"]:
        yield from course.labelled(leave(env, obj), BRIDGE)


def _slip(env: KitchenEnv, obj: Graspable, held: Held, way: SegmentPath) -> Array:
    """What the hand must go beside its path (3,), metres, since an object has crept in the fingers on the way there."""
    segment = way.piece.segment
    let_go = way.hand(min(segment.contact, segment.end - 1))
    crept = let_go[:3, :3] @ (held.position - Held.now(env.data, obj.name).position)
    aside: Array = np.clip(crept * [1.0, 1.0, 0.0], -MOST_SLIP_M, MOST_SLIP_M)
    return aside


def place_strategy_of(env: KitchenEnv, stage: Stage, obj: Graspable) -> PlaceStrategy:
    """How an object is put down for a stage: a lid in its own manner."""
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
        drawn = float(course.bias[piece.source.number])
        ways.append(replace(way, extra=way.extra + AGAIN_COST * again + drawn, drawn=drawn))
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
