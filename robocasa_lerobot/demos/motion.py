"""Servoing: turns a wanted pose of the hand, or of the base, into 12-D actions, one control step at a time.

The servo sees poses (privileged state) but acts only through the same normalised commands as a policy.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import POSITION_SCALE_M, ROTATION_SCALE_RAD
from robocasa_lerobot.envs.robots.panda_omron.names import (
    ARM_CENTER_SITE,
    ARM_JOINTS,
    BASE_CENTER_SITE,
    GRIP_SITE,
    HAND,
)
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

Array = NDArray[np.float64]

OPEN, CLOSED = -1.0, 1.0
UP = np.array([0.0, 0.0, 1.0])
HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # of a gripper about its approach, after which it is the same
# Control mode: the arm's goal starts from the pose that is achieved, or from the pose that was wanted last.
FROM_ACHIEVED, FROM_DESIRED = -1.0, 1.0

# In mode FROM_ACHIEVED the arm covers about a quarter of a commanded step (docs/robocasa.md, section 2), so errors are
# commanded more than once over; above about 3 the arm overshoots.
ARM_GAIN = 2.0
# A base at rest answers to commands above these only (docs/robocasa.md, section 2), forward and left, and turn: metres
# and radians a second are |command| - 0.25 and 1.5 |command| - 0.167.
DEAD_ZONE, TURN_DEAD_ZONE = 0.25, 0.11
DEAD_ZONES = np.array([DEAD_ZONE, DEAD_ZONE, TURN_DEAD_ZONE, 0.0])  # of base_motion
ELBOW = ARM_JOINTS[3]


@dataclass(frozen=True)
class HandTarget:
    """A wanted pose of the hand in the world.

    Attributes:
        position: of the grip site, metres, shape (3,).
        rotation: of the hand body, shape (3, 3): z is the approach direction, the fingers open along y.
    """

    position: Array
    rotation: Array


@dataclass(frozen=True)
class PoseError:
    """Distance to a target: metres and radians."""

    position: float
    rotation: float


def grip_position(data: mujoco.MjData) -> Array:
    """World position of the grip site, metres."""
    return data.site(GRIP_SITE).xpos.copy()


def hand_rotation(data: mujoco.MjData) -> Array:
    """World rotation of the hand body, shape (3, 3)."""
    return data.body(HAND).xmat.reshape(3, 3).copy()


def base_pose(data: mujoco.MjData) -> tuple[Array, float]:
    """World position (3,) of the base centre in metres and its heading in radians."""
    site = data.site(BASE_CENTER_SITE)
    rotation = site.xmat.reshape(3, 3)
    return site.xpos.copy(), float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def floor_axes(yaw: float) -> Array:
    """Forward and left of a base with that heading, radians, as rows: (2, 3)."""
    return np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])


def pose_error(data: mujoco.MjData, target: HandTarget) -> PoseError:
    """How far the hand is from a target."""
    turn = axis_angle(target.rotation @ hand_rotation(data).T)
    return PoseError(float(np.linalg.norm(target.position - grip_position(data))), float(np.linalg.norm(turn)))


def arm_action(
    data: mujoco.MjData, target: HandTarget, gripper: float, *, speed: float = 1.0, gain: float = ARM_GAIN
) -> Array:
    """Action (12,), stored order, that moves the hand towards a target with the base at rest.

    An elbow that has gone past the stretched arm, as it can where the hand presses down far out, stays there: whatever
    draws the hand back from then on pushes the elbow against its limit. Then the hand is tipped over, about the elbow's
    axis, until that bends again.

    Args:
        data: present state.
        target: wanted pose.
        gripper: OPEN or CLOSED.
        speed: bound of each command component, in (0, 1].
        gain: share of the error that is commanded.
    """
    base = data.site(ARM_CENTER_SITE).xmat.reshape(3, 3)
    move = base.T @ (target.position - grip_position(data)) * gain / POSITION_SCALE_M
    elbow = data.joint(ELBOW)
    if elbow.qpos[0] > PANDA_OMRON.reach.stretched:
        turn = -base.T @ elbow.xaxis
    else:
        turn = base.T @ axis_angle(target.rotation @ hand_rotation(data).T) * gain / ROTATION_SCALE_RAD
    return action(position=limit(move, speed), rotation=limit(turn, 1.0), gripper=gripper, mode=FROM_ACHIEVED)


def action(
    *,
    position: Array | None = None,
    rotation: Array | None = None,
    gripper: float,
    base: Array | None = None,
    mode: float = FROM_ACHIEVED,
) -> Array:
    """Action (12,), stored order, from its parts; missing parts are zero."""
    return contract.join_action(
        {
            "base_motion": np.zeros(4) if base is None else base,
            "control_mode": [mode],
            "end_effector_position": np.zeros(3) if position is None else position,
            "end_effector_rotation": np.zeros(3) if rotation is None else rotation,
            "gripper_close": [gripper],
        }
    )


def limit(vector: Array, bound: float) -> Array:
    """The vector scaled so that no component exceeds `bound`: the direction stays."""
    largest = float(np.abs(vector).max())
    return vector if largest <= bound else vector * (bound / largest)


def axis_angle(rotation: Array) -> Array:
    """Axis-angle vector (3,) in radians of a rotation matrix."""
    quat, out = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rotation).reshape(9))
    mujoco.mju_quat2Vel(out, quat, 1.0)
    return out


def rotation_about(axis: Array, angle: float) -> Array:
    """Rotation (3, 3) by an angle in radians about an axis (3,) of length 1."""
    quat, matrix = np.empty(4), np.empty(9)
    mujoco.mju_axisAngle2Quat(quat, axis, angle)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def turned_up(rotation: Array, direction: Array) -> Array:
    """The rotation (3, 3) nearest to another that brings a direction (3,) of its own axes up."""
    now = rotation @ direction
    axis = np.cross(now, UP)
    sine = float(np.linalg.norm(axis))
    return rotation if sine < 1e-6 else rotation_about(axis / sine, float(np.arctan2(sine, now @ UP))) @ rotation


def nearer_turn(rotation: Array, present: Array) -> Array:
    """Of the two rotations of a gripper that are the same, the one nearer to the present one."""
    flipped = rotation @ HALF_TURN
    return rotation if np.trace(rotation.T @ present) >= np.trace(flipped.T @ present) else flipped


def frame(approach: Array, opening: Array) -> Array:
    """Hand rotation (3, 3) with the given approach direction and finger opening direction (made orthogonal)."""
    z = approach / np.linalg.norm(approach)
    y = opening - z * float(opening @ z)
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])
