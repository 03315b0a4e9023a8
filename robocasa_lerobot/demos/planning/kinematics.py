"""The arm's kinematics for many poses at once: forward, and inverse by damped least squares, in the base's frame."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning import kernel
from robocasa_lerobot.envs.physics import native
from robocasa_lerobot.envs.robots.panda_omron.control.indices import joint_positions
from robocasa_lerobot.envs.robots.robot import Robot

FEW = 16  # poses among which no equal ones are looked for


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
        robot: whose arm it is.

    Attributes:
        addresses: (7,) of the joints in qpos.
        bodies: (7,) numbers of the links' bodies.
        ranges: (7, 2) limits, radians.
        home: (7,) at the start of an episode, radians.
        chain: what the compiled functions take.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, robot: Robot) -> None:
        native.load()
        names = robot.names
        self.bodies = [int(model.jnt_bodyid[model.joint(name).id]) for name in names.arm_joints]
        self.ranges = np.array([model.joint(name).range for name in names.arm_joints])
        self.home = np.array(robot.home.arm)
        self.addresses = joint_positions(model, names.arm_joints)
        first = model.body_parentid[self.bodies[0]]
        frame = data.site(names.arm_center_site)
        base = frame.xmat.reshape(3, 3)
        last, hand = data.body(self.bodies[-1]), data.body(names.hand)
        turn = last.xmat.reshape(3, 3)
        self.chain = kernel.Chain(
            first_position=base.T @ (data.xpos[first] - frame.xpos),
            first_rotation=base.T @ data.xmat[first].reshape(3, 3),
            positions=model.body_pos[self.bodies].copy(),
            rotations=np.array([_matrix(model.body_quat[body]) for body in self.bodies]),
            grip=turn.T @ (data.site(names.grip_site).xpos - last.xpos),
            hand=turn.T @ hand.xmat.reshape(3, 3),
            low=self.ranges[:, 0].copy(),
            high=self.ranges[:, 1].copy(),
            home=self.home,
        )
        self._reach = robot.reach

    def forward(self, joints: Array) -> tuple[Array, Array]:
        """Grip positions (N, 3) and hand rotations (N, 3, 3) at joint angles (N, 7)."""
        grips, hands = np.empty((len(joints), 3)), np.empty((len(joints), 3, 3))
        kernel.forward(self.chain, np.ascontiguousarray(joints, dtype=np.float64), grips, hands)
        return grips, hands

    def solve(self, positions: Array, rotations: Array, start: Array) -> Solution:
        """Joint angles for grip positions (N, 3) and hand rotations (N, 3, 3), from `start` (N, 7) on.

        What the six conditions leave over goes towards the arm's home, as its controller lets it.
        """
        if len(start) < FEW:
            return self._solve(positions, rotations, np.array(start, dtype=np.float64))
        asked = np.concatenate([positions, rotations.reshape(-1, 9), start], axis=1)
        whole = asked.view(np.dtype((np.void, asked.itemsize * asked.shape[1])))[:, 0]
        _, first, back = np.unique(whole, return_index=True, return_inverse=True)  # many paths share poses
        found = self._solve(positions[first], rotations[first], asked[first, 12:])
        return Solution(found.joints[back], found.position_error[back], found.rotation_error[back], found.margin[back])

    def _solve(self, positions: Array, rotations: Array, joints: Array) -> Solution:
        """The same for rows that differ; the joints (N, 7), in rows, are written."""
        errors = np.empty((len(joints), 2))
        hopeful = self._within_reach(positions, rotations)
        kernel.solve(
            self.chain, np.ascontiguousarray(positions), np.ascontiguousarray(rotations), hopeful, joints, errors, False
        )
        margin = np.minimum(joints - self.ranges[:, 0], self.ranges[:, 1] - joints).min(axis=1)
        return Solution(joints, errors[:, 0], errors[:, 1], margin)

    def along(self, start: Array, positions: Array, rotations: Array) -> Array:
        """Joint angles (N, 7) as the controller reaches them, which is told the hand's poses alone.

        Each pose is solved from the one before, so that the elbow goes as it will rather than as it was planned.
        """
        count = len(positions)
        found, errors = np.empty((count, 7)), np.empty((count, 2))
        found[:1] = start
        kernel.solve(
            self.chain,
            np.ascontiguousarray(positions),
            np.ascontiguousarray(rotations),
            np.ones(count, dtype=np.bool_),
            found,
            errors,
            True,
        )
        return found

    def _within_reach(self, positions: Array, rotations: Array) -> NDArray[np.bool_]:
        reach = self._reach
        wrist = positions - reach.wrist_behind_grip * rotations[:, :, 2] - np.array([0.0, 0.0, reach.shoulder])
        near: NDArray[np.bool_] = np.linalg.norm(wrist, axis=1) < reach.longest
        return near


def _matrix(quat: Array) -> Array:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)
