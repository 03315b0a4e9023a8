"""Put an object down, from above, on or into another one that stands free: a plate, pan, board or box.

Solved in target scenes, without action noise, seeds from 0 on: CheesyBread 6 of 6, PackDessert 5 of 6,
PickPlaceSinkToCounter 3 of 5, PickPlaceCounterToStove 2 of 3. What failed were grasps that did not lift the object: a
banana and a tomato in the basin, kebabs, a large cake. PickPlaceStoveToCounter (1 of 4) has a verb
of its own until grasps in a pan are better.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
    HandTarget,
    base_pose,
    frame,
    grip_position,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place import (
    ATTEMPTS,
    CARRY_M,
    DOWN,
    RELEASE_STEPS,
    _half_height,
    pick,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.objects import ObjectOn
from robocasa_lerobot.envs.scene.scene import PlacedObject
from robocasa_lerobot.envs.task import Stage

DROP_M = 0.015  # of the object's underside above what it comes to lie on
AWAY_M = 0.33  # upwards after the release: tasks ask for 25 cm from the object's middle
ON_M = 0.07  # horizontally between the middles of what lies in or on something (pans: robocasa facts)
NEAR_ORIGIN_M, RIM_M = 0.04, 0.015
# What is farther than this to one side of the base is driven to, but for the rest.
ASIDE_M, ASIDE_LEFT_M = 0.28, 0.08

Spot = Callable[[], Array]


def place_on(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object on, or into, the object that is its target: plate, pan, board, box, glass.

    Raises:
        SkillError: it is not there after four attempts.
    """
    data, holder = env.data, env.scene.objects[stage.target]

    def spot() -> Array:
        body = data.body(holder.name)
        inside = holder.item.interior
        if inside is None:
            return body.xpos + np.array([0.0, 0.0, holder.item.size[2] / 2])
        # A pan's origin is the middle of its box, handle and all, and tasks measure from there: off the bowl's middle.
        middle, half = np.array(inside.center), np.array(inside.half)
        length = float(np.linalg.norm(middle[:2]))
        shift = min(max(length - NEAR_ORIGIN_M, 0.0), max(float(min(half[:2])) - RIM_M, 0.0))
        across = middle[:2] * (1.0 - shift / length) if length > 1e-6 else middle[:2]
        floor = np.array([*across, middle[2] - half[2]])
        return body.xpos + body.xmat.reshape(3, 3) @ floor

    def rests() -> bool:
        return ObjectOn(stage.object, holder.name, within=ON_M).holds(env.scene, data)

    top = float(data.body(holder.name).xpos[2]) + holder.item.size[2] / 2
    yield from _put(env, env.scene.objects[stage.object], spot, top, rests)


def _put(env: KitchenEnv, placed: PlacedObject, spot: Spot, top: float, done: Callable[[], bool]) -> Iterator[Array]:
    """Pick the object, carry it over the highest of the way, let it down at the spot, and go up.

    Args:
        env: the kitchen.
        placed: what is moved.
        spot: the world point (3,) that the middle of its underside comes to.
        top: height of the rim around the spot, metres.
        done: whether the object is where it belongs.
    """
    data = env.data
    for _ in range(ATTEMPTS):
        yield from _face(env, data.body(placed.name).xpos, OPEN)
        yield from pick(env, placed)
        rotation = nearer_turn(frame(DOWN, hand_rotation(data)[:, 1]), hand_rotation(data))
        hang = _hang(env, placed)
        height = max(top + hang + 0.08, grip_position(data)[2])
        start = grip_position(data)
        rise = HandTarget(np.array([*start[:2], height]), rotation)
        yield from move_hand(data, rise, CLOSED, tolerance=0.04, max_steps=30)
        yield from _face(env, spot(), CLOSED)
        over = HandTarget(np.array([*(spot() + _aside(env, placed))[:2], height]), rotation)
        yield from move_hand(data, over, CLOSED, tolerance=0.02, max_steps=110)
        low = HandTarget(spot() + _aside(env, placed) + [0, 0, _hang(env, placed) + DROP_M], rotation)
        yield from move_hand(data, low, CLOSED, speed=0.6, tolerance=0.012, max_steps=60)
        at = HandTarget(grip_position(data), hand_rotation(data))
        apart = float(np.linalg.norm((data.body(placed.name).xpos - spot())[:2]))
        if data.body(placed.name).xpos[2] < start[2] - CARRY_M and apart > 0.15:
            continue  # lost on the way
        yield from hold_hand(data, at, OPEN, RELEASE_STEPS)
        up = HandTarget(at.position + np.array([0, 0, AWAY_M]), at.rotation)
        yield from move_hand(data, up, OPEN, tolerance=0.04)
        base, _ = base_pose(data)
        away = grip_position(data) - data.body(placed.name).xpos
        if np.linalg.norm(away) < AWAY_M - 0.04:  # the arm came no higher: backwards
            back = (base - grip_position(data)) * [1, 1, 0]
            target = grip_position(data) + 0.2 * back / np.linalg.norm(back)
            yield from move_hand(data, HandTarget(target, hand_rotation(data)), OPEN, tolerance=0.04)
        if done():
            return
    raise SkillError(f"{placed.name} ({placed.item.model}) is not where it belongs after {ATTEMPTS} attempts")


def _face(env: KitchenEnv, point: Array, gripper: float) -> Iterator[Array]:
    """Drive sideways until a point is in front of the base, if it is far to one side; stay where nothing is free."""
    base, yaw = base_pose(env.data)
    left = np.array([-np.sin(yaw), np.cos(yaw)])
    aside = float((point[:2] - base[:2]) @ left)
    if abs(aside) <= ASIDE_M:
        return
    x, y = base[:2] + left * (aside - np.sign(aside) * ASIDE_LEFT_M)
    with contextlib.suppress(SkillError):  # as near as it gets may be near enough
        yield from drive_to(env, float(x), float(y), yaw, gripper=gripper, tolerance_m=0.04)


def _hang(env: KitchenEnv, placed: PlacedObject) -> float:
    """How far the object's underside is below the grip site, metres."""
    return float(grip_position(env.data)[2] - env.data.body(placed.name).xpos[2]) + _half_height(env, placed)


def _aside(env: KitchenEnv, placed: PlacedObject) -> Array:
    """From the object's middle to the grip site, on the floor plan."""
    apart: Array = (grip_position(env.data) - env.data.body(placed.name).xpos) * [1, 1, 0]
    return apart
