"""Pick and place: a grasp from above, a lift, a way over obstacles, a release."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
    HandTarget,
    axis_angle,
    frame,
    grip_position,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.objects.grasping import GraspPose, grasp_poses, grasp_poses_as_it_lies
from robocasa_lerobot.envs.scene.scene import PlacedObject
from robocasa_lerobot.envs.task import Stage

ATTEMPTS = 4
GRASP_STEPS, RELEASE_STEPS = 12, 10
HOVER_M = 0.12  # above the grasp
CARRY_M = 0.20  # of the grip site above the counter
LIFT_M = 0.12  # at least, from where it was grasped
UPRIGHT_COS = 0.98  # tilts up to 11 degrees count as standing as it was put down
DOWN = np.array([0.0, 0.0, -1.0])


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
        rotation = nearer_turn(rotation, hand_rotation(data))
        carry = HandTarget(over + np.array([0, 0, CARRY_M]), rotation)
        yield from move_hand(data, carry, CLOSED, tolerance=0.03)
        hang = grip_position(data)[2] - data.body(placed.name).xpos[2] + placed.item.size[2] / 2
        # What hangs beside the grip goes over the middle, not the hand.
        aside = (grip_position(data) - data.body(placed.name).xpos) * [1, 1, 0]
        # The object's underside ends a little below the rim: it falls a few centimetres, and rolls no farther.
        low = HandTarget(over + aside + np.array([0, 0, max(hang - 0.06, -0.05)]), rotation)
        yield from move_hand(data, low, CLOSED, speed=0.7, tolerance=0.02, max_steps=40)
        yield from hold_hand(data, low, OPEN, RELEASE_STEPS)
        up = HandTarget(over + aside + np.array([0, 0, 0.34]), rotation)
        yield from move_hand(data, up, OPEN, tolerance=0.04)
        if basin.contains(data, data.body(placed.name).xpos):
            return
    raise SkillError(f"{placed.name} ({placed.item.model}) is not in the sink after {ATTEMPTS} attempts")


def pick(env: KitchenEnv, placed: PlacedObject) -> Iterator[Array]:
    """Grasp an object from above and lift it; each attempt takes another of its grasp poses.

    Raises:
        SkillError: it is not in the gripper after four attempts.
    """
    data = env.data
    for attempt in range(ATTEMPTS):
        start = data.body(placed.name).xpos.copy()
        grasp, rotation = _grasp(env, placed, attempt)
        grasp_target = HandTarget(grasp, rotation)
        hover = HandTarget(grasp - DOWN * HOVER_M, rotation)
        yield from move_hand(data, hover, OPEN, tolerance=0.015)
        yield from move_hand(data, grasp_target, OPEN, speed=0.6, tolerance=0.006, max_steps=50)
        yield from hold_hand(data, grasp_target, CLOSED, GRASP_STEPS)
        bottom = start[2] - _half_height(env, placed)
        lift = HandTarget(np.array([*grasp[:2], max(bottom + CARRY_M, grasp[2] + LIFT_M)]), rotation)
        yield from move_hand(data, lift, CLOSED, speed=0.8, tolerance=0.03)
        if data.body(placed.name).xpos[2] > start[2] + 0.05:
            return
        yield from hold_hand(data, HandTarget(grip_position(data), rotation), OPEN, RELEASE_STEPS)
    raise SkillError(f"{placed.name} ({placed.item.model}) was not lifted in {ATTEMPTS} attempts")


def _grasp(env: KitchenEnv, placed: PlacedObject, attempt: int) -> tuple[Array, Array]:
    """Position of the grip site and rotation of the hand, for the object as it lies now.

    Of its grasp poses, the better ones that ask for little turning of the wrist come first.

    Raises:
        SkillError: no pose fits.
    """
    body = env.data.body(placed.name)
    present = hand_rotation(env.data)
    turn = body.xmat.reshape(3, 3)
    yaw = np.array([[turn[0, 0], -turn[1, 0], 0], [turn[1, 0], turn[0, 0], 0], [0, 0, 1.0]])
    if turn[2, 2] > UPRIGHT_COS and np.hypot(turn[0, 0], turn[1, 0]) > 1e-6:
        yaw[:2, :2] /= np.hypot(turn[0, 0], turn[1, 0])
        poses = [pose.placed(body.xpos, yaw) for pose in grasp_poses(placed.item)]
    else:  # it has fallen over, or rolled
        poses = [
            dataclasses.replace(pose, position=pose.position + body.xpos)
            for pose in grasp_poses_as_it_lies(placed.item, turn)
        ]
    if not poses:
        raise SkillError(f"{placed.name} ({placed.item.model}): no pose of the gripper fits as it lies")

    def cost(pose: GraspPose) -> float:
        nearest = nearer_turn(pose.rotation, present)
        return 0.35 * float(np.linalg.norm(axis_angle(nearest @ present.T))) - pose.score

    pose = sorted(poses, key=cost)[min(attempt, len(poses) - 1)]
    return pose.position, nearer_turn(pose.rotation, present)


def _half_height(env: KitchenEnv, placed: PlacedObject) -> float:
    """Half of the object's vertical extent as it lies now, metres; not more than that of its bounding box."""
    rotation = env.data.body(placed.name).xmat.reshape(3, 3)
    return min(
        float(np.abs(rotation[2]) @ np.asarray(placed.item.size)) / 2, float(np.linalg.norm(placed.item.size)) / 2
    )


def _lateral(env: KitchenEnv) -> Array:
    yaw = env.scene.robot.yaw
    return np.array([-np.sin(yaw), np.cos(yaw), 0.0])


def _towards_robot(env: KitchenEnv) -> Array:
    yaw = env.scene.robot.yaw
    return -np.array([np.cos(yaw), np.sin(yaw), 0.0])
