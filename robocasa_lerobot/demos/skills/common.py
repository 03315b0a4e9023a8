"""Moves that the skills share."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import Array, HandTarget, arm_action, grip_position, hand_rotation, limit, pose_error

POSITION_TOLERANCE_M = 0.012
ROTATION_TOLERANCE_RAD = 0.12
# A move that makes less headway than this over `STALL_STEPS` is blocked, or as near as the arm gets.
STALL_M, STALL_STEPS = 0.002, 12
INSIST_NEAR_M, INSIST_MOST_M = 0.03, 0.03


class SkillError(RuntimeError):
    """The skill cannot go on: what it tried and how far it came."""


def move_hand(
    data: mujoco.MjData,
    target: HandTarget,
    gripper: float,
    *,
    speed: float = 1.0,
    tolerance: float = POSITION_TOLERANCE_M,
    max_steps: int = 90,
    until: Callable[[], bool] = lambda: False,
    insist: float = 0.0,
) -> Iterator[Array]:
    """Servo the hand to a target; ends when it is there, when `until` holds, when it stalls, or after `max_steps`.

    With `insist` that share of the error that is left near the target is added to the command at every step: a far
    reach otherwise ends a centimetre short.
    """
    best, since = np.inf, 0
    more: Array = np.zeros(3)
    for _ in range(max_steps):
        error = pose_error(data, target)
        if until() or (error.position < tolerance and error.rotation < ROTATION_TOLERANCE_RAD):
            return
        progress = error.position + 0.1 * error.rotation
        if progress < best - STALL_M:
            best, since = progress, 0
        else:
            since += 1
        if since >= STALL_STEPS:
            return
        left_over = target.position - grip_position(data)
        if insist > 0.0 and error.position < INSIST_NEAR_M:
            more = limit(more + insist * left_over, INSIST_MOST_M)
        yield arm_action(data, HandTarget(target.position + more, target.rotation), gripper, speed=speed)


def hold_hand(data: mujoco.MjData, target: HandTarget, gripper: float, steps: int) -> Iterator[Array]:
    """Keep the hand at a target while the gripper moves."""
    for _ in range(steps):
        yield arm_action(data, target, gripper, speed=0.4)


def draw_back(data: mujoco.MjData, gripper: float, distance_m: float) -> Iterator[Array]:
    """Move the hand back against its approach direction."""
    rotation = hand_rotation(data)
    away = HandTarget(grip_position(data) - rotation[:, 2] * distance_m, rotation)
    yield from move_hand(data, away, gripper, max_steps=20)


def require_near(data: mujoco.MjData, target: HandTarget, limit_m: float, what: str) -> None:
    """Raise unless the hand has come within `limit_m` of a target.

    Raises:
        SkillError: it has not; the message says by how much.
    """
    distance = pose_error(data, target).position
    if distance > limit_m:
        raise SkillError(f"{what}: the hand stayed {distance * 100:.0f} cm away")
