"""Following a joint path: the hand is led along the poses that it has there."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import Array, HandTarget, arm_action, axis_angle, pose_error, rotation_about
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


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
GENTLY = Following(most_steps=20)  # more slowly
Command = Callable[[HandTarget, float], Array]


def follow_joint_path(
    env: KitchenEnv,
    joints: Array,
    gripper: float,
    how: Following = CLOSELY,
    command: Command | None = None,
    *,
    level: bool = False,
) -> Iterator[Array]:
    """Lead the hand as it goes when all joints turn evenly from where they are to each row of a path in turn.

    Args:
        env: the kitchen.
        joints: (7,) or (k, 7) radians.
        gripper: OPEN or CLOSED.
        how: how closely.
        command: the action for a wanted pose; None takes the plain servo.
        level: whether what is held stays upright, as of `hand_poses`.
    """
    data = env.data
    arm = Arm(env.model, data, env.scene.robot)
    plain: Command = lambda target, fingers: arm_action(data, target, fingers)  # noqa: E731
    act = command or plain
    poses = hand_poses(arm, np.array(data.qpos[arm.addresses]), np.atleast_2d(joints), how, level=level)
    for position, turn in zip(*poses, strict=True):
        for _ in range(how.most_steps):
            target = in_room(env, position, turn)
            error = pose_error(data, target)
            if error.position < how.near_m and error.rotation < how.near_rad:
                break
            yield act(target, gripper)


def joint_line(arm: Arm, start: Array, end: Array, how: Following) -> Array:
    """Joint angles (n, 7) of the poses between two configurations (7,), the last one included."""
    ends, _ = arm.forward(np.stack([start, end]))
    far = how.per_m * float(np.linalg.norm(ends[1] - ends[0])) + how.per_rad_m * float(np.abs(end - start).max())
    count = max(int(np.ceil(far / how.spacing_m)), 1)
    shares = np.arange(1, count + 1)[:, None] / count
    line: Array = start + shares * (end - start)
    return line


def hand_poses(arm: Arm, start: Array, path: Array, how: Following, *, level: bool = False) -> tuple[Array, Array]:
    """Grip positions (n, 3) and hand rotations (n, 3, 3), in the arm's frame, along a joint path (k, 7) from `start`.

    Joints that turn evenly tilt the hand on the way, also where it is upright at both ends. With `level` it turns
    evenly instead from its first rotation to its last one: what both hold upright, all between them do.
    """
    positions, turns = arm.forward(
        np.concatenate([joint_line(arm, one, other, how) for one, other in itertools.pairwise([start, *path])])
    )
    if level:
        first = arm.forward(start[None])[1][0]
        turn = axis_angle(turns[-1] @ first.T)
        angle = float(np.linalg.norm(turn))
        axis = turn / max(angle, 1e-9)
        count = len(turns)
        turns = np.array([rotation_about(axis, angle * step / count) @ first for step in range(1, count + 1)])
    return positions, turns


def in_room(env: KitchenEnv, position: Array, turn: Array) -> HandTarget:
    """A pose of the arm's frame in the world, as the base stands now."""
    frame = env.data.site(env.scene.robot.names.arm_center_site)
    axes = frame.xmat.reshape(3, 3)
    return HandTarget(frame.xpos + axes @ position, axes @ turn)
