"""Segments about a part of a fixture: which fit it as it stands, how the hand goes along with it, and from where."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.generate.base import go_near, stands_like
from robocasa_lerobot.demos.generate.bridge import bridged
from robocasa_lerobot.demos.generate.course import BRIDGE, DRIVE, Course, Try
from robocasa_lerobot.demos.generate.execute import Carried, as_target, carry_out_segment, hand_now
from robocasa_lerobot.demos.generate.fits import Fit, fits_of
from robocasa_lerobot.demos.generate.select import narrowed
from robocasa_lerobot.demos.generate.sources.frames import Part, anchored, body_pose
from robocasa_lerobot.demos.generate.sources.transform import heading, inverse, make_pose, yaw_pose
from robocasa_lerobot.demos.motion import CLOSED, OPEN, Array, base_pose, rotation_about
from robocasa_lerobot.demos.planning.collision import CollisionChecker, MovingPart
from robocasa_lerobot.demos.planning.motion_planner import MotionPlan, MotionPlanner, WaypointPath
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, hold_hand, stage_done
from robocasa_lerobot.demos.skills.levers import turn_on_water, wait_while_down
from robocasa_lerobot.demos.skills.reaching import MOST_DRIVES, approach_by, is_blocked
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

MOST_SEGMENTS = 5  # of a stage, tries that come to nothing among them
SAMPLES = 4  # poses of a contact that reach and collisions are judged by, besides where it begins
# A part that is behind by this share of its way is waited for; less and less, down to the second, towards the end.
LATE_SHARE, END_SHARE = 0.06, 0.003
AHEAD_STEPS = 3  # before it should be at the end, since the hand may draw back by then
RELEASE_STEPS, BACK_M = 6, 0.08
APART_COST, FLIP_COST = 0.8, 0.05  # of its whole range from where the segment began; of half a turn
SHORT_COST = 0.5  # of a segment that moves its part not at all, where another one leads it on
MOST_APPROACHES = 6  # of the best plans for a contact, whose ways there are planned
MET_SHARE = 0.01  # of its range: a part that has moved as far has been touched
SWEEP = 4  # positions of a part that the base must not be in the way of
FRUITLESS_SHARE, FAILED_COST = 0.02, 1.0  # of its range; cost of a source that has come to nothing
REST_STEPS = 6  # after which a stage must still be done
SLIPPED_SHARE = 0.3  # of its way: a segment that gets a part less far has failed, too
DRIVES_M = 0.03  # a base that goes farther in a segment drives


def part_stage(env: KitchenEnv, stage: Stage, course: Course) -> Iterator[Array]:
    """Carry out segments on the stage's parts until it is done.

    Raises:
        SkillError: no source has a segment for it, or it is not done after all tries.
    """
    key = (stage.target, stage.part, stage.verb, stage.object, stage.to)
    again, failed = key in course.failed, course.failed.setdefault(key, Counter())
    for number in range(MOST_SEGMENTS):
        if (yield from _stays_done(env, stage, course)):
            return
        if number or (again and course.fingers == CLOSED):
            yield from course.labelled(_let_go(env), BRIDGE)
            if (yield from _stays_done(env, stage, course)):  # it was still moving
                return
        fits = fits_of(env, stage, course)
        if not fits:
            raise SkillError(
                f"{stage.target}: no source shows how to go on from here"
                if number
                else f"{stage.target}: no source has a segment of `{stage.skill} {stage.verb}`"
            )
        fit, cost = yield from _approach(env, course, fits, failed, may_stay=number > 0)
        before, runs = fit.part.position(env.data), _water_runs(env, stage)
        begin, end = fit.way_from(before)
        ahead = float(np.sign(end - begin))
        row = course.begin(fit.piece, part=fit.part.name, mirror=fit.mirror, cost=round(cost, 3))
        farthest = yield from _farthest(env, fit.part, ahead, carry_out_segment(env, course, _carried(env, stage, fit)))
        if runs and not _water_runs(env, stage):  # the hand has leaned on the lever
            yield from course.labelled(turn_on_water(env, stage), BRIDGE)
        moved = fit.part.position(env.data) - before
        row["moved"] = moved / fit.part.span
        least = max(FRUITLESS_SHARE * fit.part.span, SLIPPED_SHARE * abs(end - before))
        row["in_vain"] = bool((farthest if fit.piece.springs else moved * ahead) < least)
        if row["in_vain"]:
            failed[fit.as_try()] += 1
        elif (stage.skill, stage.verb) == ("levers", "press"):  # a toaster's comes up by itself
            yield from course.labelled(wait_while_down(env, stage, as_target(hand_now(env))), BRIDGE)
    if not (yield from _stays_done(env, stage, course)):
        raise SkillError(f"{stage.target}: not done after {MOST_SEGMENTS} segments")


def _farthest(env: KitchenEnv, part: Part, ahead: float, steps: Iterator[Array]) -> Generator[Array, None, float]:
    """Carry out steps; returns the most that a part has gone one way meanwhile, also where it has sprung back since."""
    before, most = part.position(env.data), 0.0
    for step in steps:
        yield step
        most = max(most, (part.position(env.data) - before) * ahead)
    return most


def _stays_done(env: KitchenEnv, stage: Stage, course: Course) -> Generator[Array, None, bool]:
    """Whether a stage is done, and still is a moment later: a door that is hit shut may swing back."""
    if not stage_done(env, stage):
        return False
    at = as_target(hand_now(env))
    yield from course.labelled(hold_hand(env.data, at, course.fingers, REST_STEPS), BRIDGE)
    return stage_done(env, stage)


def _water_runs(env: KitchenEnv, stage: Stage) -> bool:
    return (stage.skill, stage.verb) == ("levers", "turn") and env.scene.fixture(stage.target, Sink).water_on(env.data)


def _let_go(env: KitchenEnv) -> Iterator[Array]:
    """Open the fingers where they are, and draw the hand back."""
    yield from hold_hand(env.data, as_target(hand_now(env)), OPEN, RELEASE_STEPS)
    yield from draw_back(env.data, OPEN, BACK_M)


def _approach(
    env: KitchenEnv, course: Course, fits: list[Fit], failed: Counter[Try], *, may_stay: bool
) -> Generator[Array, None, tuple[Fit, float]]:
    """Choose a segment and a stand, go there, and bring the hand to where the segment begins.

    With `may_stay` the robot may stay where it is, though no source stood there. Returns the segment and its cost.
    """
    fits = narrowed(
        fits,
        course.manner,
        course.rng,
        source=lambda fit: fit.piece.source.number,
        object_change=lambda fit: _change(env, fit),
        first_pose=lambda fit: _poses(env, fit)[0],
        hand=hand_now(env),
    )
    paths = _paths(env, course, fits, failed)
    allowed = frozenset(
        int(body) for fit in fits for body in np.flatnonzero(env.scene.subtree(env.model.body(fit.part.body).name))
    )
    ordered = [fit for fit, _ in sorted(zip(fits, paths, strict=True), key=lambda pair: pair[1].extra)]
    stands = stands_like(env, [_stand(env, fit) for fit in ordered], course.manner)
    if may_stay and course.manner.base == "replan" and None not in stands:
        stands = [None, *stands]
    stands = _beside(env, fits, stands)

    def best(blocked: Sequence[RobotPose]) -> MotionPlan:
        left = stands
        if blocked:  # something stood in the way: what can be done from elsewhere, and from here?
            others = [stand for stand in stands if stand is not None and not is_blocked(stand, blocked)]
            left = _beside(env, fits, [None, *(others if len(blocked) < MOST_DRIVES else [])])
        plans = MotionPlanner(env, paths, 1, allowed=allowed).best(left)[:MOST_APPROACHES]
        if not plans:
            raise SkillError("no source's segment is within reach")
        return min(plans, key=lambda plan: plan.cost + _free_way(env, plan, plan.base).cost)

    def begun(plan: MotionPlan) -> tuple[Fit, float]:
        """A plan's segment, and the fingers that it begins with."""
        fit = next(one for one, path in zip(fits, paths, strict=True) if path is plan.path)
        return fit, float(fit.piece.data.gripper[fit.piece.segment.lead])

    plan = yield from course.choosing(
        approach_by(env, best, lambda plan, stand: go_near(env, stand, begun(plan)[1])), DRIVE
    )
    fit, gripper = begun(plan)
    way = _free_way(env, plan, None)
    yield from course.labelled(bridged(env, course.manner, way, _poses(env, fit)[0], gripper), BRIDGE)
    return fit, plan.cost + way.cost


def _paths(env: KitchenEnv, course: Course, fits: list[Fit], failed: Counter[Try]) -> list[WaypointPath]:
    """The segments as alternatives for the planner: dearer the less they lead on, and what has failed before."""
    gains = [_gain(env, fit) for fit in fits]
    most: dict[str, float] = {}
    for fit, gain in zip(fits, gains, strict=True):
        most[fit.part.name] = max(gain, most.get(fit.part.name, 0.0))
    of_source: Counter[int] = Counter()
    for tried, times in failed.items():
        of_source[tried.source] += times
    return [
        WaypointPath(
            tuple(as_target(pose) for pose in _poses(env, fit)),
            float(course.bias[fit.piece.source.number])
            + FAILED_COST * failed[fit.as_try()]
            + FAILED_COST / 2 * of_source[fit.piece.source.number]
            + APART_COST * fit.apart(fit.part.position(env.data))
            + SHORT_COST * (1.0 - gain / most[fit.part.name])
            + FLIP_COST * fit.flip,
        )
        for fit, gain in zip(fits, gains, strict=True)
    ]


def _gain(env: KitchenEnv, fit: Fit) -> float:
    """How far a segment leads its part on from where that is, metres or radians; the same for those that count anew."""
    if fit.words_relative or fit.piece.springs:
        return 1.0
    return max(abs(fit.way()[1] - fit.part.position(env.data)), 1e-6)


def _free_way(env: KitchenEnv, plan: MotionPlan, base: RobotPose | None) -> MotionPlan:
    """The way to where a segment begins, on which the hand may not touch the part either."""
    return MotionPlanner(env, [WaypointPath(plan.targets[:1])], 0).best([base])[0]


def _change(env: KitchenEnv, fit: Fit) -> Array:
    """Where the part is before the robot, in the frame of where it was before the source's robot, (4, 4)."""
    segment, data = fit.piece.segment, fit.piece.data
    position, yaw = base_pose(env.data)
    here = inverse(yaw_pose(float(position[0]), float(position[1]), yaw)) @ body_pose(env.data, fit.part.body)
    there = inverse(data.base_pose(segment.begin)) @ data.poses[segment.ref][segment.begin]
    return inverse(there) @ here


def _beside(env: KitchenEnv, fits: list[Fit], stands: list[RobotPose | None]) -> list[RobotPose | None]:
    """Those stands where the base is not in the way of the parts; all of them where it is everywhere."""
    checker = CollisionChecker(env.scene, env.data)
    joints = checker.arm.home
    out = []
    for stand in stands:
        place = checker.present_base if stand is None else np.array([stand.x, stand.y, stand.yaw])
        meets = False
        for part in {fit.part.name: fit.part for fit in fits}.values():
            ends = [fit.way()[1] for fit in fits if fit.part is part]
            shares = np.arange(SWEEP) / (SWEEP - 1)
            values: Array = part.position(env.data) + shares * (float(np.mean(ends)) - part.position(env.data))
            moving = MovingPart(
                env.model, env.data, env.model.joint(int(env.model.body_jntadr[part.body])).name, values
            )
            touched = checker.touched(
                np.tile(place, (SWEEP, 1)), joints, part=moving, states=np.arange(SWEEP), links=(0,), most=8
            )
            meets |= any(moving.inside[body] for body in touched.all())
        if not meets:
            out.append(stand)
    return out or stands


def _poses(env: KitchenEnv, fit: Fit) -> list[Array]:
    """Hand poses of a segment here: where it begins, where it touches, and along the way of the part.

    Those of a base that drives are as the arm sees them from where it begins: what the base goes is taken off.
    """
    segment, data = fit.piece.segment, fit.piece.data
    steps = [segment.lead, segment.contact]
    steps += (
        np.linspace(segment.contact, max(segment.release - 1, segment.contact), SAMPLES + 1)[1:].astype(int).tolist()
    )
    _, end = fit.way()
    first, far = fit.piece.travel()
    floor = _floor_map(env, fit) if _drives(fit) else None
    out = []
    for step in steps:
        share = 0.0 if far == 0.0 else (data.joints[segment.ref][step] - first) / far
        now = fit.part.position(env.data)
        at = now + float(np.clip(share, 0.0, 1.0)) * (end - now) if step > segment.contact else now
        pose = anchored(_part_pose_at(env, fit.part, at), fit.point) @ fit.local(data.eef[step], step)
        if floor is not None:
            pose = _as_from(_base_like(fit, floor, step), _base_like(fit, floor, segment.lead)) @ pose
        out.append(pose)
    return out


def _drives(fit: Fit) -> bool:
    """Whether the base goes along in a segment."""
    path = fit.piece.data.base[fit.piece.segment.lead : fit.piece.segment.end]
    return len(path) > 0 and bool(np.hypot(*(path - path[0])[:, :2].T).max() > DRIVES_M)


def _as_from(base: Array, other: Array) -> Array:
    """The change (4, 4) of world poses after which they are before another place of the base (3,) as before one."""
    x, y, yaw = other.tolist()
    there = yaw_pose(x, y, yaw)
    x, y, yaw = base.tolist()
    out: Array = there @ inverse(yaw_pose(x, y, yaw))
    return out


def _part_pose_at(env: KitchenEnv, part: Part, position: float) -> Array:
    """World pose (4, 4) of a part with its joint at another position."""
    data, pose = env.data, body_pose(env.data, part.body)
    joint = int(env.model.body_jntadr[part.body])
    axis, anchor_point = data.xaxis[joint], data.xanchor[joint]
    away = position - part.position(data)
    if part.slides:
        return make_pose(pose[:3, 3] + away * axis, pose[:3, :3])
    turn = rotation_about(axis, away)
    return make_pose(anchor_point + turn @ (pose[:3, 3] - anchor_point), turn @ pose[:3, :3])


def _floor_map(env: KitchenEnv, fit: Fit) -> tuple[Array, Array]:
    """Frames (4, 4) on the floor below the frame's point in the source and here, with their fixtures' headings."""
    data, segment = fit.piece.data, fit.piece.segment
    role = segment.ref.partition(".")[0]
    there = fit.source_frame(segment.contact)[:3, 3]
    here = anchored(body_pose(env.data, fit.part.body), fit.point)[:3, 3]
    yaw = float(env.scene.fixture(fit.part.name.partition(".")[0]).yaw)
    return (
        yaw_pose(float(there[0]), float(there[1]), float(data.about["fixtures"][role]["yaw"])),
        yaw_pose(float(here[0]), float(here[1]), yaw),
    )


def _base_like(fit: Fit, frames: tuple[Array, Array], step: int) -> Array:
    """Where the base belongs at a step of the source: x, y, heading."""
    there, here = frames
    inside = inverse(there) @ fit.piece.data.base_pose(step)
    if fit.mirror:
        ahead = np.pi - heading(inside[:3, :3])
        inside = yaw_pose(-float(inside[0, 3]), float(inside[1, 3]), ahead)
    pose = here @ inside
    return np.array([pose[0, 3], pose[1, 3], heading(pose[:3, :3])])


def _stand(env: KitchenEnv, fit: Fit) -> RobotPose:
    x, y, yaw = _base_like(fit, _floor_map(env, fit), fit.piece.segment.lead).tolist()
    return RobotPose(x, y, yaw)


def _lets_go(fit: Fit) -> int:
    """The step at which the fingers open on what they held; of a push, where the contact ends."""
    segment, gripper = fit.piece.segment, fit.piece.data.gripper
    held = range(segment.contact + 1, segment.release)
    return next((step for step in held if gripper[step] < 0 < gripper[step - 1]), segment.release)


def _carried(env: KitchenEnv, stage: Stage, fit: Fit) -> Carried:
    """The segment with its frame on the part as it moves, the base going along where it did in the source."""
    segment, data, part = fit.piece.segment, fit.piece.data, fit.part
    start = part.position(env.data)
    begin, end = fit.way_from(start)
    if (begin - start) * (end - begin) > 0:  # the part has yet to come to where it stood in the source
        begin = start

    def share(step: int) -> float:
        first, far = fit.piece.travel()
        return (float(data.joints[segment.ref][step]) - first) / far

    def here() -> float:
        return (part.position(env.data) - begin) / (end - begin)

    before = anchored(body_pose(env.data, part.body), fit.point)
    lets_go = _lets_go(fit)
    left: list[Array] = []

    def frame(step: int) -> Array:
        """The part's, as it moves; at rest before it is touched, and from where the hand lets it go."""
        if step < segment.contact:
            return before
        now = anchored(body_pose(env.data, part.body), fit.point)
        if step < lets_go:
            return now
        left[:] = left or [now]
        return left[0]

    def late(step: int) -> bool:
        soon = min(share(min(step + AHEAD_STEPS, segment.release - 1)), 1.0)
        wanted = soon if soon > 1.0 - LATE_SHARE / 2 else share(step)
        behind = here() < wanted - LATE_SHARE * (1.0 - wanted) - END_SHARE
        return behind and not stage_done(env, stage)

    steps = range(segment.contact, segment.release)
    leaves = next((step for step in steps if share(step) > MET_SHARE), segment.contact)
    enter = next((step for step in steps if share(step) >= here()), segment.contact) if here() > LATE_SHARE else 0
    base = None
    if _drives(fit):
        frames = _floor_map(env, fit)
        position, yaw = base_pose(env.data)
        off = np.array([position[0], position[1], yaw]) - _base_like(fit, frames, segment.lead)

        def base(step: int) -> Array:
            return _base_like(fit, frames, step) + off

    return Carried(
        fit.piece,
        lambda step: frame(step) @ fit.local(data.target[step], step),
        lambda step: frame(step) @ fit.local(data.eef[step], step),
        (lambda step: False) if fit.piece.springs else late,
        base,
        lambda: abs(part.position(env.data) - start) > MET_SHARE * part.span,
        lambda: part.position(env.data) / part.span,
        0 if fit.piece.springs else enter,
        leaves,
        twists=stage.skill == "knobs",
    )
