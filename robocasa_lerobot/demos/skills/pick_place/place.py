"""Put down what the hand holds at one of several place poses: from above or through a front, then leave as it came."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    grip_position,
    hand_rotation,
    pose_error,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place.carrying.letting_go import caught, freed, set_down
from robocasa_lerobot.demos.skills.pick_place.carrying.level import level_hand, level_out
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import FROM_ABOVE, GraspStrategy, ahead_of, entry, steep
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.pick import INTEGRAL_GAIN
from robocasa_lerobot.demos.skills.pick_place.turn_over import turned_hand
from robocasa_lerobot.demos.skills.reaching import (
    Held,
    MotionPlan,
    WaypointPath,
    approach,
    follow_with,
    plan_reach,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

RELEASE_STEPS = 9
GAP_M = 0.012  # of the underside above the place pose when the hand opens
EXACT_M = 0.003  # of the hand from where it is to let go, where that matters
# A hand as far as this from where it is to let go is blocked, and keeps what it holds; where that is to fall into
# something narrow, what it holds is not as far.
BLOCKED_M, ASIDE_M = 0.08, 0.025
CLEAR_M = 0.06  # along the hand, out of what it held, before it leaves
AWAY_M = 0.26
MOST_SLIP_M = 0.03  # in the hand that is made up for
GONE_M = 0.27  # of the grip site from the object's origin: tasks ask for 25 cm
YAWS = 12
UP_RISE_M, RISES_M, LOW_COST = 0.06, (0.035, 0.010), 0.05  # over where it is let go, on the path in
LEVEL_RISE_M, LEVEL_COST = 0.004, 0.1
# Of heights that are planned for together, and of the sine of the hand's tilt, where the best plan of all costs more.
BAND_M, TILT_BAND, POOR = 0.05, 0.15, 1.2
NO_WAY = 2.5  # cost of a plan that meets something
AGAIN, AGAIN_M = 0.5, 0.02  # cost of a hand that goes where it went without success, as near as this
LEANING, LOADED_LEANING = 0.35, 1.0  # cost of a radian that the object is tilted, and of one with others in it
# Of what stands on so narrow a foot that it would fall over, if it were let go with that lean.
# What is as low, to its middle, does so to no harm.
TOPPLING, FOOT_M, STANDS_SHARE, LOW_M = 1.5, 0.01, 0.8, 0.035
LEVEL_FINGERS, SLOPE = 0.35, 0.5  # sine of the slope of the line between the fingers, and what that costs


@dataclass(frozen=True)
class PlacePose:
    """Where the middle of an object's underside may come.

    Attributes:
        point: world, metres.
        extra: cost.
    """

    point: Array
    extra: float = 0.0


@dataclass(frozen=True)
class PlaceStrategy:
    """How an object is put down.

    Attributes:
        poses: where, asked anew at each attempt, with the object in the hand.
        leans: tilts of object and hand towards straight ahead that are allowed, radians.
        entries: paths in and out, as of `GraspStrategy`.
        grasp: how it is grasped before, where it stands free.
        in_m: length of the path in, metres.
        gap_m: of the underside above the place pose when the hand opens.
        turns: of a leaning hand to the left, radians.
        exact: the object must come to within a few millimetres of the place pose.
        falls: the fingers are to open side by side, so that the object falls from between them.
        aside_m: by how much it may fall beside the place pose then, metres.
        upwards: which way the object's own z axis points in the end, world, where it is turned over in between.
        narrow: whether the hand keeps to a straight line in and out also where that is steep.
        fit: cost of the object's origin (3,) and rotation (3, 3) in the end, by what they leave of the room there.
        upended: what lies in the hand comes to stand on end: a lean about the line between the fingers costs nothing.
        make_room: before an object is fetched, makes room for it with an empty hand; told whether it had none before.
        falls_off: whether an object would fall to the floor from such an origin and rotation: it is not let go there.
        anew: how it is set down to be grasped in another manner, where there is no way in as it is held.
    """

    poses: Callable[[], Sequence[PlacePose]]
    leans: tuple[float, ...] = (0.0,)
    entries: tuple[str, ...] = ("up",)
    grasp: GraspStrategy = FROM_ABOVE
    in_m: float = 0.15
    gap_m: float = GAP_M
    turns: tuple[float, ...] = (0.0,)
    exact: bool = False
    falls: bool = False
    aside_m: float = ASIDE_M
    upwards: Array | None = None
    narrow: bool = False
    fit: Callable[[Array, Array], float] | None = None
    upended: bool = False
    falls_off: Callable[[Array, Array], bool] | None = None
    make_room: Callable[[KitchenEnv, bool], Iterator[Array]] | None = None
    anew: PlaceStrategy | None = None


def has_way_in(env: KitchenEnv, obj: Graspable, strategy: PlaceStrategy) -> bool:
    """Whether the object in the hand, as it is held, can be put down from here without meeting anything."""
    return _planner(env, obj, strategy, [])(()).cost < NO_WAY


def put(env: KitchenEnv, obj: Graspable, strategy: PlaceStrategy, failed: list[Array]) -> Iterator[Array]:
    """Bring the object in the hand to one of the place poses, let go, and leave; the hand's place is noted in `failed`.

    Where the hand is blocked before it is there, it keeps what it holds.

    Raises:
        SkillError: there is nowhere to put it.
    """
    data = env.data
    held = Held.now(data, obj.name, obj.contents)
    yield from level_out(env, obj)
    choice = yield from approach(env, _planner(env, obj, strategy, failed), CLOSED, held)
    if not _holds(env, held):
        return
    if obj.contents:  # which have moved it in the hand
        yield from level_out(env, obj)
        choice = _planner(env, obj, strategy, failed, may_drive=False)(())
    held = Held.now(data, obj.name, obj.contents)
    failed.append(choice.path.targets[2].position)
    yield from follow_with(env, choice.joints, held)
    if not _holds(env, held):
        return
    far, above, low, clear, away = choice.path.targets
    # A path in through a front, or into a mouth, is kept from its beginning on.
    inwards = strategy.narrow or not steep(far, above)
    kept = inwards or strategy.exact
    line = far.position if kept else None
    yield from move_hand(
        data,
        far,
        CLOSED,
        tolerance=0.01 if kept else 0.04,
        max_steps=110,
        integral_gain=INTEGRAL_GAIN if kept else 0.0,
    )
    if not _holds(env, held):
        return
    if obj.contents:  # it goes in as was planned, however it has turned and slipped in the hand until now
        above, low = (_as_it_lies(env, pose, held) for pose in (above, low))
        held = Held.now(data, obj.name, obj.contents)
    yield from move_hand(data, above, CLOSED, speed=0.7 if kept else 1.0, max_steps=90, start=line)
    if not _holds(env, held):
        return
    # What has slipped in the hand goes to the place pose, not the hand.
    slipped = (_origin(low, held) - _origin_now(env, obj, low)) * [1.0, 1.0, 0.0]
    low = HandTarget(low.position + np.clip(slipped, -MOST_SLIP_M, MOST_SLIP_M), low.rotation)
    tolerance = EXACT_M if strategy.exact else 0.008
    yield from move_hand(data, low, CLOSED, speed=0.5, tolerance=tolerance, max_steps=60, integral_gain=INTEGRAL_GAIN)
    body = data.body(obj.name)
    aside = float(np.linalg.norm((body.xpos - _origin(low, Held.now(data, obj.name)))[:2]))
    before = strategy.falls_off is not None and strategy.falls_off(body.xpos, body.xmat.reshape(3, 3))
    blocked = pose_error(data, low).position > BLOCKED_M
    if blocked or (strategy.falls and aside > strategy.aside_m) or before:
        if blocked:  # what is in its way stays there: it counts twice
            failed.append(choice.path.targets[2].position)
        yield from _draw_off(env, above, far, inwards)
        return
    at = HandTarget(grip_position(data), hand_rotation(data))
    yield from hold_hand(data, at, OPEN, RELEASE_STEPS)
    lower = yield from set_down(env, obj)
    clear, away = (HandTarget(pose.position - lower * UP, pose.rotation) for pose in (clear, away))
    yield from move_hand(data, clear, OPEN, speed=0.6, tolerance=0.02, max_steps=30)
    at = HandTarget(at.position - lower * UP, at.rotation)
    yield from freed(env, obj, at, clear)
    if (yield from caught(env, obj, at, clear)):
        yield from _draw_off(env, above, far, inwards)
        return
    line = clear.position if inwards else None
    yield from move_hand(data, away, OPEN, tolerance=0.03, max_steps=60, start=line)
    yield from leave(env, obj)


def _draw_off(env: KitchenEnv, above: HandTarget, far: HandTarget, inwards: bool) -> Iterator[Array]:
    """Go back with what stays in the hand, for another place: out through the front that it came in by."""
    yield from move_hand(env.data, above, CLOSED, speed=0.6, tolerance=0.03, max_steps=30)
    if inwards:  # a way round begins before the front
        yield from move_hand(env.data, far, CLOSED, tolerance=0.03, max_steps=60, start=above.position)


def _planner(
    env: KitchenEnv, obj: Graspable, strategy: PlaceStrategy, failed: list[Array], *, may_drive: bool = True
) -> Callable[[Sequence[RobotPose]], MotionPlan]:
    """What plans the path to the place poses with the object as it lies in the hand now.

    Raises:
        SkillError: there is nowhere to put it.
    """
    held = Held.now(env.data, obj.name, obj.contents)
    poses = list(strategy.poses())
    paths = [path for pose in poses for path in _paths(env, obj, held, pose, strategy, failed)]
    if not paths:
        raise SkillError(f"{obj.title}: nowhere to put it")
    mine = obj.bodies | obj.carried
    middle = np.mean([pose.point for pose in poses], axis=0)

    def best(some: list[WaypointPath], blocked: Sequence[RobotPose], *, drives: bool) -> list[MotionPlan]:
        return plan_reach(
            env, some, middle, key=2, held=held, loaded=3, allowed=mine, blocked=blocked, may_drive=drives
        )[:1]

    def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
        found = best(paths, blocked, drives=may_drive)
        if not found or found[0].cost > POOR:  # too many low ones, all of them in the way of something
            tilted, high = (_in_groups(paths, by_tilt=by_tilt) for by_tilt in (True, False))
            groups = tilted if strategy.falls else high + tilted
            found += [choice for some in groups for choice in best(some, blocked, drives=False)]
        return min(found, key=lambda choice: choice.cost)

    return plan


def _in_groups(paths: list[WaypointPath], *, by_tilt: bool) -> list[list[WaypointPath]]:
    """Paths in groups of about the same height, or tilt, of the hand that lets go, if there is more than one group."""
    groups: dict[int, list[WaypointPath]] = {}
    for path in paths:
        low = path.targets[2]
        band = low.rotation[2, 2] / TILT_BAND if by_tilt else low.position[2] / BAND_M
        groups.setdefault(int(np.floor(band)), []).append(path)
    return list(groups.values()) if len(groups) > 1 else []


def leave(env: KitchenEnv, obj: Graspable) -> Iterator[Array]:
    """Go farther off where the hand is still near what it has put down: up and back, then with the base."""
    data = env.data
    for _ in range(2):
        if np.linalg.norm(grip_position(data) - data.body(obj.name).xpos) > GONE_M:
            return
        away = grip_position(data) - 0.12 * ahead_of(env) + 0.06 * UP
        yield from move_hand(data, HandTarget(away, hand_rotation(data)), OPEN, tolerance=0.03, max_steps=30)
    if np.linalg.norm(grip_position(data) - data.body(obj.name).xpos) > GONE_M:
        return
    base, yaw = base_pose(data)
    back = base - 0.2 * ahead_of(env)
    with contextlib.suppress(SkillError):
        yield from drive_to(env, float(back[0]), float(back[1]), yaw, gripper=OPEN, tolerance_m=0.04)


def _paths(
    env: KitchenEnv, obj: Graspable, held: Held, pose: PlacePose, strategy: PlaceStrategy, failed: list[Array]
) -> list[WaypointPath]:
    ahead = ahead_of(env)
    left = np.cross(UP, ahead)
    present = level_hand(env, obj) if strategy.upwards is None else turned_hand(env, obj, strategy.upwards)
    leaning = LOADED_LEANING if obj.contents else 0.0 if strategy.upended else LEANING
    steepest = np.inf if strategy.upended else _stands_up_to(obj, present @ held.rotation)
    level = float(present[:, 2] @ UP) > -0.85  # a hand that looks ahead keeps doing so
    found = []
    for yaw in upending_yaws(present, left) if strategy.upended else 2 * np.pi * np.arange(YAWS) / YAWS:
        turned = rotation_about(UP, yaw) @ present
        if level and float(turned[:, 2] @ ahead) < 0.35:
            continue
        for lean, turn in itertools.product(strategy.leans, strategy.turns):
            rotation = rotation_about(UP, turn) @ rotation_about(left, -lean) @ turned
            slope = abs(float(rotation[2, 1])) if strategy.falls else 0.0
            if slope > LEVEL_FINGERS:
                continue
            object_turn = rotation @ held.rotation
            origin = pose.point + (obj.below(object_turn) + strategy.gap_m) * UP
            low = origin - rotation @ held.position
            again = AGAIN * sum(np.linalg.norm(low - other) < AGAIN_M for other in failed)
            cost = pose.extra + float(again) + leaning * abs(lean) + SLOPE * slope + 0.08 * min(yaw, 2 * np.pi - yaw)
            cost += TOPPLING * (abs(lean) > steepest)
            if strategy.fit is not None:
                cost += strategy.fit(origin, object_turn)
            for name in strategy.entries:
                for rise in {"up": (UP_RISE_M,), "level": (LEVEL_RISE_M,)}.get(name, RISES_M):
                    extra = cost + (LEVEL_COST if name == "level" else LOW_COST if rise == min(RISES_M) else 0.0)
                    found.append(_path(low, rotation, entry(env, name), name, strategy.in_m, rise, extra))
    return found


def upending_yaws(present: Array, left: Array) -> Array:
    """Turns of the hand about the vertical, 0 to 2 pi, by which it leans about the line between its fingers alone."""
    opens = present[:, 1]
    off = np.arctan2(np.cross(opens, left)[2], (opens * left)[:2].sum())
    turns: Array = np.mod([off, off + np.pi], 2 * np.pi)
    return turns


def _stands_up_to(obj: Graspable, turn: Array) -> float:
    """By how much an object may lean from the rotation (3, 3) in which it stands, to come to rest well, radians."""
    points = obj.cloud @ turn.T
    foot = points[points[:, 2] < points[:, 2].min() + FOOT_M, :2]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half, height = float(np.ptp(foot, axis=0).min()) / 2, float(middle[2] - points[:, 2].min())
    return np.pi if height < LOW_M else STANDS_SHARE * float(np.arctan2(half, height))


def _path(low: Array, rotation: Array, out: Array, name: str, in_m: float, rise: float, cost: float) -> WaypointPath:
    clear = low - CLEAR_M * rotation[:, 2]
    if name == "up":
        above, far, away = low + rise * UP, low + in_m * UP, clear + AWAY_M * UP
    else:
        above = low + rise * UP
        far, away = above + in_m * out, clear + max(AWAY_M, in_m) * out
    return WaypointPath(tuple(HandTarget(p, rotation) for p in (far, above, low, clear, away)), cost)


def _holds(env: KitchenEnv, held: Held) -> bool:
    now = Held.now(env.data, held.name)
    return bool(np.linalg.norm(now.position - held.position) < 0.06)


def _as_it_lies(env: KitchenEnv, hand: HandTarget, held: Held) -> HandTarget:
    """The hand's pose that brings an object, as it lies in the hand now, to where `hand` did as it was held before."""
    now = Held.now(env.data, held.name)
    rotation = hand.rotation @ held.rotation @ now.rotation.T
    return HandTarget(_origin(hand, held) - rotation @ now.position, rotation)


def _origin(hand: HandTarget, held: Held) -> Array:
    origin: Array = hand.position + hand.rotation @ held.position
    return origin


def _origin_now(env: KitchenEnv, obj: Graspable, hand: HandTarget) -> Array:
    """Where an object's origin comes with the hand at a target, as it lies in the hand now."""
    return _origin(hand, Held.now(env.data, obj.name))
