"""Where the base stands for a segment: as it stood in the source, or as near to that as there is room."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.generate.select import Manner
from robocasa_lerobot.demos.motion import OPEN, Array, base_pose
from robocasa_lerobot.demos.planning.base_path import Room
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.reaching import go_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

ALIKE_M, ALIKE_RAD = 0.05, 0.1  # stands that count as one
HERE_M, HERE_RAD = 0.25, 0.35  # a robot that stands as near to a source's stand may stay
MOST_STANDS = 10
APART: tuple[float, ...] = (-0.12, 0.12)  # more stands, to the sides of the sources' and behind them, metres


def stands_like(env: KitchenEnv, wanted: Sequence[RobotPose], manner: Manner) -> list[RobotPose | None]:
    """Free stands near wanted ones, and staying where the robot is (None) where that is near one of them."""
    if manner.base == "fixed":
        return [None]
    if manner.base == "copy":
        return list(wanted)
    room = Room(env.scene)
    position, yaw = base_pose(env.data)
    out: list[RobotPose | None] = []
    found: list[RobotPose] = []
    for stand in [*wanted, *(_moved(stand, *move) for stand in wanted for move in _moves())]:
        if len(found) >= MOST_STANDS:
            break
        pose = room.nearest(stand)
        if room.free(pose) and not any(_alike(pose, other, ALIKE_M, ALIKE_RAD) for other in found):
            found.append(pose)
    here = RobotPose(float(position[0]), float(position[1]), yaw)
    if not found or any(_alike(here, stand, HERE_M, HERE_RAD) for stand in wanted):
        out.append(None)
    return [*out, *found]


def _moves() -> list[tuple[float, float]]:
    return [(-0.12, 0.0), *((0.0, aside) for aside in APART)]


def _moved(stand: RobotPose, ahead: float, left: float) -> RobotPose:
    cos, sin = np.cos(stand.yaw), np.sin(stand.yaw)
    return RobotPose(float(stand.x + cos * ahead - sin * left), float(stand.y + sin * ahead + cos * left), stand.yaw)


def _alike(one: RobotPose, other: RobotPose, most_m: float, most_rad: float) -> bool:
    return bool(np.hypot(one.x - other.x, one.y - other.y) < most_m) and abs(wrap(one.yaw - other.yaw)) < most_rad


def go_near(env: KitchenEnv, stand: RobotPose, gripper: float) -> Iterator[Array]:
    """Drive to a stand, the arm folded on the way; where the base does not get there it stays as near as it came."""
    if gripper != OPEN:
        yield from fold_arm(env)  # round what it has just pushed, with open fingers; they close on the drive
    with contextlib.suppress(SkillError):
        yield from go_to(env, stand, gripper)
