"""Taking hold of an object as in a source, where the object that is there now can be grasped.

A grasp of the source is brought to the nearest place where the gripper fits.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.generate.bridge import bridged
from robocasa_lerobot.demos.generate.course import BRIDGE, DRIVE, Course
from robocasa_lerobot.demos.generate.execute import as_target, carry_out_segment, hand_now
from robocasa_lerobot.demos.generate.objects.draw_out import draw_out
from robocasa_lerobot.demos.generate.objects.lid_places import LID_VERBS, knob_grasps
from robocasa_lerobot.demos.generate.objects.place_segments import place_strategy_of
from robocasa_lerobot.demos.generate.segment_paths import (
    STEEP_RAD,
    SegmentPath,
    along,
    best_plan,
    cheapest,
    poses_at,
)
from robocasa_lerobot.demos.generate.sources.segments import PICK
from robocasa_lerobot.demos.generate.sources.source import Piece, pieces_for
from robocasa_lerobot.demos.generate.sources.transform import heading, make_pose
from robocasa_lerobot.demos.generate.sources.uses import USES, where_it_lay
from robocasa_lerobot.demos.motion import (
    HALF_TURN,
    OPEN,
    UP,
    Array,
    axis_angle,
    base_pose,
    rotation_about,
)
from robocasa_lerobot.demos.planning.base_path import base_now
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, hold_hand
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import require_off_floor
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH, GraspStrategy
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.pick_place.pick import HOPELESS, is_held
from robocasa_lerobot.demos.skills.pick_place.strategies import (
    grasp_strategy,
    in_the_open,
    target_object,
)
from robocasa_lerobot.demos.skills.pick_place.verbs import BY_USE, come_to, free_grasp
from robocasa_lerobot.demos.skills.reaching import approach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

TURNS = tuple(np.deg2rad((0.0, 30.0, -30.0, 60.0, -60.0)))  # of a flatter one, to the sides
MOST_ASKEW_RAD = 0.45  # of a grasp from the source's, beside a turn about the vertical
ASKEW_COST, WORSE_GRASP, TRIED_COST, ALIKE_M = 0.3, 0.45, 1.2, 0.015
MOST_GRASPS = 10
RELEASE_STEPS = 8
HERE_M = 0.25  # of a base from where nothing could be done, which it leaves


def come_to_object(
    env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, other_than: Sequence[RobotPose]
) -> Iterator[Array]:
    """Drive to an object as a demonstrator does: where it is out of reach, or where nothing could be done from here.

    Raises:
        LostError: it lies on the floor.
    """
    require_off_floor(env, obj)
    if course.manner.base == "fixed":
        return
    here = base_now(env.data)
    known = [one for one in other_than if np.hypot(one.x - here.x, one.y - here.y) < HERE_M]
    holder = "" if stage.verb in USES or stage.verb == "pick" else target_object(env, stage)
    towards = env.data.body(holder).xpos.copy() if holder else None
    with contextlib.suppress(SkillError):  # the planner may know a place
        yield from course.labelled(come_to(env, obj, other_than if known else (), towards), DRIVE)


def pick_as_shown(env: KitchenEnv, stage: Stage, obj: Graspable, course: Course, tried: list[Array]) -> Iterator[Array]:
    """Take hold of an object with a source's segment, and draw it out of where it was; it may fail.

    Where it is grasped is added to `tried`, and avoided from then on.

    Raises:
        SkillError: no source picks anything up, no grasp of one fits, or none is within reach.
    """
    pieces = course.most_alike(pieces_for(course.sources, stage, PICK), env, stage)
    if not pieces:
        raise SkillError("no source picks anything up")
    strategy = grasp_strategy(env, obj, _free_grasp(env, stage, obj), kept=stage.verb == "pick" or stage.verb in USES)
    if strategy.first is not None:
        yield from course.labelled(strategy.first(env), BRIDGE)
    origin = env.data.body(obj.name).xpos.copy()
    enclosed = not in_the_open(locate(env, obj.name)) and len(strategy.turns) == 1  # a slot is left by the lift
    ways = _pick_ways(env, obj, strategy, pieces, course, tried, lid=stage.verb in LID_VERBS)
    if not ways:
        raise SkillError(f"{obj.title}: no source's grasp fits it")
    lacking = f"{obj.title}: no source's grasp is within reach"
    plan = partial(best_plan, env, course, ways, origin, key=2, allowed=obj.bodies, lacking=lacking, most=HOPELESS)
    choice = yield from course.choosing(approach(env, plan, OPEN), DRIVE)
    way = choice.path
    assert isinstance(way, SegmentPath)
    tried.append(way.targets[2].position - origin)
    yield from course.labelled(bridged(env, course.manner, choice, way.first, OPEN), BRIDGE)
    body = env.data.body(obj.name)
    start, turn = body.xpos.copy(), body.xmat.reshape(3, 3).copy()
    course.lay[obj.name] = where_it_lay(make_pose(start, turn), float(start[2]) - obj.below(turn))
    row = course.begin(way.piece, object=obj.name, cost=round(choice.cost, 3))
    yield from carry_out_segment(env, course, along(way, lambda: start - origin))
    row["in_vain"] = not is_held(env, obj.name)
    if enclosed and not row["in_vain"]:
        yield from course.labelled(draw_out(env, strategy, env.data.body(obj.name).xpos - start), BRIDGE)
    if row["in_vain"]:
        at = as_target(hand_now(env))
        yield from course.labelled(hold_hand(env.data, at, OPEN, RELEASE_STEPS), BRIDGE)
        yield from course.labelled(draw_back(env.data, OPEN, 0.08), BRIDGE)


def _free_grasp(env: KitchenEnv, stage: Stage, obj: Graspable) -> GraspStrategy:
    """How an object that stands free is grasped best for its stage."""
    if stage.verb in LID_VERBS:
        return ANY_APPROACH
    if stage.verb in USES:
        return BY_USE.get(stage.verb, ANY_APPROACH)
    return free_grasp(env, stage) if stage.verb == "pick" else place_strategy_of(env, stage, obj).grasp


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
                drawn = float(course.bias[piece.source.number])
                for rotation in (pose.rotation, pose.rotation @ HALF_TURN):
                    way = _pick_way(piece, pose.position, rotation, extra + drawn, drawn)
                    if way is not None:
                        ways.append(way)
    return cheapest(env, ways, course)


def _pick_way(piece: Piece, position: Array, rotation: Array, extra: float, drawn: float) -> SegmentPath | None:
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
    return SegmentPath(chosen, extra, drawn=drawn, piece=piece, hand=hand, target=lambda step: here(data.target[step]))
