"""Driving the base: a planned path, followed in short steps."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
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

__all__ = ["Room", "drive_to"]

MOVE_GAIN, TURN_GAIN = 4.0, 2.0  # per second
ON_GAIN = 7.5  # the same of moves where a path goes on
# Ends of a path's pieces count as reached from so near, metres and radians; the same with something in the hand.
LOOSE, TIGHT = (0.06, 0.12), (0.04, 0.08)
CAREFULLY = (0.3, 0.4)  # greatest speeds there, of moves and turns, as commands beyond the dead zones
LEG_M, LEG_RAD = 0.15, 0.25  # of a piece of a path, along which place and heading change alike
SAME_DIRECTION = 0.85  # cosine of the angle between pieces that go on straight
LEAST_M, LEAST_RAD = 0.005, 0.01  # of a move and of a turn; less is none
MOST_M, MOST_RAD = 0.037, 0.066  # by which the base moves and turns in a control step at most, measured
FULL_M = 0.13  # from where on a move has its full speed
ARRIVED_M, ARRIVED_RAD = 0.02, 0.03
STALL_STEPS, STALL_M = 30, 0.01
# Greatest change of the base's commands from one step to the next, and of braking: with a full vessel in the hand, and
# with something else there, which slips in the fingers by and by.
SOFTLY, STEADILY = (0.08, 0.2), (0.15, 0.25)


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
    pace = Pace(CAREFULLY if tight else None, SOFTLY if loaded else STEADILY if held is not None else None)
    legs = _legs(base_now(env.data), path.poses)
    for leg in legs:
        last = leg is legs[-1]
        bounds = (tolerance_m, tolerance_rad) if last else TIGHT if held is not None else LOOSE
        yield from _approach(env, leg, gripper, bounds, pace, stop=last)


@dataclass(frozen=True)
class _Leg:
    """A short piece of a path.

    Attributes:
        goal: where it ends.
        beyond_m, beyond_rad: how far it goes on from there in the same direction, and turns to the same side.
    """

    goal: RobotPose
    beyond_m: float = 0.0
    beyond_rad: float = 0.0


def _legs(start: RobotPose, poses: Sequence[RobotPose]) -> list[_Leg]:
    """A path in pieces along which place and heading change alike, as they were tested."""
    places = [start, *poses]
    ends = [pose for one, other in itertools.pairwise(places) for pose in (*between(one, other, LEG_M, LEG_RAD), other)]
    legs, following = [_Leg(ends[-1])], ends[-1]
    for before, goal in zip([start, *ends][-3::-1], ends[-2::-1], strict=True):
        one = np.array([goal.x - before.x, goal.y - before.y])
        other = np.array([following.x - goal.x, following.y - goal.y])
        lengths = float(np.linalg.norm(one)), float(np.linalg.norm(other))
        turns = wrap(goal.yaw - before.yaw), wrap(following.yaw - goal.yaw)
        straight = float(one @ other) >= SAME_DIRECTION * lengths[0] * lengths[1] and min(lengths) > LEAST_M
        alike = turns[0] * turns[1] > 0.0
        beyond_m = lengths[1] + legs[-1].beyond_m if straight else 0.0
        beyond_rad = abs(turns[1]) + legs[-1].beyond_rad if alike else 0.0
        legs.append(_Leg(goal, beyond_m, beyond_rad))
        following = goal
    return legs[::-1]


@dataclass
class Pace:
    """How fast the base may drive, and how fast its commands may change.

    Attributes:
        most: greatest speeds of moves and turns, as commands beyond the dead zones; None takes the base's own.
        changes: greatest change of a command from one step to the next, and of braking, since something may fall from
            what is carried, or slip; None sets no bound.
    """

    most: tuple[float, float] | None = None
    changes: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        self._before = np.zeros(4)

    def next(self, wanted: Array) -> Array:
        """The command (4,) that comes next, instead of the one that is wanted."""
        if self.changes is None:
            return wanted
        # Within its dead zone a command does nothing: it is left at once.
        still = np.abs(self._before) < DEAD_ZONES
        before = np.where(still, np.sign(wanted) * np.minimum(DEAD_ZONES, np.abs(wanted)), self._before)
        slower = np.where(np.abs(wanted) < np.abs(before), self.changes[1], self.changes[0])
        self._before = before + np.clip(wanted - before, -slower, slower)
        return self._before


def _approach(
    env: KitchenEnv, leg: _Leg, gripper: float, bounds: tuple[float, float], pace: Pace, *, stop: bool
) -> Iterator[Array]:
    best, since, goal = np.inf, 0, leg.goal
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
        if not stop:
            error, turn = _ahead(error, turn, leg)
        command = pace.next(_base_command(error, turn, heading, pace.most, stop=stop))
        yield action(gripper=gripper, base=command, mode=FROM_DESIRED)


def _ahead(error: Array, turn: float, leg: _Leg) -> tuple[Array, float]:
    """What is left of a leg and of those that go on as it does, so that none of them is braked for but the last.

    Of a move and a turn that go together, the one that would be done before the other is slowed down.
    """
    left, angle = float(np.linalg.norm(error)), abs(turn)
    far, round_ = left + leg.beyond_m, angle + leg.beyond_rad
    if left > LEAST_M:
        error = error * (far / left)
    if angle > LEAST_RAD:
        turn *= round_ / angle
    if left > LEAST_M and angle > LEAST_RAD:
        steps_m, steps_rad = left / MOST_M, angle / MOST_RAD
        if steps_m > steps_rad:
            turn = float(np.clip(turn, -1.0, 1.0)) * steps_rad / steps_m
        else:
            error = error / far * min(far, FULL_M) * steps_m / steps_rad
    return error, turn


def _base_command(error: Array, turn: float, heading: float, most: tuple[float, float] | None, *, stop: bool) -> Array:
    """Base command (4,): forwards, to the left, turn, torso; with the dead zones made up for."""
    c, s = np.cos(heading), np.sin(heading)
    speed = (MOVE_GAIN if stop else ON_GAIN) * np.array([c * error[0] + s * error[1], -s * error[0] + c * error[1]])
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
