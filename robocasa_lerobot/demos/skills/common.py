"""Moves that the skills share."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    Array,
    HandTarget,
    arm_action,
    grip_position,
    hand_rotation,
    limit,
    pose_error,
)
from robocasa_lerobot.demos.planning.errors import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import Goal, parts_with_memory
from robocasa_lerobot.envs.robots.panda_omron.names import FINGER_JOINTS
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

__all__ = [
    "HOLD_SPEED",
    "SkillError",
    "close_fingers",
    "draw_back",
    "hold_hand",
    "move_hand",
    "require_near",
    "stage_done",
    "wait_for",
    "wait_for_stage",
]

POSITION_TOLERANCE_M = 0.012
ROTATION_TOLERANCE_RAD = 0.12
# A move that makes less headway than this over `STALL_STEPS` is blocked, or as near as the arm gets.
STALL_M, STALL_STEPS = 0.002, 12
INTEGRAL_GAIN_NEAR_M, INTEGRAL_GAIN_MOST_M = 0.03, 0.03
AHEAD_ON_LINE_M = 0.03  # commands this far ahead are full ones
HOLD_SPEED = 0.4  # of a hand that stays where it is
MORE_CLOSING_STEPS, STILL_M = 10, 0.0004  # of a finger in a step: it has met something


def move_hand(
    data: mujoco.MjData,
    target: HandTarget,
    gripper: float,
    *,
    speed: float = 1.0,
    tolerance: float = POSITION_TOLERANCE_M,
    max_steps: int = 90,
    until: Callable[[], bool] = lambda: False,
    integral_gain: float = 0.0,
    start: Array | None = None,
) -> Iterator[Array]:
    """Servo the hand to a target; ends when it is there, when `until` holds, when it stalls, or after `max_steps`.

    With `integral_gain` that share of the error that is left near the target is added to the command at every step: a
    far reach otherwise ends a centimetre short. With a `start` the hand keeps to the straight line from there.
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
        if integral_gain > 0.0 and error.position < INTEGRAL_GAIN_NEAR_M:
            more = limit(more + integral_gain * left_over, INTEGRAL_GAIN_MOST_M)
        position = target.position if start is None else _ahead(start, target.position, grip_position(data))
        yield arm_action(data, HandTarget(position + more, target.rotation), gripper, speed=speed)


def _ahead(start: Array, end: Array, now: Array) -> Array:
    """The point of a line from `start` to `end` that lies a little before the one nearest to `now`."""
    length = float(np.linalg.norm(end - start))
    if length < AHEAD_ON_LINE_M:
        return end
    along = (end - start) / length
    return start + along * float(np.clip((now - start) @ along + AHEAD_ON_LINE_M, 0.0, length))


def hold_hand(data: mujoco.MjData, target: HandTarget, gripper: float, steps: int) -> Iterator[Array]:
    """Keep the hand at a target while the gripper moves."""
    for _ in range(steps):
        yield arm_action(data, target, gripper, speed=HOLD_SPEED)


def close_fingers(data: mujoco.MjData, target: HandTarget, steps: int) -> Iterator[Array]:
    """Close the gripper with the hand at a target: for some steps, and until the fingers stand still."""
    fingers = [data.joint(name) for name in FINGER_JOINTS]
    before: Array = np.full(2, np.inf)
    for step in range(steps + MORE_CLOSING_STEPS):
        now: Array = np.array([float(finger.qpos[0]) for finger in fingers])
        if step >= steps and float(np.abs(now - before).max()) < STILL_M:
            return
        before = now
        yield arm_action(data, target, CLOSED, speed=HOLD_SPEED)


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


def stage_done(env: KitchenEnv, stage: Stage) -> bool:
    """Whether a stage's own condition holds now."""
    return stage_condition(env.declaration, stage).evaluate(env.scene, env.data, {})


def wait_for(env: KitchenEnv, goal: Goal, act: Callable[[], Array], patience_steps: int) -> Iterator[Array]:
    """Repeat an action until a goal holds, or until nothing that it remembers has come nearer to it for some steps."""
    remembered = parts_with_memory([goal])

    def progress() -> float:
        return sum(part.progress(env.scene, env.data) for part in remembered)

    left, best = patience_steps, progress()
    while left and not goal.evaluate(env.scene, env.data, {}):
        yield act()
        now = progress()
        left, best = (patience_steps, now) if now > best else (left - 1, best)


def wait_for_stage(env: KitchenEnv, stage: Stage, act: Callable[[], Array], patience_steps: int) -> Iterator[Array]:
    """The same for a stage's condition."""
    yield from wait_for(env, stage_condition(env.declaration, stage), act, patience_steps)
