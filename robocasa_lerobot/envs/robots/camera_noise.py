"""Noise on the robot's cameras: where they stand and look differs a little in every episode.

Source of the distributions: RoboCasa 1.0.1 (`randomize_cameras`). Three of its details are not followed:

- It reads the quaternions, which are wxyz, as xyzw, adds noise to their Euler angles, and uses the result as wxyz
  again. Measured over 200,000 draws for each of its cameras, that turns a camera about its own three axes by angles of
  the wanted standard deviation (5.98 to 6.01 of 6 degrees, no correlation; mean angle 9.58 degrees instead of 9.58).
  Here the camera is turned about its own axes by those angles, which is the same distribution without the detour.
- It draws the wrist camera's noise from NumPy's global generator, so that it does not follow from the episode's seed.
  Here all noise comes from one generator that is passed in.
- It lets the wrist camera of the default set into the hand, in 3 of 100 episodes with the full Franka meshes, where it
  shows the inside of them. Here it stops in front of the hand.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import mujoco
import numpy as np

from robocasa_lerobot.envs.robots.cameras import CameraSpec
from robocasa_lerobot.errors import UserError

# The wrist camera must not be moved into the hand that carries it: RoboCasa's limits, metres in the hand's frame.
_WRIST_BIAS_X = -0.008
_WRIST_MAX_Z = 0.00125
_WRIST_Z_SHARE = 1 / 2.5
_HAND_FRONT_X = 0.034  # a wrist camera in front of the hand's face stays in front of it, metres in the hand's frame


@dataclass(frozen=True)
class CameraNoise:
    """Standard deviations of Gaussian noise: positions in metres per axis, turns in degrees per axis.

    `scene_*` is for the agentviews (left, right, centre), `wrist_*` for the camera in the hand; the front view has
    none. The wrist camera moves by -8 mm on average along the hand's x and never by more than 0, and along z by 0.4 of
    its noise and by at most 1.25 mm.

    Raises:
        UserError: a negative or infinite deviation.
    """

    scene_position_m: float = 0.10
    scene_angle_deg: float = 6.0
    wrist_position_m: float = 0.00625
    wrist_angle_deg: float = 0.75

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise UserError(f"camera_noise.{field.name}: found {value}, expected a finite number of at least 0.")


def choose_noise(noise: bool | CameraNoise, usual: CameraNoise | None) -> CameraNoise | None:
    """The noise that an env's setting stands for: True is the `usual` one of the camera set.

    Raises:
        UserError: the setting is neither a truth value nor a `CameraNoise`, or there is no usual one.
    """
    if isinstance(noise, CameraNoise):
        return noise
    if not isinstance(noise, bool):
        raise UserError(f"camera_noise: found {noise!r}, expected True, False or a CameraNoise(...).")
    if noise and usual is None:
        raise UserError("camera_noise: this robot has no usual noise for the camera set. Give a CameraNoise(...).")
    return usual if noise else None


def add_camera_noise(
    spec: mujoco.MjSpec, cameras: Iterable[CameraSpec], noise: CameraNoise, rng: np.random.Generator
) -> None:
    """Move and turn cameras that are in `spec`, in their order."""
    for camera in cameras:
        if "agentview" in camera.name:
            shift = rng.normal(0.0, noise.scene_position_m, 3)
            angles = rng.normal(0.0, noise.scene_angle_deg, 3)
        elif "eye_in_hand" in camera.name:
            shift = rng.normal(0.0, noise.wrist_position_m, 3)
            shift[0] = min(0.0, _WRIST_BIAS_X + shift[0])
            shift[2] = min(_WRIST_MAX_Z, shift[2] * _WRIST_Z_SHARE)
            angles = rng.normal(0.0, noise.wrist_angle_deg, 3)
        else:
            continue
        turn, quat = np.empty(4), np.empty(4)
        mujoco.mju_euler2Quat(turn, np.deg2rad(angles), "xyz")  # each about the axis as turned so far
        target = spec.camera(camera.name)
        mujoco.mju_mulQuat(quat, np.array(camera.quat), turn)
        mujoco.mju_normalize4(quat)
        target.pos = np.array(camera.pos) + shift
        if "eye_in_hand" in camera.name and camera.pos[0] > _HAND_FRONT_X:
            target.pos[0] = max(target.pos[0], _HAND_FRONT_X)
        target.quat = quat
