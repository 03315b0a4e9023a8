"""Driving the base: a planned path, followed in short steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, FROM_DESIRED, OPEN, Array, action, base_pose, limit
from robocasa_lerobot.demos.planning.base_path import Room, base_now, carried, find_path, wrap
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.scene.scene import Scene

__all__ = ["Room", "drive_to", "find_way"]

# A base at rest answers to commands above these only (docs/robocasa.md, section 2): metres and radians a second are
# |command| - 0.25 and 1.5 |command| - 0.167.
DEAD_ZONE, TURN_DEAD_ZONE = 0.25, 0.11
MOVE_GAIN, TURN_GAIN = 2.5, 2.0  # per second
WAYPOINT_M, WAYPOINT_RAD = 0.12, 0.25
ARRIVED_M, ARRIVED_RAD = 0.02, 0.03
STALL_STEPS, STALL_M = 30, 0.01


def drive_to(
    env: KitchenEnv,
    x: float,
    y: float,
    yaw: float,
    *,
    gripper: float = OPEN,
    held: Held | None = None,
    tolerance_m: float = ARRIVED_M,
    tolerance_rad: float = ARRIVED_RAD,
) -> Iterator[Array]:
    """Drive the base centre to a place (metres) and heading (radians), round what stands there now.

    With a closed gripper `held` goes along, or else the object that both fingers touch.

    Raises:
        SkillError: there is no way, or the base got stuck.
    """
    held = held or (carried(env.scene, env.data) if gripper == CLOSED else None)
    path = find_path(env.scene, env.data, base_now(env.data), RobotPose(x, y, yaw), held)
    for index, pose in enumerate(path):
        last = index == len(path) - 1
        bounds = (tolerance_m, tolerance_rad) if last else (WAYPOINT_M, WAYPOINT_RAD)
        yield from _approach(env, pose, gripper, bounds, stop=last)


def find_way(scene: Scene, start: RobotPose, goal: RobotPose) -> list[RobotPose]:
    """Poses from a start to a goal round the fixtures with all doors shut, both left out but the goal.

    Raises:
        SkillError: there is none.
    """
    return find_path(scene, None, start, goal)


def _approach(
    env: KitchenEnv, goal: RobotPose, gripper: float, bounds: tuple[float, float], *, stop: bool
) -> Iterator[Array]:
    best, since = np.inf, 0
    while True:
        position, heading = base_pose(env.data)
        error = np.array([goal.x - position[0], goal.y - position[1]])
        turn = wrap(goal.yaw - heading)
        left = float(np.linalg.norm(error))
        if left < bounds[0] and abs(turn) < bounds[1]:
            return
        if left + 0.3 * abs(turn) < best - STALL_M:
            best, since = left + 0.3 * abs(turn), 0
        else:
            since += 1
        if since > STALL_STEPS:
            if stop and left < 3 * bounds[0] and abs(turn) < 3 * bounds[1]:
                return
            raise SkillError(f"the base is stuck {left * 100:.0f} cm and {np.rad2deg(turn):.0f} degrees from its way")
        yield action(gripper=gripper, base=_base_command(error, turn, heading, stop=stop), mode=FROM_DESIRED)


def _base_command(error: Array, turn: float, heading: float, *, stop: bool) -> Array:
    """Base command (4,): forwards, to the left, turn, torso; with the dead zones made up for."""
    c, s = np.cos(heading), np.sin(heading)
    speed = (MOVE_GAIN if stop else 3 * MOVE_GAIN) * np.array(
        [c * error[0] + s * error[1], -s * error[0] + c * error[1]]
    )
    command = np.zeros(4)
    for axis in range(2):
        if abs(speed[axis]) > 0.01:
            command[axis] = speed[axis] + np.sign(speed[axis]) * DEAD_ZONE
    if abs(turn) > 0.01:
        command[2] = (TURN_GAIN * turn + np.sign(turn) * 0.167) / 1.5
    command[:2] = limit(command[:2], 1.0)
    command[2] = np.clip(command[2], -1.0, 1.0)
    return command
