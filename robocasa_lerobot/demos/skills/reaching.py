"""The planner under the names that skills call it by: which path the hand takes, from where the robot stands.

`demos/planning` has the planner; here it meets the driving.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, OPEN, Array, HandTarget, arm_action, base_pose, floor_axes
from robocasa_lerobot.demos.planning.base_path import Room
from robocasa_lerobot.demos.planning.collision import Held, is_full
from robocasa_lerobot.demos.planning.costs import REACHING
from robocasa_lerobot.demos.planning.follow import GENTLY, follow_joint_path
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.planning.motion_planner import MotionPlan, MotionPlanner, WaypointPath
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.fold import FOLDED_RAD, fold_arm, fold_holding
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

__all__ = [
    "GOOD_ENOUGH",
    "MOST_DRIVES",
    "Held",
    "MotionPlan",
    "WaypointPath",
    "approach",
    "approach_by",
    "follow_with",
    "free_stands",
    "go_to",
    "is_blocked",
    "plan_reach",
]

GOOD_ENOUGH = REACHING.good_enough  # cost up to which no other place to stand is looked at
STAND_AHEAD_M, STAND_ASIDE_M = (0.45, 0.55, 0.65, 0.75), (0.0, -0.15, 0.15, -0.3, 0.3)  # of a point to reach
GENTLE = 0.7  # bound of the arm's commands with a vessel in the hand from which something may fall
ARRIVED_M, BLOCKED_M, MOST_DRIVES = 0.05, 0.10, 3


def plan_reach(
    env: KitchenEnv,
    paths: Sequence[WaypointPath],
    point: Array,
    *,
    key: int,
    held: Held | None = None,
    loaded: int = 0,
    allowed: frozenset[int] = frozenset(),
    blocked: Sequence[RobotPose] = (),
    may_drive: bool = True,
    may_stay: bool = True,
) -> list[MotionPlan]:
    """The paths that cost least, best first, from where the robot stands or from where it could.

    Args:
        env: its state is read, not touched.
        paths: alternatives.
        point: what the robot stands before, world, metres.
        key: index of the pose that is solved first.
        held: what is in the gripper.
        loaded: number of poses, from the first on, at which it still is.
        allowed: bodies that the robot may touch.
        blocked: places that the base did not get to; after `MOST_DRIVES` of them it stays where it is.
        may_drive: whether the base may go elsewhere at all.
        may_stay: whether it may stay where it is, if there is another place.
    """
    if not paths:
        return []
    planner = MotionPlanner(env, paths, key, held=held, loaded=loaded, allowed=allowed)
    found = planner.best([None])
    good = may_stay and bool(found) and found[0].cost - found[0].path.drawn <= GOOD_ENOUGH
    if may_drive and not good and len(blocked) < MOST_DRIVES:
        others = free_stands(env, point)
        stands = [stand for stand in others if not is_blocked(stand, blocked)]
        elsewhere = planner.best(stands, folded=not is_full(held))
        found = sorted((found if may_stay or not elsewhere else []) + elsewhere, key=lambda plan: plan.cost)
    return found


def approach(
    env: KitchenEnv, plan: Callable[[Sequence[RobotPose]], MotionPlan], gripper: float, held: Held | None = None
) -> Generator[Array, None, MotionPlan]:
    """Choose a path and drive to where it begins; choose another one where the base does not get there.

    With a full vessel in the hand the arm stays as it is on the drive.
    """
    return (yield from approach_by(env, plan, lambda choice, stand: go_to(env, stand, gripper, held)))


def approach_by(
    env: KitchenEnv,
    plan: Callable[[Sequence[RobotPose]], MotionPlan],
    drive: Callable[[MotionPlan, RobotPose], Iterator[Array]],
) -> Generator[Array, None, MotionPlan]:
    """The same with drives of another kind: `drive` is given a plan and where it begins."""
    blocked: list[RobotPose] = []
    while True:
        choice = plan(blocked)
        if choice.base is None:
            return choice
        yield from drive(choice, choice.base)
        base, _ = base_pose(env.data)
        if np.hypot(choice.base.x - base[0], choice.base.y - base[1]) < ARRIVED_M:
            return choice
        blocked.append(choice.base)


def is_blocked(stand: RobotPose, blocked: Sequence[RobotPose]) -> bool:
    """Whether a stand is about one of those that the base did not get to."""
    return any(np.hypot(stand.x - one.x, stand.y - one.y) <= BLOCKED_M for one in blocked)


def follow_with(env: KitchenEnv, joints: Array, held: Held) -> Iterator[Array]:
    """Lead the hand along a joint path (k, 7) radians with an object in it; a full vessel slowly, and upright."""
    if not is_full(held):
        yield from follow_joint_path(env, joints, CLOSED)
        return

    def gently(target: HandTarget, gripper: float) -> Array:
        return arm_action(env.data, target, gripper, speed=GENTLE)

    yield from follow_joint_path(env, joints, CLOSED, GENTLY, gently, level=True)


def go_to(env: KitchenEnv, stand: RobotPose, gripper: float, held: Held | None = None) -> Iterator[Array]:
    """Drive as near as it gets, the arm folded as at the start, unless it holds a vessel with something in it."""
    if gripper == OPEN:
        yield from fold_arm(env)
    arm = Arm(env.model, env.data, env.scene.robot)
    full = is_full(held)
    if not full and np.abs(env.data.qpos[arm.addresses] - arm.home).max() > FOLDED_RAD:
        yield from follow_joint_path(env, arm.home, gripper) if held is None else fold_holding(env, held)
    with contextlib.suppress(SkillError):
        yield from drive_to(
            env, stand.x, stand.y, stand.yaw, gripper=gripper, held=held if full else None, tolerance_m=0.025
        )


def free_stands(env: KitchenEnv, point: Array) -> Iterator[RobotPose]:
    """Free places from where a point (3,) is ahead, the heading kept; the fixtures' footprints are asked."""
    _, yaw = base_pose(env.data)
    ahead, left = floor_axes(yaw)
    room = Room(env.scene)
    for far in STAND_AHEAD_M:
        for aside in STAND_ASIDE_M:
            x, y, _ = (point - far * ahead - aside * left).tolist()
            pose = RobotPose(x, y, yaw)
            if room.free(pose):
                yield pose
