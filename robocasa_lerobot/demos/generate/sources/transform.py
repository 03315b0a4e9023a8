"""Poses as 4x4 matrices: carried from one frame into another, interpolated, and turned into commands and back.

The formulas are those of A. Mandlekar et al., "MimicGen" (2023), where a function says so; a test holds them to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robocasa_lerobot.demos.motion import Array, axis_angle, rotation_about
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import POSITION_SCALE_M, ROTATION_SCALE_RAD

# Turns below this are made at once, at the first step of an interpolation (MimicGen's own number).
SMALL_TURN_RAD = 0.05
# A hand reflected about a plane: the plane's reflection from the left, the hand's own about its middle from the right,
# so that a proper rotation results. A parallel gripper is its own mirror image.
ACROSS = np.diag([-1.0, 1.0, 1.0])


def make_pose(position: ArrayLike, rotation: ArrayLike) -> Array:
    """Poses (..., 4, 4) from positions (..., 3) and rotations (..., 3, 3)."""
    position, rotation = np.asarray(position, dtype=np.float64), np.asarray(rotation, dtype=np.float64)
    pose = np.zeros((*position.shape[:-1], 4, 4))
    pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = rotation, position, 1.0
    return pose


def inverse(pose: Array) -> Array:
    """Inverses (..., 4, 4) of rigid poses."""
    turn = np.swapaxes(pose[..., :3, :3], -1, -2)
    return make_pose(-(turn @ pose[..., :3, 3:])[..., 0], turn)


def carried_over(frame_now: Array, frame_then: Array, poses: Array) -> Array:
    """Poses (T, 4, 4) that were relative to one frame, relative to another: MimicGen's transform of a segment."""
    return frame_now @ (inverse(frame_then) @ poses)


def mirrored(pose: Array) -> Array:
    """Hand poses (..., 4, 4) in a frame, reflected about its plane x = 0."""
    out: Array = pose.copy()
    out[..., :3, 3] = pose[..., :3, 3] @ ACROSS
    out[..., :3, :3] = ACROSS @ pose[..., :3, :3] @ ACROSS
    return out


def interpolated(start: Array, end: Array, steps: int) -> Array:
    """`steps` poses between two of them, which are left out, and the end: (steps + 1, 4, 4); MimicGen's bridge.

    Positions go along a line, turns about one axis; small ones are made at once.
    """
    shares = np.arange(1, steps + 2)[:, None] / (steps + 1)
    positions = start[:3, 3] + shares * (end[:3, 3] - start[:3, 3])
    turn = axis_angle(end[:3, :3] @ start[:3, :3].T)
    angle = float(np.linalg.norm(turn))
    if angle < SMALL_TURN_RAD:
        rotations = np.repeat(end[None, :3, :3], steps + 1, axis=0)
    else:
        rotations = np.array([rotation_about(turn / angle, float(s) * angle) @ start[:3, :3] for s in shares[:, 0]])
        rotations[-1] = end[:3, :3]
    return make_pose(positions, rotations)


def command_to(target: Array, origin: Array) -> tuple[Array, Array]:
    """Arm commands, (3,) each and not clipped, that lead a controller's goal from `origin` to `target`.

    Both are poses (4, 4) in the arm's base frame; `origin` is the pose that the hand has reached, or the goal before,
    as the control mode has it.
    """
    move = (target[:3, 3] - origin[:3, 3]) / POSITION_SCALE_M
    turn = axis_angle(target[:3, :3] @ origin[:3, :3].T) / ROTATION_SCALE_RAD
    return move, turn


def target_of(move: Array, turn: Array, origin: Array) -> Array:
    """The goal (4, 4) that arm commands, (3,) each, lead a controller to: the inverse of `command_to`."""
    angle = float(np.linalg.norm(turn)) * ROTATION_SCALE_RAD
    rotation = np.eye(3) if angle == 0.0 else rotation_about(turn / np.linalg.norm(turn), angle)
    return make_pose(origin[:3, 3] + POSITION_SCALE_M * move, rotation @ origin[:3, :3])


def yaw_pose(x: float, y: float, yaw: float, z: float = 0.0) -> Array:
    """The pose (4, 4) of something upright: metres, radians."""
    return make_pose([x, y, z], rotation_about(np.array([0.0, 0.0, 1.0]), yaw))


def heading(rotation: Array) -> float:
    """Heading of a rotation's first axis on the floor, radians."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
