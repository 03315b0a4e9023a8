"""Noise on how the robot starts: its arm's joint angles, and where its base stands and points."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.envs.scene.robot_poses import RobotPose, is_free
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.errors import UserError

_BASE_NOISE_STREAM = 3  # key of its generator, apart from those of the scene, the arm and the cameras
_TRIES = 100


@dataclass(frozen=True)
class InitialNoise:
    """Standard deviations of Gaussian noise on the robot's start.

    Args:
        arm_rad: on each arm joint, radians; RoboCasa's own episodes have 0.02.
        base_position_m: on the base's position along x and y, metres, on top of the task's own spread.
        base_yaw_deg: on its heading, degrees.

    Raises:
        UserError: a negative or infinite deviation.
    """

    arm_rad: float = 0.02
    base_position_m: float = 0.0
    base_yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise UserError(f"initial_noise.{field.name}: found {value}, expected a finite number of at least 0.")


def add_initial_noise(scene: Scene, noise: InitialNoise) -> None:
    """Move the start of a scene's robot, before its `initial_data`; the noise follows from the scene's seed.

    A base pose that would stand in a fixture is drawn again; where none of 100 is free, the base stays.
    """
    scene.arm_noise_rad = noise.arm_rad
    if noise.base_position_m == 0.0 and noise.base_yaw_deg == 0.0:
        return
    rng = np.random.default_rng([scene.seed, _BASE_NOISE_STREAM])
    start = scene.robot_pose
    for _ in range(_TRIES):
        shift = rng.normal(0.0, noise.base_position_m, 2)
        turn = np.deg2rad(rng.normal(0.0, noise.base_yaw_deg))
        pose = RobotPose(start.x + float(shift[0]), start.y + float(shift[1]), start.yaw + float(turn), start.side)
        if is_free(scene.fixtures, pose, scene.robot.shape):
            scene.robot_pose = pose
            return
