"""Segments that use what is in the hand: pour, stir, wipe, hold under water, shake, press, as a source did.

The path of the point that counts is carried over, relative to where it is used; see `sources.uses`. The hand follows
from how the object is held here. The object may be turned about the vertical before, since a bowl may be poured over
any part of its edge: most of all so that the hand is as the source's was.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robocasa_lerobot.demos.generate.bridge import bridged
from robocasa_lerobot.demos.generate.course import BRIDGE, DRIVE, Course
from robocasa_lerobot.demos.generate.execute import carry_out_segment
from robocasa_lerobot.demos.generate.segment_paths import (
    SegmentPath,
    after_letting_go,
    along,
    best_plan,
    cheapest,
    led_ahead,
    poses_at,
)
from robocasa_lerobot.demos.generate.sources.segments import USE, rest_step, use_frames
from robocasa_lerobot.demos.generate.sources.source import Piece, pieces_for
from robocasa_lerobot.demos.generate.sources.transform import heading, make_pose
from robocasa_lerobot.demos.generate.sources.uses import (
    has_heading,
    is_about_itself,
    use_frame,
    use_key,
    working_point,
)
from robocasa_lerobot.demos.motion import CLOSED, UP, Array, base_pose, rotation_about
from robocasa_lerobot.demos.skills.common import SkillError, stage_done
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import touched_by_hand
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.place import leave
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, approach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

SAMPLES = 4  # poses of a use that reach and collisions are judged by, besides where it begins
# Turns of a whole path about where it is used, from how it lay before the source's robot; quarters where it has sides.
ROUND = tuple(float(np.deg2rad(turn)) for turn in (0.0, 30.0, -30.0, 60.0, -60.0, 100.0, -100.0, 180.0))
QUARTERS = tuple(float(np.deg2rad(turn)) for turn in (0.0, 90.0, -90.0, 180.0))
# Turns of the object, from how the hand would be as the source's was; half a turn leaves a gripper as it was.
SPINS = tuple(float(np.deg2rad(turn)) for turn in (0.0, 180.0, 35.0, -35.0, 90.0, -90.0))
TURN_COST, SPIN_COST, TRIED_COST = 0.08, 0.12, 0.6  # of a radian, ...; of a source that came to nothing
TILTS_RAD = 0.3  # from how it came, from which on an object is tilted by its use


@dataclass(frozen=True, eq=False)
class ShownUse:
    """What a source shows of a use.

    Attributes:
        piece: the segment.
        frames: (T, 4, 4) of where the source used its object.
        stays: the step at which a use goes on until it is done: tilted farthest, or else at its end.
        opens: the step at which the fingers open on the object; None where they never do.
    """

    piece: Piece
    frames: Array
    stays: int
    opens: int | None

    @classmethod
    def of(cls, piece: Piece) -> ShownUse:
        """Found from what preparing noted."""
        segment, data = piece.segment, piece.data
        lay = rest_step(piece.source.segments, segment.ref, segment.contact)
        opened = np.flatnonzero(data.gripper[segment.contact : segment.end] < 0)
        opens = segment.contact + int(opened[0]) if len(opened) else None
        ups = data.poses[segment.ref][segment.contact : segment.release, :3, 2]
        tilts = np.arccos(np.clip(ups @ ups[0], -1.0, 1.0))
        if tilts.max() > TILTS_RAD:
            stays = segment.contact + int(np.argmax(tilts))
        else:
            stays = segment.release - 1 if opens is None else min(opens, segment.release - 1)
        return cls(piece, use_frames(data, segment.stage, lay), stays, opens)


@dataclass(frozen=True, kw_only=True)
class _UsePath(SegmentPath):
    """A use in this scene.

    Attributes:
        shown: by its source.
        about: turn (3, 3) of the whole path about where it is used.
        spin: turn of the object about the vertical before, radians.
    """

    shown: ShownUse
    about: Array
    spin: float


def use(env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, failed: dict[int, int]) -> Iterator[Array]:
    """Use the held object as its stage says, as a source did.

    Args:
        env: in its scene.
        stage: whose object is in the hand.
        obj: that object.
        course: of the episode.
        failed: how often each source came to nothing, by its number; it is counted on.

    Raises:
        SkillError: no source shows such a use, none is within reach, or there is nothing left to pour.
    """
    if stage.verb == "pour" and not obj.contents:
        raise SkillError(f"{obj.title} is empty, but what was in it is not where it belongs")
    pieces = course.most_alike(pieces_for(course.sources, stage, USE), env, stage)
    if not pieces:
        raise SkillError(f"no source has a segment of `{stage.skill} {stage.verb}`")
    frame = _frame(env, stage, course)
    paths = _paths(env, stage, obj, frame, pieces, course, failed)
    mine = obj.bodies | obj.carried | _used_on(env, stage)
    lacking = f"{obj.title}: no source's way to use it is within reach"

    def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
        now = Held.now(env.data, obj.name, obj.contents)
        return best_plan(
            env, course, paths, frame[:3, 3], blocked, key=1, held=now, loaded=1, allowed=mine, lacking=lacking
        )

    held = Held.now(env.data, obj.name, obj.contents)
    choice = yield from course.choosing(approach(env, plan, CLOSED, held), DRIVE)
    path = choice.path
    assert isinstance(path, _UsePath)
    piece, stays = path.piece, path.shown.stays
    yield from course.labelled(bridged(env, course.manner, choice, path.first, CLOSED, held), BRIDGE)
    if not is_held(env, obj.name):
        return
    held = Held.now(env.data, obj.name, obj.contents)  # it may have slipped a little
    carried = along(
        use_path(stage, obj, held, frame, path.shown, path.about, path.spin, path.extra),
        lambda: _frame(env, stage, course)[:3, 3] - frame[:3, 3],
        lambda step: step == stays and touched_by_hand(env, obj)[0] and not stage_done(env, stage),
    )
    row = course.begin(piece, object=obj.name, cost=round(choice.cost, 3))
    yield from carry_out_segment(env, course, carried)
    row["in_vain"] = not stage_done(env, stage)
    if path.shown.opens is not None:
        yield from course.labelled(leave(env, obj), BRIDGE)
    if row["in_vain"]:
        failed[piece.source.number] = failed.get(piece.source.number, 0) + 1


def _frame(env: KitchenEnv, stage: Stage, course: Course) -> Array:
    """Where the object is used, as it stands now, (4, 4)."""
    return course.lay[env.scene.fill(stage.object)] if is_about_itself(env, stage) else use_frame(env, stage)


def _used_on(env: KitchenEnv, stage: Stage) -> frozenset[int]:
    """Bodies that the hand and what it holds may touch in a use: of an object that it is used on."""
    target = env.scene.fill(stage.target)
    if target not in env.scene.objects:
        return frozenset()
    return frozenset(np.flatnonzero(env.scene.subtree(target)).tolist())


def _paths(
    env: KitchenEnv,
    stage: Stage,
    obj: Graspable,
    frame: Array,
    pieces: list[Piece],
    course: Course,
    failed: dict[int, int],
) -> list[_UsePath]:
    """The sources' uses, turned about where they are used, with the object turned in the hand's favour."""
    _, yaw = base_pose(env.data)
    held = Held.now(env.data, obj.name, obj.contents)
    sided = has_heading(env, stage)
    turns = (0.0,) if is_about_itself(env, stage) else QUARTERS if sided else ROUND
    found = []
    for shown, turn in itertools.product(map(ShownUse.of, pieces), turns):
        segment, data, source = shown.piece.segment, shown.piece.data, shown.piece.source.number
        there = shown.frames[segment.contact]
        from_there = heading(frame[:3, :3]) - heading(there[:3, :3]) if sided else yaw - data.base[segment.contact, 2]
        about = rotation_about(UP, float(from_there) + turn)
        # How far the object is turned for the hand to be as the source's was, when it comes near.
        hand = about @ data.eef[segment.lead][:3, :3]
        own = about @ data.poses[segment.ref][segment.lead][:3, :3] @ held.rotation.T
        alike = _about_vertical(hand @ own.T)
        for spin in SPINS:
            drawn = float(course.bias[source])
            cost = drawn + TRIED_COST * failed.get(source, 0)
            cost += TURN_COST * abs(turn) + SPIN_COST * min(abs(spin), np.pi - abs(spin))
            way = use_path(stage, obj, held, frame, shown, about, alike + spin, cost)
            found.append(replace(way, drawn=drawn))
    return cheapest(env, found, course)


def _about_vertical(turn: Array) -> float:
    """The angle about the vertical, radians, that comes nearest to a turn (3, 3)."""
    return float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))


def use_path(
    stage: Stage, obj: Graspable, held: Held, frame: Array, shown: ShownUse, about: Array, spin: float, cost: float
) -> _UsePath:
    """A source's use, with the object as it is held here."""
    piece, opens = shown.piece, shown.opens
    segment, data = piece.segment, piece.data
    poses, came = data.poses[segment.ref], data.poses[segment.ref][segment.lead][:3, :3]
    point = data.working_points[use_key(segment.stage)][shown.stays]
    turned = rotation_about(UP, spin)

    def turn(step: int) -> Array:
        """The object's rotation at a step: turned as the source's has been since it came near."""
        out: Array = about @ (poses[step][:3, :3] @ came.T) @ about.T @ turned @ about @ came
        return out

    local = working_point(obj, stage.verb, turn(shown.stays))

    def hand(step: int) -> Array:
        if opens is not None and step > opens:
            return after_letting_go(hand(opens), data.eef[opens], data.eef[step], about)
        there = poses[step][:3, 3] + poses[step][:3, :3] @ point - shown.frames[step][:3, 3]
        rotation = turn(step)
        origin = frame[:3, 3] + about @ there - rotation @ local
        hand_turn = rotation @ held.rotation.T
        return make_pose(origin - hand_turn @ held.position, hand_turn)

    last = max(segment.release - 1, segment.contact)
    steps = (segment.lead, shown.stays, *np.linspace(segment.contact, last, SAMPLES).astype(int).tolist())
    return _UsePath(
        poses_at(piece, hand, steps),
        cost,
        piece=piece,
        hand=hand,
        target=lambda step: led_ahead(piece, hand(step), about, step),
        shown=shown,
        about=about,
        spin=spin,
    )
