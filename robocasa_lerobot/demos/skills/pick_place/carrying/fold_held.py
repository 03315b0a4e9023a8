"""Fold the arm with an object in the hand: before the base, or, where it could not drive so, to a side of it."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import (
    CLOSED,
    FROM_DESIRED,
    UP,
    Array,
    HandTarget,
    action,
    base_pose,
    floor_axes,
    grip_position,
    rotation_about,
)
from robocasa_lerobot.demos.planning.base_path import (
    HELD_MARGINS_M,
    LOADED_MARGINS_M,
    MARGINS_M,
    Margins,
    Room,
    base_now,
    find_free_path,
    wrap,
)
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, is_full
from robocasa_lerobot.demos.planning.errors import NoPlanError, ShutInError
from robocasa_lerobot.demos.planning.follow import in_room
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import move_hand
from robocasa_lerobot.demos.skills.pick_place.carrying.level import level_hand, level_out
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.reaching import MotionPlan, WaypointPath, follow_with, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

FOLDED_M = (0.42, 0.48, 0.36)  # of the grip site before the base's centre while an object is carried
FIRST_BACK_M = ((0.0, 0.0), (0.12, 0.05), (0.22, 0.1))  # before it rises to there, and what that costs
RISES_M = (0.0, 0.08, 0.15)  # over the height that the hand has at home
TURNS = tuple(float(turn) for turn in np.deg2rad((0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0)))
# Of the whole arm to the left, where the base cannot drive with it folded before itself: aside, and over its back.
ARM_TURNS = tuple(float(turn) for turn in np.deg2rad(np.arange(-150.0, 151.0, 15.0)))
AWAY_COST = 0.5  # of a radian between where the arm points and where the object is to go
MISS_M, MISS_RAD, LIMIT_RAD = 0.01, 0.05, 0.05  # of solved poses: greatest errors, least distance to a joint limit
MOST_FAR = 3  # searches for a path of the base that fail though it can leave its goal: they take a second each
MOST_SEARCHES, MOST_ALIKE = 30, 5  # paths of the base that are looked for; of them with the arm turned alike
# Kept on the drive, and near its ends: the arm comes near a folded pose only. First the one, then the other.
SPARES_M: tuple[Margins, ...] = ((0.05, 0.04), (0.03, 0.02))
SETTLE_STEPS = 5
# A path to a folded pose that costs as much meets something, and a hand as near as this before a fixture will when the
# base turns: that first drives back, so far at most, metres.
CRAMPED, BEFORE_M = 0.6, 0.08
MOST_BACK_M, BACK_STEP_M = 0.4, 0.08
MOST_COST = 1.5  # of a path to such a pose
MOST_FOLDS = 2


@dataclass(frozen=True)
class _Folded:
    """A folded pose of the arm that carries something.

    Attributes:
        target: of the hand, with the base as it stands.
        joints: (7,) radians.
        arm_turn: of the whole arm to the left, radians.
        cost: to compare.
    """

    target: HandTarget
    joints: Array
    arm_turn: float
    cost: float


def fold_with(
    env: KitchenEnv, obj: Graspable, stand: RobotPose | None = None, towards: Array | None = None
) -> Iterator[Array]:
    """Bring the hand near its home with an object in it: turned about the vertical alone, so that it stays level.

    Args:
        env: the kitchen.
        obj: in the hand.
        stand: where the base is to drive then; where it could not, the arm as a whole is turned so that it can.
        towards: where the object is to go from there, world, metres; turns that point there are preferred.
    """
    for _ in range(MOST_FOLDS):
        held = Held.now(env.data, obj.name, obj.contents)
        ahead = _ahead(env, obj, held)
        if stand is not None and ahead is not None and _cramped(env, ahead):
            yield from _back_off(env, obj, held)
            held = Held.now(env.data, obj.name, obj.contents)
            ahead = _ahead(env, obj, held)
        if ahead is None:
            return
        wanted = LOADED_MARGINS_M if is_full(held) else HELD_MARGINS_M
        roomy = wanted[: -len(MARGINS_M)]
        drives = stand is None or _can_drive(env, stand, held, _after(env, ahead), roomy)
        aside = None if stand is None or drives else _aside(env, obj, held, stand, towards)
        if stand is None or aside is None:
            yield from follow_with(env, ahead.joints, held)
            yield from move_hand(env.data, ahead.path.targets[1], CLOSED, tolerance=0.03, max_steps=60)
            yield from level_out(env, obj)
            return
        yield from follow_with(env, aside.joints, held)
        yield from move_hand(env.data, aside.path.targets[0], CLOSED, max_steps=40)
        yield from level_out(env, obj)
        for _ in range(SETTLE_STEPS):  # to where the hand stays on the drive
            yield action(gripper=CLOSED, mode=FROM_DESIRED)
        # What has slipped in the hand, or an elbow that came out elsewhere, may be in the way after all.
        held = Held.now(env.data, obj.name, obj.contents)
        if _can_drive(env, stand, held, _present(env), wanted):
            return


def _cramped(env: KitchenEnv, ahead: MotionPlan) -> bool:
    """Whether the hand would be folded in a fixture, or close before one, or meets something on its way."""
    points = [grip_position(env.data), ahead.path.targets[1].position]
    return ahead.cost > CRAMPED or any(
        _apart(fixture, point) < BEFORE_M for fixture in env.scene.fixtures.values() for point in points
    )


def _apart(fixture: Fixture, point: Array) -> float:
    """How far a point is from a fixture's box at the most distant of its three axes; below 0 inside, metres."""
    x, y = fixture.to_local(point)
    away = np.abs([x, y, point[2] - fixture.pos[2]]) - np.array([fixture.width, fixture.depth, fixture.height]) / 2
    return float(away.max())


def _back_off(env: KitchenEnv, obj: Graspable, held: Held) -> Iterator[Array]:
    """Drive straight back with the arm as it is, as far as there is room: out of a front, where it cannot be folded."""
    checker = CollisionChecker(env.scene, env.data, allowed=obj.bodies | obj.carried)
    joints, (x, y, yaw) = _present(env), checker.present_base
    ahead = floor_axes(yaw)[0]
    steps = np.arange(BACK_STEP_M, MOST_BACK_M + 1e-9, BACK_STEP_M)
    places = np.array([(x - far * ahead[0], y - far * ahead[1], yaw) for far in steps])
    there = (
        checker.touched(places, joints, held=held).counts
        <= checker.touched(checker.present_base[None], joints, held=held).counts
    )
    free = int(np.argmin(there)) if not there.all() else len(there)
    if free:
        yield from shift_base(env, (-float(steps[free - 1]), 0.0), CLOSED)


def _present(env: KitchenEnv) -> Array:
    joints: Array = np.array(env.data.qpos[Arm(env.model, env.data, env.scene.robot).addresses])
    return joints


def _ahead(env: KitchenEnv, obj: Graspable, held: Held) -> MotionPlan | None:
    """The best path to a folded pose before the base: up, or back from under what is above it; then near."""
    base, yaw = base_pose(env.data)
    present, grip = level_hand(env, obj), grip_position(env.data)
    ways = []
    for back, extra in FIRST_BACK_M:
        point = grip - back * floor_axes(yaw)[0]
        ways.append((HandTarget(np.array([*point[:2], max(point[2], _home_height(env))]), present), extra))
    paths = [
        WaypointPath((over, target), cost + extra)
        for target, cost in _folded(env, obj, base, yaw)
        for over, extra in ways
    ]
    return _plan(env, obj, held, paths, 1)


def _plan(env: KitchenEnv, obj: Graspable, held: Held, paths: list[WaypointPath], key: int) -> MotionPlan | None:
    found = plan_reach(
        env, paths, grip_position(env.data), key=key, held=held, loaded=1, allowed=obj.bodies | obj.carried,
        may_drive=False,
    )  # fmt: skip
    return found[0] if found else None


def _folded(env: KitchenEnv, obj: Graspable, base: Array, yaw: float) -> list[tuple[HandTarget, float]]:
    """Poses of the hand before a base, with their costs."""
    ahead, present, home = floor_axes(yaw)[0], level_hand(env, obj), _home_height(env)
    found = []
    for out, rise, turn in itertools.product(FOLDED_M, RISES_M, TURNS):
        point = np.array([*(base + out * ahead)[:2], home + rise])
        cost = 0.1 * abs(turn) + rise + abs(out - FOLDED_M[0])
        found.append((HandTarget(point, rotation_about(UP, turn) @ present), cost))
    return found


def _after(env: KitchenEnv, plan: MotionPlan) -> Array:
    """Joint angles (7,) when the hand has come to the second pose of a plan from here."""
    return _solved(env, [plan.path.targets[1]], plan.joints[-1:])[0][0]


def _solved(env: KitchenEnv, targets: list[HandTarget], start: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Joints (n, 7) at poses with the base as it stands, and whether each is one that the arm can take, (n,)."""
    arm, frame = Arm(env.model, env.data, env.scene.robot), env.data.site(env.scene.robot.names.arm_center_site)
    turn = frame.xmat.reshape(3, 3).T
    positions = np.array([turn @ (target.position - frame.xpos) for target in targets])
    found = arm.solve(positions, np.array([turn @ target.rotation for target in targets]), start)
    good = (found.position_error < MISS_M) & (found.rotation_error < MISS_RAD) & (found.margin > LIMIT_RAD)
    return found.joints, good


def _can_drive(env: KitchenEnv, stand: RobotPose, held: Held, joints: Array, margins_m: Sequence[Margins]) -> bool:
    """Whether there is a path for the base with the arm folded so."""
    try:
        find_free_path(env.scene, env.data, base_now(env.data), stand, held, joints, margins_m=margins_m)
    except NoPlanError:
        return False
    return True


def _aside(env: KitchenEnv, obj: Graspable, held: Held, stand: RobotPose, towards: Array | None) -> MotionPlan | None:
    """The best path to a folded pose with the arm turned so that the base can drive; None if there is none."""
    poses, checker, here = _turned(env, obj, stand, towards), CollisionChecker(env.scene, env.data), base_now(env.data)

    def drive(joints: Array, margins: Margins) -> None:
        find_free_path(env.scene, env.data, here, stand, held, joints, margins_m=(margins,), checker=checker)

    for margins in SPARES_M:
        searches: list[float] = []
        far = 0
        for pose in _free_there(env, checker, held, stand, poses, margins[1]):
            if searches.count(pose.arm_turn) == MOST_ALIKE:
                continue
            if len(searches) == MOST_SEARCHES:
                break
            searches.append(pose.arm_turn)
            try:
                drive(pose.joints, margins)
            except ShutInError:
                continue
            except NoPlanError:  # which took long
                far += 1
                if far == MOST_FAR:
                    break
                continue
            plan = _plan(env, obj, held, [WaypointPath((pose.target,))], 0)
            if plan is None or plan.cost > MOST_COST:
                continue
            with contextlib.suppress(NoPlanError):
                drive(plan.joints[-1], margins)  # with the elbow there
                return plan
    return None


def _turned(env: KitchenEnv, obj: Graspable, stand: RobotPose, towards: Array | None) -> list[_Folded]:
    """Folded poses with the arm turned to all sides, those first that point to where the object is to go."""
    base, yaw = base_pose(env.data)
    bearing = 0.0
    if towards is not None:
        bearing = wrap(float(np.arctan2(towards[1] - stand.y, towards[0] - stand.x)) - stand.yaw)
    ahead, present = _folded(env, obj, base, yaw), _present(env)
    turns, targets, costs = [], [], []
    for turn, (target, cost) in itertools.product(ARM_TURNS, ahead):
        about = rotation_about(UP, turn)
        turns.append(turn)
        targets.append(HandTarget(base + about @ (target.position - base), about @ target.rotation))
        costs.append(cost + AWAY_COST * abs(wrap(turn - bearing)))
    starts = np.tile(present, (len(turns), 1))
    starts[:, 0] += turns
    joints, good = _solved(env, targets, starts)
    found = [_Folded(targets[i], joints[i], turns[i], costs[i]) for i in np.flatnonzero(good)]
    return sorted(found, key=lambda pose: pose.cost)


def _free_there(
    env: KitchenEnv,
    checker: CollisionChecker,
    held: Held,
    stand: RobotPose,
    poses: list[_Folded],
    margin_m: float,
) -> Iterator[_Folded]:
    """Those of folded poses that meet nothing here, nor at one place at least near where the base is to come."""
    ends = Room(env.scene).near(stand)
    if not ends:
        return
    places = np.array([(end.x, end.y, end.yaw) for end in ends])
    for pose in poses:
        here = checker.free(checker.present_base, pose.joints[None], held=held)
        if here.all() and checker.free(places, pose.joints[None], held=held, margin_m=margin_m).any():
            yield pose


def _home_height(env: KitchenEnv) -> float:
    """Height of the grip site with the arm as at the start of an episode, metres."""
    arm = Arm(env.model, env.data, env.scene.robot)
    (position,), (turn,) = arm.forward(arm.home[None])
    return float(in_room(env, position, turn).position[2])
