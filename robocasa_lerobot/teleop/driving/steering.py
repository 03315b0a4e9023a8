"""From what an operator holds to a 12-D action: frames of motion, the zeros of the two modes, speed, dead zones."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, DEAD_ZONES, FROM_ACHIEVED, FROM_DESIRED, OPEN, Array, action
from robocasa_lerobot.envs.robots.robot import RobotNames
from robocasa_lerobot.teleop.messages import Message

TURN_SHARE = 0.5  # of a full command for a turn at full deflection: 70 degrees a second
TORSO_SHARE = 0.2  # as RoboCasa's devices have it
_STILL = 1e-3  # deflections below it are none
_WRIST_CAMERA = "robot0_eye_in_hand"
# Columns: forward, left and up of a camera's picture in MuJoCo's axes of cameras (x right, y up, z backwards).
_OF_CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Held:
    """What is held: axes in [-1, 1] as of the message `input`.

    Attributes:
        arm: forward, left, up, and turns about them, in the frame of motion.
        base: forward, left, turn to the left.
        torso: up.
        frame, camera: of motion, or "" for the one that is set.
    """

    arm: tuple[float, ...] = (0.0,) * 6
    base: tuple[float, ...] = (0.0,) * 3
    torso: float = 0.0
    frame: str = ""
    camera: str = ""

    @classmethod
    def of(cls, message: Message) -> Held:
        """From an `input`."""
        return cls(
            message.get("arm", cls.arm),
            message.get("base", cls.base),
            message.get("torso", 0.0),
            message.get("motion_frame", ""),
            message.get("motion_camera", ""),
        )

    @property
    def moves(self) -> bool:
        """Whether anything is held."""
        return any(abs(value) > _STILL for value in (*self.arm, *self.base, self.torso))


NOTHING = Held()


@dataclass
class Steering:
    """How deflections are meant.

    Attributes:
        mode: "arm", "base" or "both"; the first two have the zeros that human data have.
        speed: share of full speed, in (0, 1].
        frame, camera: of motion of the arm.
        closed: whether the gripper is told to close.
    """

    mode: str = "arm"
    speed: float = 0.5
    frame: str = "base"
    camera: str = "robot0_agentview_left"
    closed: bool = False

    def action(self, model: mujoco.MjModel, data: mujoco.MjData, robot: RobotNames, held: Held) -> Array:
        """The action (12,), stored order, for what is held in a state.

        Mode "arm": base zeros, control mode -1; "base": arm zeros, +1; "both": all, +1 while the base is told to move.
        """
        gripper = CLOSED if self.closed else OPEN
        arm: Array = np.zeros(6)
        base: Array = np.zeros(4)
        if self.mode != "base":
            axes = motion_axes(model, data, robot, held.frame or self.frame, held.camera or self.camera)
            wanted = np.array(held.arm) * self.speed
            arm = np.concatenate([axes @ wanted[:3], TURN_SHARE * (axes @ wanted[3:])])
        if self.mode != "arm":
            base = base_command((*held.base, held.torso), self.speed)
        mode = FROM_DESIRED if self.mode == "base" or base.any() else FROM_ACHIEVED
        arm = np.clip(arm, -1.0, 1.0)
        return action(position=arm[:3], rotation=arm[3:], gripper=gripper, base=base, mode=mode)


def base_command(deflections: tuple[float, ...], speed: float) -> Array:
    """The command (4,) of the base for deflections forward, left, turn and torso: beyond the dead zones at once.

    A base at rest answers to no command below 0.25 (a turn: 0.11), so that the rest of the range is what speeds share.
    """
    wanted = np.array(deflections)
    shares = np.where(np.abs(wanted) > _STILL, np.abs(wanted) * speed, 0.0)
    command = np.sign(wanted) * np.where(shares > 0, DEAD_ZONES + (1.0 - DEAD_ZONES) * shares, 0.0)
    command[3] *= TORSO_SHARE
    return np.asarray(command)


def motion_axes(model: mujoco.MjModel, data: mujoco.MjData, robot: RobotNames, frame: str, camera: str) -> Array:
    """Forward, left and up of a frame of motion as columns (3, 3), in the axes that the arm's controller has.

    Args:
        model: with the robot.
        data: present state.
        robot: names of its parts.
        frame: "base", "camera" or "gripper".
        camera: name of the camera whose picture is meant, for "camera".
    """
    if frame == "base":
        return np.eye(3)
    controller = data.site(robot.arm_center_site).xmat.reshape(3, 3)
    if frame == "camera":
        return np.asarray(controller.T @ data.cam(camera).xmat.reshape(3, 3) @ _OF_CAMERA)
    hand = data.body(robot.hand).xmat.reshape(3, 3)
    picture = data.cam(_WRIST_CAMERA).xmat.reshape(3, 3) @ _OF_CAMERA
    # The hand's own axes, upright as the wrist camera shows them: a tilted lens tilts no motion.
    forward = hand[:, 2]
    up = hand[:, 0] * np.sign(hand[:, 0] @ picture[:, 2])
    return np.asarray(controller.T @ np.column_stack([forward, np.cross(up, forward), up]))
