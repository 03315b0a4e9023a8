"""Driving the base: a planned path, followed in short steps."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    DEAD_ZONE,
    DEAD_ZONES,
    FROM_DESIRED,
    OPEN,
    Array,
    action,
    base_pose,
    limit,
)
from robocasa_lerobot.demos.planning.base_path import HELD_MARGINS_M, Room, base_now, carried, find_path, wrap
from robocasa_lerobot.demos.planning.base_room import between
from robocasa_lerobot.demos.planning.collision import Held, is_full
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.scene.scene import Scene

__all__ = ["Room", "drive_to", "plan_base_path"]

MOVE_GAIN, TURN_GAIN = 2.5, 2.0  # per second
WAYPOINT_M, WAYPOINT_RAD = 0.12, 0.25
TIGHT = (0.04, 0.08)  # the same where there is little room for what is carried, metres and radians
CAREFULLY = (0.3, 0.4)  # greatest speeds there, of moves and turns, as commands beyond the dead zones
LEG_M, LEG_RAD = 0.15, 0.25  # of a move with something in the hand, along which place and heading change alike
ARRIVED_M, ARRIVED_RAD = 0.02, 0.03
STALL_STEPS, STALL_M = 30, 0.01
# Of the base's commands with a full vessel in the hand: greatest change from one step to the next, and of braking.
LOADED_CHANGE, LOADED_BRAKE = 0.08, 0.2


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
        SkillError: there is no path, or the base got stuck.
    """
    held = held or (carried(env.scene, env.data) if gripper == CLOSED else None)
    path = find_path(env.scene, env.data, base_now(env.data), RobotPose(x, y, yaw), held)
    loaded = is_full(held)
    tight = loaded or (held is not None and path.margin_m < HELD_MARGINS_M[1][0])
    pace = Pace(most=CAREFULLY if tight else None, smooth=loaded)
    poses = path.poses
    if held is not None:  # turned on the way as it was tested
        places = [base_now(env.data), *poses]
        poses = [
            pose for one, other in itertools.pairwise(places) for pose in (*between(one, other, LEG_M, LEG_RAD), other)
        ]
    for index, pose in enumerate(poses):
        last = index == len(poses) - 1
        bounds = (tolerance_m, tolerance_rad) if last else TIGHT if held is not None else (WAYPOINT_M, WAYPOINT_RAD)
        yield from _approach(env, pose, gripper, bounds, pace, stop=last)


@dataclass
class Pace:
    """How fast the base may drive, and how fast its commands may change.

    Attributes:
        most: greatest speeds of moves and turns, as commands beyond the dead zones; None takes the base's own.
        smooth: whether it speeds up and brakes softly, since something may fall from what is carried.
    """

    most: tuple[float, float] | None = None
    smooth: bool = False

    def __post_init__(self) -> None:
        self._before = np.zeros(4)

    def next(self, wanted: Array) -> Array:
        """The command (4,) that comes next, instead of the one that is wanted."""
        if not self.smooth:
            return wanted
        # Within its dead zone a command does nothing: it is left at once.
        still = np.abs(self._before) < DEAD_ZONES
        before = np.where(still, np.sign(wanted) * np.minimum(DEAD_ZONES, np.abs(wanted)), self._before)
        slower = np.where(np.abs(wanted) < np.abs(before), LOADED_BRAKE, LOADED_CHANGE)
        self._before = before + np.clip(wanted - before, -slower, slower)
        return self._before


def plan_base_path(scene: Scene, start: RobotPose, goal: RobotPose) -> list[RobotPose]:
    """Poses from a start to a goal round the fixtures with all doors shut, both left out but the goal.

    Raises:
        SkillError: there is none.
    """
    return find_path(scene, None, start, goal).poses


def _approach(
    env: KitchenEnv, goal: RobotPose, gripper: float, bounds: tuple[float, float], pace: Pace, *, stop: bool
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
            raise SkillError(f"the base is stuck {left * 100:.0f} cm and {np.rad2deg(turn):.0f} degrees from its path")
        command = pace.next(_base_command(error, turn, heading, pace.most, stop=stop))
        yield action(gripper=gripper, base=command, mode=FROM_DESIRED)


def _base_command(error: Array, turn: float, heading: float, most: tuple[float, float] | None, *, stop: bool) -> Array:
    """Base command (4,): forwards, to the left, turn, torso; with the dead zones made up for."""
    c, s = np.cos(heading), np.sin(heading)
    speed = (MOVE_GAIN if stop else 3 * MOVE_GAIN) * np.array(
        [c * error[0] + s * error[1], -s * error[0] + c * error[1]]
    )
    if most is not None:  # so that it goes straight, which commands that are limited as they are do not
        speed, turn = limit(speed, most[0]), float(np.clip(turn, -most[1] / TURN_GAIN, most[1] / TURN_GAIN))
    command = np.zeros(4)
    for axis in range(2):
        if abs(speed[axis]) > 0.01:
            command[axis] = speed[axis] + np.sign(speed[axis]) * DEAD_ZONE
    if abs(turn) > 0.01:
        command[2] = (TURN_GAIN * turn + np.sign(turn) * 0.167) / 1.5
    command[:2] = limit(command[:2], 1.0)
    command[2] = np.clip(command[2], -1.0, 1.0)
    return command
