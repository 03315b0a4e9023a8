"""Move a held pan by its handle: shake it, tilt it about its length, turn it about the vertical where it stands."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    arm_action,
    base_pose,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.by_handle import PAN_BY_THE_HANDLE, working_end
from robocasa_lerobot.demos.skills.pick_place.carrying.level import level_out
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.place import leave
from robocasa_lerobot.demos.skills.pick_place.verbs import take
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
CLEAR_M = 0.04  # of the pan over what it stood on, while it is moved
# A shake goes to and fro so far, so many steps for each, and at most so many times; gently, or what is in it jumps out.
SHAKE_M, SHAKE_STEPS, SHAKES = 0.025, 14, 6
TILT_RAD, TILT_STEPS, TILTED_STEPS = 0.42, 20, 30
TURN_RAD, TURN_STEPS = 0.45, 30
LOWER_M, RELEASE_STEPS = 0.08, 12


def shake(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Hold the stage's pan over where it stands, and move it to and fro along its handle until the stage is done.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    for _ in range(ATTEMPTS):
        along = yield from _held_by_handle(env, stage)
        at = HandTarget(grip_position(env.data), hand_rotation(env.data))
        for step in range(SHAKES * SHAKE_STEPS):
            if stage_done(env, stage):
                break
            out = SHAKE_M * np.sin(2 * np.pi * step / SHAKE_STEPS) * along
            yield arm_action(env.data, HandTarget(at.position + out, at.rotation), CLOSED)
        yield from hold_hand(env.data, at, CLOSED, SHAKE_STEPS // 2)
        if stage_done(env, stage):
            return
    raise _in_vain(env, stage)


def tilt(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Hold the stage's pan over where it stands, and lean it to one side about its handle, then back.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    for attempt in range(ATTEMPTS):
        along = yield from _held_by_handle(env, stage)
        at = HandTarget(grip_position(env.data), hand_rotation(env.data))
        most = TILT_RAD if attempt % 2 == 0 else -TILT_RAD
        shares = [*np.linspace(0.0, 1.0, TILT_STEPS), *np.ones(TILTED_STEPS)]
        share = 0.0
        for share in shares:
            if stage_done(env, stage):
                break
            yield arm_action(
                env.data, HandTarget(at.position, rotation_about(along, share * most) @ at.rotation), CLOSED
            )
        for left in np.linspace(share, 0.0, TILT_STEPS):
            yield arm_action(
                env.data, HandTarget(at.position, rotation_about(along, left * most) @ at.rotation), CLOSED
            )
        yield from level_out(env, graspable(env, stage.object))
        if stage_done(env, stage):
            return
    raise _in_vain(env, stage)


def turn(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn the stage's pan about the vertical through its middle, set it down there and let go.

    Raises:
        SkillError: the stage is not done after all attempts.
    """
    data, target = env.data, env.scene.subtree(env.scene.fixture(stage.target).name)
    for _ in range(ATTEMPTS):
        yield from _held_by_handle(env, stage)
        obj = graspable(env, stage.object)
        at, middle = HandTarget(grip_position(data), hand_rotation(data)), middle_of(env.scene, data, obj.name)
        base, _ = base_pose(data)

        def turned(angle: float, at: HandTarget = at, middle: Array = middle) -> HandTarget:
            about = rotation_about(UP, angle)
            return HandTarget(middle + about @ (at.position - middle), about @ at.rotation)

        # To the side from which the handle points more towards the robot.
        ways = (TURN_RAD, -TURN_RAD)
        angle = min(ways, key=lambda way: float(np.linalg.norm((turned(way).position - base)[:2])))
        for share in np.linspace(0.0, 1.0, TURN_STEPS):
            yield arm_action(data, turned(share * angle), CLOSED)
        yield from move_hand(data, turned(angle), CLOSED, tolerance=0.015, max_steps=20)
        down = HandTarget(turned(angle).position - LOWER_M * UP, hand_rotation(data))
        met = partial(touching, env.model, data, env.scene.subtree(obj.name), target)
        yield from move_hand(data, down, CLOSED, speed=0.3, max_steps=60, until=met)
        rest = HandTarget(grip_position(data), hand_rotation(data))
        yield from hold_hand(data, rest, OPEN, RELEASE_STEPS)
        off = HandTarget(rest.position - 0.10 * rest.rotation[:, 2], rest.rotation)
        yield from move_hand(data, off, OPEN, tolerance=0.03, max_steps=30)
        yield from leave(env, obj)
        if stage_done(env, stage):
            return
    raise _in_vain(env, stage)


def _held_by_handle(env: KitchenEnv, stage: Stage) -> Generator[Array, None, Array]:
    """Take the pan by its handle unless it is in the hand, raise it a little, and keep it level.

    Returns:
        The direction of its handle, horizontal, world, (3,).
    """
    obj = graspable(env, stage.object)
    if not is_held(env, obj.name):
        yield from take(env, obj, PAN_BY_THE_HANDLE, kept=True)
        obj = graspable(env, stage.object)
    low = HandTarget(grip_position(env.data), hand_rotation(env.data))
    if touching(env.model, env.data, env.scene.subtree(obj.name), env.scene.subtree(env.scene.roles[stage.target])):
        raised = HandTarget(low.position + CLEAR_M * UP, low.rotation)
        yield from move_hand(env.data, raised, CLOSED, speed=0.5, tolerance=0.015, max_steps=30)
    yield from level_out(env, obj)
    return _along(env, obj)


def _along(env: KitchenEnv, obj: Graspable) -> Array:
    axis = env.data.body(obj.name).xmat.reshape(3, 3) @ working_end(obj).axis
    flat = axis - (axis @ UP) * UP
    along: Array = flat / np.linalg.norm(flat)
    return along


def _in_vain(env: KitchenEnv, stage: Stage) -> SkillError:
    return SkillError(f"{graspable(env, stage.object).title} was moved in vain {ATTEMPTS} times")
