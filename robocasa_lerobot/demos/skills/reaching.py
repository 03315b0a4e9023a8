"""The planner under the names that skills call it by: which path the hand takes, from where the robot stands.

`demos/planning` has the planner; here it meets the driving.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import Array, base_pose
from robocasa_lerobot.demos.planning.base_path import Room
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.costs import REACHING
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.planning.motion_planner import MotionPlanner, WaypointPath
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

__all__ = ["GOOD_ENOUGH", "Held", "ReachPlan", "WaypointPath", "approach", "go_to", "lead", "plan_reach"]

GOOD_ENOUGH = REACHING.good_enough  # cost up to which no other place to stand is looked at
AHEAD_M, LEFT_M = (0.45, 0.55, 0.65, 0.75), (0.0, -0.15, 0.15, -0.3, 0.3)
FOLDED_RAD = 0.35
ARRIVED_M, BLOCKED_M, MOST_DRIVES = 0.05, 0.10, 3


@dataclass(frozen=True)
class ReachPlan:
    """A path, where to stand, the cost (from about 2 on it will not do), and the joint path to its first pose.

    Attributes:
        joints: (7,) radians at the first pose, or (k, 7) where the arm goes round something.
    """

    path: WaypointPath
    stand: RobotPose | None
    cost: float
    joints: Array


def plan_reach(
    env: KitchenEnv,
    ways: Sequence[WaypointPath],
    point: Array,
    *,
    key: int,
    held: Held | None = None,
    loaded: int = 0,
    allowed: frozenset[int] = frozenset(),
    blocked: Sequence[RobotPose] = (),
) -> list[ReachPlan]:
    """The paths that cost least, best first, from where the robot stands or from where it could.

    Args:
        env: its state is read, not touched.
        ways: alternatives.
        point: what the robot stands before, world, metres.
        key: index of the pose that is solved first.
        held: what is in the gripper.
        loaded: number of poses, from the first on, at which it still is.
        allowed: bodies that the robot may touch.
        blocked: places that the base did not get to.
    """
    if not ways:
        return []
    planner = MotionPlanner(env, ways, key, held=held, loaded=loaded, allowed=allowed)
    found = planner.best([None])
    if not ((found and found[0].cost <= GOOD_ENOUGH) or len(blocked) >= MOST_DRIVES):
        stands = [s for s in _stands(env, point) if all(np.hypot(s.x - b.x, s.y - b.y) > BLOCKED_M for b in blocked)]
        found = sorted(found + planner.best(stands), key=lambda plan: plan.cost)
    return [ReachPlan(p.path, p.base, p.cost, p.joints if len(p.joints) > 1 else p.joints[0]) for p in found]


def approach(
    env: KitchenEnv, plan: Callable[[Sequence[RobotPose]], ReachPlan], gripper: float
) -> Generator[Array, None, ReachPlan]:
    """Choose a path and drive to where it begins; choose another one where the base does not get there."""
    blocked: list[RobotPose] = []
    while True:
        choice = plan(blocked)
        if choice.stand is None:
            return choice
        yield from go_to(env, choice.stand, gripper)
        base, _ = base_pose(env.data)
        if np.hypot(choice.stand.x - base[0], choice.stand.y - base[1]) < ARRIVED_M:
            return choice
        blocked.append(choice.stand)


def lead(env: KitchenEnv, joints: Array, gripper: float) -> Iterator[Array]:
    """Lead the hand along a joint path, (7,) or (k, 7) radians: the one that has been tested."""
    yield from follow_joint_path(env, joints, gripper)


def go_to(env: KitchenEnv, stand: RobotPose, gripper: float) -> Iterator[Array]:
    """Drive with the arm folded as at the start, as near as it gets."""
    home, arm = np.array(PANDA_OMRON.home.arm), Arm(env.model, env.data)
    if np.abs(env.data.qpos[arm.addresses] - home).max() > FOLDED_RAD:
        yield from lead(env, home, gripper)
    with contextlib.suppress(SkillError):
        yield from drive_to(env, stand.x, stand.y, stand.yaw, gripper=gripper, tolerance_m=0.025)


def _stands(env: KitchenEnv, point: Array) -> Iterator[RobotPose]:
    """Free places from where a point is ahead, the heading kept."""
    _, yaw = base_pose(env.data)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    room = Room(env.scene)
    for far in AHEAD_M:
        for aside in LEFT_M:
            x, y = (point[:2] - far * ahead - aside * left).tolist()
            pose = RobotPose(x, y, yaw)
            if room.free(pose):
                yield pose
