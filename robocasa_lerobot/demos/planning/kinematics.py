"""The arm's kinematics for many poses at once: forward, and inverse by damped least squares, in the base's frame."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.envs.robots.panda_omron.control.indices import joint_positions
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE, ARM_JOINTS, GRIP_SITE, HAND
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

ITERATIONS, DAMPING = 40, 0.05
HOPELESS_AFTER, HOPELESS_M = 10, 0.06  # what is as far as this after so many iterations is given up
STEP_M, STEP_RAD, TOWARDS_HOME = 0.12, 0.5, 0.15


@dataclass(frozen=True)
class Solution:
    """Joint angles that come nearest to N poses.

    Attributes:
        joints: (N, 7) radians.
        position_error: (N,) metres.
        rotation_error: (N,) radians.
        margin: (N,) radians to the nearest joint limit.
    """

    joints: Array
    position_error: Array
    rotation_error: Array
    margin: Array


class Arm:
    """Seven hinges about their bodies' z axes, from the frame that arm commands are given in to the grip site.

    Args:
        model: of the kitchen; its constants are read once.
        data: a state with positions evaluated.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        bodies = [int(model.jnt_bodyid[model.joint(name).id]) for name in ARM_JOINTS]
        self.ranges = np.array([model.joint(name).range for name in ARM_JOINTS])
        self.addresses = joint_positions(model, ARM_JOINTS)
        first = model.body_parentid[bodies[0]]
        frame = data.site(ARM_CENTER_SITE)
        base = frame.xmat.reshape(3, 3)
        self._first = _Step(base.T @ (data.xpos[first] - frame.xpos), base.T @ data.xmat[first].reshape(3, 3))
        self._links = [_Step(model.body_pos[body].copy(), _matrix(model.body_quat[body])) for body in bodies]
        last, hand = data.body(bodies[-1]), data.body(HAND)
        turn = last.xmat.reshape(3, 3)
        self._grip = turn.T @ (data.site(GRIP_SITE).xpos - last.xpos)
        self._hand = turn.T @ hand.xmat.reshape(3, 3)

    def forward(self, joints: Array) -> tuple[Array, Array, Array]:
        """Grip positions (N, 3), hand rotations (N, 3, 3) and Jacobians (N, 6, 7) at joint angles (N, 7)."""
        count = len(joints)
        position = np.broadcast_to(self._first.position, (count, 3))
        rotation = np.broadcast_to(self._first.rotation, (count, 3, 3))
        origins, axes = np.empty((count, 7, 3)), np.empty((count, 7, 3))
        cos, sin = np.cos(joints), np.sin(joints)
        for index, link in enumerate(self._links):
            position = position + rotation @ link.position
            rotation = rotation @ link.rotation
            origins[:, index], axes[:, index] = position, rotation[:, :, 2]
            c, s = cos[:, index, None], sin[:, index, None]
            x, y = rotation[:, :, 0], rotation[:, :, 1]
            turned = np.empty((count, 3, 3))
            turned[:, :, 0], turned[:, :, 1], turned[:, :, 2] = c * x + s * y, c * y - s * x, rotation[:, :, 2]
            rotation = turned
        grip = position + rotation @ self._grip
        jacobian = np.empty((count, 6, 7))
        arms = grip[:, None] - origins
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            jacobian[:, i] = axes[..., j] * arms[..., k] - axes[..., k] * arms[..., j]
        jacobian[:, 3:] = axes.transpose(0, 2, 1)
        return grip, rotation @ self._hand, jacobian

    def solve(self, positions: Array, rotations: Array, start: Array) -> Solution:
        """Joint angles for grip positions (N, 3) and hand rotations (N, 3, 3), from `start` (N, 7) on.

        What the six conditions leave over goes towards the arm's home, as its controller lets it.
        """
        joints = start.copy()
        home = np.asarray(PANDA_OMRON.home.arm)
        eye6, eye7 = DAMPING**2 * np.eye(6), np.eye(7)
        busy = np.flatnonzero(self._within_reach(positions, rotations))
        for iteration in range(ITERATIONS):
            grip, rotation, jacobian = self.forward(joints[busy])
            move = positions[busy] - grip
            turn = _axis_angles(rotations[busy] @ rotation.transpose(0, 2, 1))
            far = (np.linalg.norm(move, axis=1) > 0.002) | (np.linalg.norm(turn, axis=1) > 0.02)
            if iteration == HOPELESS_AFTER:
                far &= np.linalg.norm(move, axis=1) < HOPELESS_M
            busy = busy[far]
            if not len(busy):
                break
            error = np.concatenate([_limited(move[far], STEP_M), _limited(turn[far], STEP_RAD)], axis=1)
            jacobian = jacobian[far]
            across = jacobian.transpose(0, 2, 1)
            inverse = across @ np.linalg.inv(jacobian @ across + eye6)
            rest = ((eye7 - inverse @ jacobian) @ (home - joints[busy])[..., None])[..., 0]
            step = (inverse @ error[..., None])[..., 0] + TOWARDS_HOME * rest
            joints[busy] = np.clip(joints[busy] + step, self.ranges[:, 0], self.ranges[:, 1])
        grip, rotation, _ = self.forward(joints)
        margin = np.minimum(joints - self.ranges[:, 0], self.ranges[:, 1] - joints).min(axis=1)
        return Solution(
            joints,
            np.linalg.norm(positions - grip, axis=1),
            np.linalg.norm(_axis_angles(rotations @ rotation.transpose(0, 2, 1)), axis=1),
            margin,
        )

    @staticmethod
    def _within_reach(positions: Array, rotations: Array) -> NDArray[np.bool_]:
        reach = PANDA_OMRON.reach
        wrist = positions - reach.wrist_behind_grip * rotations[:, :, 2] - np.array([0.0, 0.0, reach.shoulder])
        near: NDArray[np.bool_] = np.linalg.norm(wrist, axis=1) < reach.longest
        return near


@dataclass(frozen=True)
class _Step:
    position: Array
    rotation: Array


def _matrix(quat: Array) -> Array:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


def _limited(vectors: Array, bound: float) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    shorter: Array = vectors * np.minimum(1.0, bound / np.maximum(length, 1e-9))
    return shorter


def _axis_angles(rotations: NDArray[np.float64]) -> Array:
    """Axis-angle vectors (N, 3) of rotation matrices; near half a turn the axis is approximate."""
    skew = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(skew, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(rotations, axis1=1, axis2=2) - 1) / 2)
    vectors: Array = skew / np.maximum(2 * sine, 1e-6)[:, None] * angle[:, None]
    return vectors
