"""Short moves of the base, with the arm carried as it is."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import (
    FROM_DESIRED,
    Array,
    action,
    base_pose,
    limit,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import (
    MOBILE_BASE,
)
from robocasa_lerobot.envs.scene.bodies import subtree

# Of base_motion, a command below this moves nothing (docs/robocasa.md, section 2).
_DEAD_ZONE = 0.25
_BASE_TOLERANCE_M = 0.02


def shift_base(env: KitchenEnv, shift: tuple[float, float], gripper: float, max_steps: int = 60) -> Iterator[Array]:
    """Drive by metres forward and to the left; heading kept, the arm rides along."""
    start, yaw = base_pose(env.data)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    goal = start + ahead * shift[0] + left * shift[1]
    for _ in range(max_steps):
        position, now = base_pose(env.data)
        away = goal - position
        if float(np.hypot(away[0], away[1])) < _BASE_TOLERANCE_M:
            break
        ahead, left = np.array([np.cos(now), np.sin(now), 0.0]), np.array([-np.sin(now), np.cos(now), 0.0])
        wanted = limit(np.array([away @ ahead, away @ left]) * 2.5, 0.5)
        turn = float(np.arctan2(np.sin(yaw - now), np.cos(yaw - now)))
        command = [_beyond_dead_zone(float(v)) for v in (*wanted, turn if abs(turn) > 0.02 else 0.0)]
        yield action(gripper=gripper, base=np.array([*command, 0.0]), mode=FROM_DESIRED)
    for _ in range(3):
        yield action(gripper=gripper, mode=FROM_DESIRED)


def _beyond_dead_zone(command: float) -> float:
    if abs(command) < 0.01:
        return 0.0
    return float(np.clip(command + np.sign(command) * _DEAD_ZONE, -1.0, 1.0))


def collisions(model: mujoco.MjModel, data: mujoco.MjData, allowed: frozenset[int]) -> int:
    """Number of bodies that the robot would touch or enter, but for those allowed."""
    mujoco.mj_collision(model, data)
    if data.ncon == 0:
        return 0
    robot = subtree(model, MOBILE_BASE)
    pairs = model.geom_bodyid[data.contact.geom]
    touched = {
        int(other)
        for (a, b), distance in zip(pairs, data.contact.dist, strict=True)
        for mine, other in ((a, b), (b, a))
        if robot[mine] and not robot[other] and distance < 0.0
    }
    return len(touched - allowed)
