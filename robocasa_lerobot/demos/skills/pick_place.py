"""Pick and place: a grasp from above, a lift, a way over obstacles, a release."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, OPEN, Array, HandTarget, frame, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.scene import PlacedObject
from robocasa_lerobot.envs.task import Stage

ATTEMPTS = 4
GRASP_STEPS, RELEASE_STEPS = 12, 10
HOVER_M = 0.12  # above the grasp
CARRY_M = 0.20  # of the grip site above the counter
FINGER_BELOW_GRIP_M = 0.014  # the finger tips reach this far below the grip site
GRASP_DEPTH_M = 0.030  # below the top of a tall object
DOWN = np.array([0.0, 0.0, -1.0])
ROUND_SHAPES = ("round", "can", "vessel")  # grasped alike from every side


def place_into_basin(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Take the stage's object and let it go low over the front half of the basin.

    Raises:
        SkillError: the object is not in the basin after four attempts.
    """
    data = env.data
    placed = env.scene.objects[stage.object]
    basin = env.scene.sink(stage.target).basin
    for _ in range(ATTEMPTS):
        yield from pick(env, placed)
        rim = basin.world(data, (0, 0, basin.half[2]))
        # In front of the faucet, whose spout reaches over the middle.
        over = rim + _towards_robot(env) * 0.09
        rotation = frame(DOWN, _lateral(env))
        rotation = _nearer_turn(rotation, hand_rotation(data))
        carry = HandTarget(over + np.array([0, 0, CARRY_M]), rotation)
        yield from move_hand(data, carry, CLOSED, tolerance=0.03)
        hang = grip_position(data)[2] - data.body(placed.name).xpos[2] + placed.item.size[2] / 2
        # The object's underside ends a little below the rim: it falls a few centimetres, and rolls no farther.
        low = HandTarget(over + np.array([0, 0, max(hang - 0.06, -0.05)]), rotation)
        yield from move_hand(data, low, CLOSED, speed=0.7, tolerance=0.02, max_steps=40)
        yield from hold_hand(data, low, OPEN, RELEASE_STEPS)
        up = HandTarget(over + np.array([0, 0, 0.34]), rotation)
        yield from move_hand(data, up, OPEN, tolerance=0.04)
        if basin.contains(data, data.body(placed.name).xpos):
            return
    raise SkillError(f"{placed.name} ({placed.item.model}) is not in the sink after {ATTEMPTS} attempts")


def pick(env: KitchenEnv, placed: PlacedObject) -> Iterator[Array]:
    """Grasp an object from above and lift it.

    Raises:
        SkillError: it is not in the gripper after three attempts.
    """
    data = env.data
    for _ in range(ATTEMPTS):
        body = data.body(placed.name)
        start = body.xpos.copy()
        rotation = _grasp_rotation(env, placed)
        half_height = _half_height(env, placed)
        depth = min(GRASP_DEPTH_M, 2 * half_height - FINGER_BELOW_GRIP_M - 0.004)
        grasp = HandTarget(start + np.array([0, 0, half_height - max(depth, 0.012)]), rotation)
        hover = HandTarget(grasp.position - DOWN * HOVER_M, rotation)
        yield from move_hand(data, hover, OPEN, tolerance=0.015)
        yield from move_hand(data, grasp, OPEN, speed=0.6, tolerance=0.006, max_steps=50)
        yield from hold_hand(data, grasp, CLOSED, GRASP_STEPS)
        lift = HandTarget(np.array([*grasp.position[:2], start[2] - half_height + CARRY_M]), rotation)
        yield from move_hand(data, lift, CLOSED, speed=0.8, tolerance=0.03)
        if data.body(placed.name).xpos[2] > start[2] + 0.05:
            return
        yield from hold_hand(data, HandTarget(grip_position(data), rotation), OPEN, RELEASE_STEPS)
    raise SkillError(f"{placed.name} ({placed.item.model}) was not lifted in {ATTEMPTS} attempts")


def _grasp_rotation(env: KitchenEnv, placed: PlacedObject) -> Array:
    """Hand pointing down, fingers across the narrow side; of the equal ways, the least turn of the wrist."""
    present = hand_rotation(env.data)
    if placed.item.category.shape in ROUND_SHAPES:
        opening = _lateral(env)
    else:
        # The narrow side is the object's own y, wherever it has rolled to.
        opening = env.data.body(placed.name).xmat.reshape(3, 3)[:, 1].copy()
        if abs(opening[2]) > 0.7:
            opening = env.data.body(placed.name).xmat.reshape(3, 3)[:, 2].copy()
    return _nearer_turn(frame(DOWN, opening), present)


def _half_height(env: KitchenEnv, placed: PlacedObject) -> float:
    """Half of the object's vertical extent as it lies now, metres."""
    rotation = env.data.body(placed.name).xmat.reshape(3, 3)
    return float(np.abs(rotation[2]) @ np.asarray(placed.item.size)) / 2 if _is_box(placed) else placed.item.size[2] / 2


def _is_box(placed: PlacedObject) -> bool:
    return placed.item.category.shape in ("block", "sponge", "carton")


def _nearer_turn(rotation: Array, present: Array) -> Array:
    """A gripper is the same after half a turn about its approach: choose the turn nearer to the present one."""
    flipped = rotation @ np.diag([-1.0, -1.0, 1.0])
    return rotation if np.trace(rotation.T @ present) >= np.trace(flipped.T @ present) else flipped


def _lateral(env: KitchenEnv) -> Array:
    yaw = env.scene.robot.yaw
    return np.array([-np.sin(yaw), np.cos(yaw), 0.0])


def _towards_robot(env: KitchenEnv) -> Array:
    yaw = env.scene.robot.yaw
    return -np.array([np.cos(yaw), np.sin(yaw), 0.0])
