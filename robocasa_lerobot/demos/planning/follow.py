"""Following a joint path: the hand is led along the poses that it has on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import Array, HandTarget, arm_action, pose_error
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE


@dataclass(frozen=True)
class Following:
    """How closely the hand keeps to the poses of a path.

    Attributes:
        spacing_m: between the poses that it is led along.
        per_m, per_rad_m: what a metre of the hand, and a radian of the joint that turns most, count in that.
        near_m, near_rad: from where on it goes for the next pose.
        most_steps: control steps that a pose is waited for.
    """

    spacing_m: float = 0.06
    per_m: float = 1.0
    per_rad_m: float = 0.15
    near_m: float = 0.06
    near_rad: float = 0.5
    most_steps: int = 10


CLOSELY = Following()
Command = Callable[[HandTarget, float], Array]


def follow_joint_path(
    env: KitchenEnv, joints: Array, gripper: float, how: Following = CLOSELY, command: Command | None = None
) -> Iterator[Array]:
    """Lead the hand as it goes when all joints turn evenly from where they are to each row of a path in turn.

    Args:
        env: the kitchen.
        joints: (7,) or (k, 7) radians.
        gripper: OPEN or CLOSED.
        how: how closely.
        command: the action for a wanted pose; None takes the plain servo.
    """
    data = env.data
    arm = Arm(env.model, data)
    plain: Command = lambda target, fingers: arm_action(data, target, fingers)  # noqa: E731
    act = command or plain
    start: Array = np.array(data.qpos[arm.addresses])
    for end in np.atleast_2d(joints):
        for target in _between(arm, data, start, end, how):
            for _ in range(how.most_steps):
                error = pose_error(data, target())
                if error.position < how.near_m and error.rotation < how.near_rad:
                    break
                yield act(target(), gripper)
        start = end


def joint_line(arm: Arm, start: Array, end: Array, how: Following) -> Array:
    """Joint angles (n, 7) of the poses between two configurations (7,), the last one included."""
    ends, _ = arm.forward(np.stack([start, end]))
    far = how.per_m * float(np.linalg.norm(ends[1] - ends[0])) + how.per_rad_m * float(np.abs(end - start).max())
    count = max(int(np.ceil(far / how.spacing_m)), 1)
    shares = np.arange(1, count + 1)[:, None] / count
    line: Array = start + shares * (end - start)
    return line


def _between(
    arm: Arm, data: mujoco.MjData, start: Array, end: Array, how: Following
) -> Iterator[Callable[[], HandTarget]]:
    """Poses along a line, each in the world as the base stands when it is asked for."""
    positions, turns = arm.forward(joint_line(arm, start, end, how))
    for position, turn in zip(positions, turns, strict=True):

        def target(position: Array = position, turn: Array = turn) -> HandTarget:
            frame = data.site(ARM_CENTER_SITE)
            axes = frame.xmat.reshape(3, 3)
            return HandTarget(frame.xpos + axes @ position, axes @ turn)

        yield target
