"""Carry what the hand holds to another place: arm folded, gripper closed, a vessel level."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    floor_axes,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.base_path import Room, wrap
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.reaching import MOST_DRIVES, WaypointPath, lead, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

# A point is in reach where it is before the robot, not farther aside, and this near, or where such a place is free.
LEAST_AHEAD_M, MOST_ASIDE_M, NEAR_M = 0.15, 0.75, 0.72
STAND_AHEAD_M, STAND_ASIDE_M = (0.45, 0.55, 0.65, 0.75), (0.0, -0.15, 0.15, -0.3, 0.3)
# Places to stand round a point: distances, the best first, and headings; costs in metres of driving.
STAND_FAR_M, DIRECTIONS = (0.58, 0.52, 0.64, 0.70, 0.76, 0.82), 16
FAR_COST, ASKEW_COST = 4.0, 0.5
OTHER_M = 0.25  # places nearer than this to each other count as the same
FOLDED_M = (0.42, 0.48, 0.36)  # of the grip site before the base's centre while an object is carried
RISES_M = (0.0, 0.08, 0.15)  # over the height that the hand has at home
TURNS = tuple(float(turn) for turn in np.deg2rad((0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0)))


def in_reach(env: KitchenEnv, point: Array) -> bool:
    """Whether a point is before the robot, and so near that a small drive, the heading kept, is enough."""
    base, yaw = base_pose(env.data)
    axes = floor_axes(yaw)
    ahead, left = axes @ (point - base)
    if ahead < LEAST_AHEAD_M or abs(left) > MOST_ASIDE_M:
        return False
    if np.hypot(ahead, left) < NEAR_M:
        return True
    room = Room(env.scene)
    stands = (point - far * axes[0] - aside * axes[1] for far in STAND_AHEAD_M for aside in STAND_ASIDE_M)
    return any(room.free(RobotPose(float(x), float(y), yaw)) for x, y, _ in stands)


def standing_pose_for(
    env: KitchenEnv, fixture: Fixture, point: Array, other_than: Sequence[RobotPose] = ()
) -> RobotPose:
    """Where to stand to reach a point of a fixture: near it, square to the fixture's sides where there is room.

    Places near those of `other_than` are left out.

    Raises:
        SkillError: no place is free from where the arm reaches the point.
    """
    base, _ = base_pose(env.data)
    found: list[tuple[float, RobotPose]] = []
    for turn in range(DIRECTIONS):
        yaw = wrap(fixture.yaw + 2 * np.pi * turn / DIRECTIONS)
        askew = abs(np.sin(2 * (yaw - fixture.yaw)))
        for far in STAND_FAR_M:
            x, y, _ = (point - far * floor_axes(yaw)[0]).tolist()
            cost = FAR_COST * abs(far - STAND_FAR_M[0]) + ASKEW_COST * askew + float(np.hypot(x - base[0], y - base[1]))
            if all(np.hypot(x - other.x, y - other.y) > OTHER_M for other in other_than):
                found.append((cost, RobotPose(x, y, yaw)))
    found.sort(key=lambda pair: pair[0])
    poses = [pose for _, pose in found]
    free = _free(env, poses)
    if not free.any():
        raise SkillError(f"there is no room to stand before {fixture.name}")
    return poses[int(np.argmax(free))]


def _free(env: KitchenEnv, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
    """Where the robot, its arm folded, meets neither a fixture nor a door or drawer as it stands now, (n,)."""
    free = Room(env.scene).all_free(poses)
    bases = np.array([(pose.x, pose.y, pose.yaw) for pose in poses])[free]
    if len(bases):
        home = np.tile(np.array(PANDA_OMRON.home.arm), (len(bases), 1))
        free[free] = CollisionChecker(env.model, env.data).free(bases, home)
    return free


def go_to_object(env: KitchenEnv, name: str, other_than: Sequence[RobotPose] = ()) -> Iterator[Array]:
    """Drive to where an object lies, with an empty hand, unless it is in reach; or in any case to another place."""
    point = env.data.body(name).xpos.copy()
    fixture = locate(env, name).fixture
    if fixture is not None and (other_than or not in_reach(env, point)):
        yield from _fold_empty(env)
        stand = standing_pose_for(env, fixture, point, other_than)
        yield from drive_to(env, stand.x, stand.y, stand.yaw, gripper=OPEN)


def carry_to(env: KitchenEnv, obj: Graspable, stand: RobotPose) -> Iterator[Array]:
    """Fold the arm with what is in the hand, and drive.

    Raises:
        SkillError: there is no path, or the base got stuck.
    """
    yield from fold_with(env, obj)
    held = Held.now(env.data, obj.name, obj.contents)
    yield from drive_to(env, stand.x, stand.y, stand.yaw, gripper=CLOSED, held=held)


def fold_with(env: KitchenEnv, obj: Graspable) -> Iterator[Array]:
    """Bring the hand near its home with an object in it: turned about the vertical alone, so that it stays level."""
    base, yaw = base_pose(env.data)
    held = Held.now(env.data, obj.name, obj.contents)
    here = RobotPose(float(base[0]), float(base[1]), yaw)
    found = plan_reach(
        env, _folded(env, base, yaw), grip_position(env.data), key=1, held=held, loaded=1,
        allowed=obj.bodies | obj.carried, blocked=[here] * MOST_DRIVES,
    )  # fmt: skip
    if found:
        yield from lead(env, found[0].joints, CLOSED)
        yield from move_hand(env.data, found[0].path.targets[1], CLOSED, tolerance=0.03, max_steps=60)


def _folded(env: KitchenEnv, base: Array, yaw: float) -> list[WaypointPath]:
    ahead = floor_axes(yaw)[0]
    present, grip = hand_rotation(env.data), grip_position(env.data)
    home = _home_height(env)
    found = []
    for out in FOLDED_M:
        for rise in RISES_M:
            for turn in TURNS:
                rotation = rotation_about(UP, turn) @ present
                point = np.array([*(base + out * ahead)[:2], home + rise])
                above = np.array([*grip[:2], max(grip[2], home)])
                targets = (HandTarget(above, present), HandTarget(point, rotation))
                found.append(WaypointPath(targets, 0.1 * abs(turn) + rise + abs(out - FOLDED_M[0])))
    return found


def _home_height(env: KitchenEnv) -> float:
    """Height of the grip site with the arm as at the start of an episode, metres."""
    arm = Arm(env.model, env.data)
    position, _ = arm.forward(np.array([PANDA_OMRON.home.arm]))
    frame = env.data.site(PANDA_OMRON.names.arm_center_site)
    return float((frame.xpos + frame.xmat.reshape(3, 3) @ position[0])[2])


def _fold_empty(env: KitchenEnv) -> Iterator[Array]:
    with contextlib.suppress(SkillError):
        yield from lead(env, np.array(PANDA_OMRON.home.arm), OPEN)
