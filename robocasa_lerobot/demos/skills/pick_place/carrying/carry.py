"""Carry what the hand holds to another place: arm folded, gripper closed, a vessel level."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
    base_pose,
    floor_axes,
)
from robocasa_lerobot.demos.planning.base_path import Room, wrap
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place.carrying.fold_held import fold_with
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import unless_lost
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import move_torso
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.reaching import free_stands
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

# A point is in reach where it is before the robot, not farther aside, and this near, or where such a place is free.
LEAST_AHEAD_M, MOST_ASIDE_M, NEAR_M = 0.15, 0.75, 0.72
# Places to stand round a point: distances, the best first, and headings; costs in metres of driving.
STAND_FAR_M, DIRECTIONS = (0.58, 0.52, 0.64, 0.70, 0.76, 0.82), 16
FAR_COST, ASKEW_COST = 4.0, 0.5
# Of the point to the robot's left; to its side only where there is no room straight before it: by an open oven's door,
# and farther still before what is in a corner.
ASIDES_M = ((0.0,), (0.15, -0.15, 0.3, -0.3), (0.45, -0.45, 0.6, -0.6), (0.67, -0.67))
OTHER_M, OTHER_RAD = 0.25, 0.35  # places nearer than this to each other, and turned less, count as the same


def in_reach(env: KitchenEnv, point: Array) -> bool:
    """Whether a point is before the robot, and so near that a small drive, the heading kept, is enough."""
    base, yaw = base_pose(env.data)
    ahead, left = floor_axes(yaw) @ (point - base)
    if ahead < LEAST_AHEAD_M or abs(left) > MOST_ASIDE_M:
        return False
    if np.hypot(ahead, left) < NEAR_M:
        return True
    return next(free_stands(env, point), None) is not None


def standing_pose_for(
    env: KitchenEnv,
    fixture: Fixture,
    point: Array,
    other_than: Sequence[RobotPose] = (),
    towards: Array | None = None,
) -> RobotPose:
    """Where to stand to reach a point of a fixture: near it, square to the fixture's sides where there is room.

    Places near those of `other_than` are left out; those are better that are near a point `towards` which it goes.

    Raises:
        SkillError: no place is free from where the arm reaches the point.
    """
    for asides in ASIDES_M:
        stands = _stands_round(env, fixture, point, asides, towards)
        poses = [pose for pose in stands if _lies_apart(pose, other_than)]
        free = _free(env, poses)
        if free.any():
            return poses[int(np.argmax(free))]
    raise SkillError(f"there is no room to stand before {fixture.name}")


def _lies_apart(pose: RobotPose, others: Sequence[RobotPose]) -> bool:
    return all(
        np.hypot(pose.x - other.x, pose.y - other.y) > OTHER_M or abs(wrap(pose.yaw - other.yaw)) > OTHER_RAD
        for other in others
    )


def _stands_round(
    env: KitchenEnv, fixture: Fixture, point: Array, asides: Sequence[float], towards: Array | None
) -> list[RobotPose]:
    """Places round a point, which lies ahead or as far to the left as that, metres; the best first."""
    base, _ = base_pose(env.data)
    found: list[tuple[float, RobotPose]] = []
    for turn, far, aside in itertools.product(range(DIRECTIONS), STAND_FAR_M, asides):
        yaw = wrap(fixture.yaw + 2 * np.pi * turn / DIRECTIONS)
        ahead, left = floor_axes(yaw)
        askew = abs(np.sin(2 * (yaw - fixture.yaw)))
        x, y, _ = (point - far * ahead - aside * left).tolist()
        cost = FAR_COST * abs(far - STAND_FAR_M[0]) + ASKEW_COST * askew + float(np.hypot(x - base[0], y - base[1]))
        if towards is not None:
            cost += float(np.hypot(x - towards[0], y - towards[1]))
        found.append((cost, RobotPose(x, y, yaw)))
    found.sort(key=lambda pair: pair[0])
    return [pose for _, pose in found]


def _free(env: KitchenEnv, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
    """Where the robot, its arm folded, meets neither a fixture nor a door or drawer as it stands now, (n,)."""
    free = Room(env.scene).all_free(poses)
    bases = np.array([(pose.x, pose.y, pose.yaw) for pose in poses])[free]
    if len(bases):
        checker = CollisionChecker(env.scene, env.data)
        free[free] = checker.free(bases, checker.arm.home)
    return free


def go_to_object(
    env: KitchenEnv, name: str, other_than: Sequence[RobotPose] = (), towards: Array | None = None
) -> Iterator[Array]:
    """Drive to where an object lies, with an empty hand, unless it is in reach; or in any case to another place.

    With a point `towards` which it goes then, rather to that side of it.
    """
    point = env.data.body(name).xpos.copy()
    fixture = locate(env, name).fixture
    if fixture is not None and (other_than or not in_reach(env, point)):
        yield from fold_arm(env)
        stand = standing_pose_for(env, fixture, point, other_than, towards)
        yield from drive_to(env, stand.x, stand.y, stand.yaw, gripper=OPEN)


def carry_to(env: KitchenEnv, obj: Graspable, stand: RobotPose, towards: Array | None = None) -> Iterator[Array]:
    """Fold the arm with what is in the hand so that there is a path for all of that, and drive.

    Args:
        env: the kitchen.
        obj: in the hand.
        stand: where the base is to come.
        towards: where the object is to go from there, world, metres; None where that is not known.

    Raises:
        SkillError: there is no path, the base got stuck, or it slipped out of the hand.
    """
    yield from move_torso(env, 0.0, CLOSED, Held.now(env.data, obj.name, obj.contents))
    yield from unless_lost(env, obj, fold_with(env, obj, stand, towards))
    held = Held.now(env.data, obj.name, obj.contents)
    yield from unless_lost(env, obj, drive_to(env, stand.x, stand.y, stand.yaw, gripper=CLOSED, held=held))
