"""Short moves of the base, with the arm carried as it is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    DEAD_ZONE,
    FROM_DESIRED,
    Array,
    action,
    base_pose,
    floor_axes,
    limit,
)
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

_BASE_TOLERANCE_M = 0.02


def shift_base(env: KitchenEnv, shift: tuple[float, float], gripper: float, max_steps: int = 60) -> Iterator[Array]:
    """Drive by metres forward and to the left; heading kept, the arm rides along."""
    start, yaw = base_pose(env.data)
    goal = start + np.asarray(shift) @ floor_axes(yaw)
    for _ in range(max_steps):
        position, now = base_pose(env.data)
        away = goal - position
        if float(np.hypot(away[0], away[1])) < _BASE_TOLERANCE_M:
            break
        wanted = limit(floor_axes(now) @ away * 2.5, 0.5)
        turn = wrap(yaw - now)
        command = [_beyond_dead_zone(float(v)) for v in (*wanted, turn if abs(turn) > 0.02 else 0.0)]
        yield action(gripper=gripper, base=np.array([*command, 0.0]), mode=FROM_DESIRED)
    for _ in range(3):
        yield action(gripper=gripper, mode=FROM_DESIRED)


def _beyond_dead_zone(command: float) -> float:
    if abs(command) < 0.01:
        return 0.0
    return float(np.clip(command + np.sign(command) * DEAD_ZONE, -1.0, 1.0))
