"""A firmer servo of the hand, for parts that are heavy to move.

In mode FROM_ACHIEVED the arm's goal is never farther ahead of the hand than one command (5 cm), which bounds its force.
In mode FROM_DESIRED commands add up, so that the goal may lie farther ahead. The servo keeps account of where the goal
is, and starts anew from the reached pose now and then, since noise on actions adds up as well.
"""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import (
    FROM_DESIRED,
    Array,
    HandTarget,
    action,
    arm_action,
    axis_angle,
    grip_position,
    hand_rotation,
    limit,
    rotation_about,
)
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import POSITION_SCALE_M, ROTATION_SCALE_RAD
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE

ANEW_STEPS = 40
STEP_M, STEP_RAD = 0.025, 0.12  # that the goal moves in a control step at most


class ForceServo:
    """Actions that draw the hand to targets with a force that grows with their distance.

    Args:
        data: present state.
    """

    def __init__(self, data: mujoco.MjData) -> None:
        self._data, self._steps = data, 0
        # Of the goal, in the arm's base frame.
        self._position: Array = np.zeros(3)
        self._rotation: Array = np.eye(3)

    def action(self, target: HandTarget, gripper: float) -> Array:
        """Action (12,), stored order, towards a target; the base at rest."""
        site = self._data.site(ARM_CENTER_SITE)
        base, origin = site.xmat.reshape(3, 3), site.xpos
        if self._steps % ANEW_STEPS == 0:
            out = arm_action(self._data, target, gripper)
            self._position = base.T @ (grip_position(self._data) - origin)
            self._rotation = base.T @ hand_rotation(self._data)
            parts = contract.split_action(out)
            move = parts["end_effector_position"] * POSITION_SCALE_M
            turn = parts["end_effector_rotation"] * ROTATION_SCALE_RAD
        else:
            move = limit(base.T @ (target.position - origin) - self._position, STEP_M)
            turn = limit(axis_angle(base.T @ target.rotation @ self._rotation.T), STEP_RAD)
            out = action(
                position=move / POSITION_SCALE_M, rotation=turn / ROTATION_SCALE_RAD, gripper=gripper, mode=FROM_DESIRED
            )
        self._steps += 1
        self._position = self._position + move
        angle = float(np.linalg.norm(turn))
        if angle > 0.0:
            self._rotation = rotation_about(turn / angle, angle) @ self._rotation
        return out
