"""Getting rid of what comes along with the open hand: a mug by its handle, a spoon across a finger, a braced vessel."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterator

from robocasa_lerobot.demos.motion import CLOSED, OPEN, UP, Array, HandTarget, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import hold_hand, move_hand
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import hangs, touched_by_hand
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

DOWN_M, MOST_DOWN_M = 0.012, 0.048  # that the open hand goes down at a time, and in all, until the object stands
SLIP_OFF_M = (0.03, -0.03)  # along the line between the fingers, to free the one that is caught
CLOSE_STEPS = 11
ROCKING_STEPS = 6
HANGING_STEPS = 3  # so long without a break does it hang, and not rock
MOST_CLOSING_STEPS = 7  # of fingers that are to come off the walls of a vessel


def set_down(env: KitchenEnv, obj: Graspable) -> Generator[Array, None, float]:
    """Go down with the open hand while the object hangs from it, until it stands; how far that was, metres."""
    rotation, start = hand_rotation(env.data), grip_position(env.data)
    down = 0.0
    while hangs(env, obj) and down < MOST_DOWN_M:
        down += DOWN_M
        target = HandTarget(start - down * UP, rotation)
        yield from move_hand(env.data, target, OPEN, speed=0.4, tolerance=0.003, max_steps=8)
    if down:  # it may still rock
        yield from hold_hand(env.data, HandTarget(grip_position(env.data), rotation), OPEN, ROCKING_STEPS)
    return down


def caught(env: KitchenEnv, obj: Graspable, at: HandTarget, clear: HandTarget) -> Generator[Array, None, bool]:
    """Whether the object comes along with the open hand for good: then that has closed again, so that it stays in it.

    Before, the hand goes back to where it let go, and comes out with one finger moved off, then with the other.

    Args:
        env: the kitchen.
        obj: that was let go.
        at: of the hand where it let go.
        clear: of the hand out of what it held.
    """
    for aside in SLIP_OFF_M:
        if not (yield from _keeps_hanging(env, obj)):
            return False
        yield from move_hand(env.data, at, OPEN, speed=0.5, tolerance=0.01, max_steps=25)
        yield from set_down(env, obj)
        off = aside * at.rotation[:, 1]
        beside = HandTarget(grip_position(env.data) + off, at.rotation)
        yield from move_hand(env.data, beside, OPEN, speed=0.5, tolerance=0.008, max_steps=15)
        out = HandTarget(clear.position + off, clear.rotation)
        yield from move_hand(env.data, out, OPEN, speed=0.6, tolerance=0.02, max_steps=30)
    if not (yield from _keeps_hanging(env, obj)):
        return False
    here = HandTarget(grip_position(env.data), hand_rotation(env.data))
    yield from hold_hand(env.data, here, CLOSED, CLOSE_STEPS)
    return True


def freed(env: KitchenEnv, obj: Graspable, at: HandTarget, clear: HandTarget) -> Iterator[Array]:
    """Come out of a vessel again where the open fingers have braced against its walls, so that it came along.

    It is set down again, the fingers close until they are off its walls, and stay as far apart as they are then on
    their way out. An object between them may come along, as of `caught`.

    Args:
        env: the kitchen.
        obj: that was let go, in it.
        at: of the hand where it let go.
        clear: of the hand out of what it held.
    """
    for name in braced(env, obj):
        vessel = graspable(env, name)
        yield from move_hand(env.data, at, OPEN, speed=0.5, tolerance=0.01, max_steps=25)
        down = yield from set_down(env, vessel)
        here = HandTarget(grip_position(env.data), at.rotation)
        for _ in range(MOST_CLOSING_STEPS):
            yield from hold_hand(env.data, here, CLOSED, 1)
            if not touched_by_hand(env, vessel)[0]:
                break
        out = HandTarget(clear.position - down * UP, clear.rotation)
        fingers = itertools.cycle((OPEN, CLOSED))
        for step, gripper in zip(move_hand(env.data, out, OPEN, speed=0.6, max_steps=30), fingers, strict=False):
            step[-1] = gripper
            yield step


def braced(env: KitchenEnv, obj: Graspable) -> list[str]:
    """Names of the other objects that hang from the hand."""
    others = (name for name in env.scene.objects if name != obj.name and name not in obj.contents)
    return [name for name in others if hangs(env, graspable(env, name))]


def _keeps_hanging(env: KitchenEnv, obj: Graspable) -> Generator[Array, None, bool]:
    """Whether an object hangs from the open hand now and in the next steps, standing still."""
    here = HandTarget(grip_position(env.data), hand_rotation(env.data))
    for _ in range(HANGING_STEPS):
        if not hangs(env, obj):
            return False
        yield from hold_hand(env.data, here, OPEN, 1)
    return hangs(env, obj)
