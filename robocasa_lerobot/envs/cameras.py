"""The robot's cameras: the three of the contract and the extra ones, as RoboCasa places them.

Positions in metres and quaternions wxyz are in the parent body's frame; `fovy` is the vertical field of view in
degrees. Source: RoboCasa 1.0.1 (agentviews and co-training set) and robosuite's Panda (eye in hand).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco

from robocasa_lerobot import contract
from robocasa_lerobot.envs.scene import robot_names as names
from robocasa_lerobot.envs.scene.robot_bodies import Quat, Vec3
from robocasa_lerobot.errors import UnknownNameError


@dataclass(frozen=True)
class CameraSpec:
    """A camera on the robot: by field of view, or, for a camera modelled on a real one, by its lens."""

    name: str
    parent: str
    pos: Vec3
    quat: Quat
    fovy: float = 45.0
    focal_pixel: tuple[float, float] | None = None
    resolution: tuple[int, int] | None = None  # (width, height), of the real sensor
    sensor_size: tuple[float, float] | None = None


_LEFT_QUAT: Quat = (0.55623853, 0.29935253, -0.37678665, -0.6775092)
_RIGHT_QUAT: Quat = (0.67750919, 0.37678668, -0.29935256, -0.55623859)
_CENTER = CameraSpec(
    "robot0_agentview_center",
    names.SUPPORT,
    (-0.6, 0.0, 1.15),
    (0.6369459, 0.33251855, -0.31992382, -0.61755961),
    fovy=60.0,
)
_FRONT = CameraSpec(
    "robot0_frontview",
    names.SUPPORT,
    (-0.5, 0.0, 0.95),
    (0.60889369, 0.38146779, -0.36739075, -0.59055454),
    fovy=60.0,
)

# Named sets of cameras; every set has the contract's three.
CAMERA_SETS: dict[str, tuple[CameraSpec, ...]] = {
    "default": (
        CameraSpec("robot0_agentview_left", names.SUPPORT, (-0.5, 0.35, 1.05), _LEFT_QUAT, fovy=60.0),
        CameraSpec("robot0_agentview_right", names.SUPPORT, (-0.5, -0.35, 1.05), _RIGHT_QUAT, fovy=60.0),
        CameraSpec("robot0_eye_in_hand", names.HAND, (0.05, 0.0, 0.0), (0.0, 0.707107, 0.707107, 0.0), fovy=75.0),
        _CENTER,
        _FRONT,
    ),
    # The poses and the wrist lens of the real robot, for training on simulated and real data together.
    "cotraining": (
        CameraSpec("robot0_agentview_left", names.SUPPORT, (-0.35, 0.4, 0.85), _LEFT_QUAT, fovy=65.0),
        CameraSpec("robot0_agentview_right", names.SUPPORT, (-0.35, -0.35, 0.85), _RIGHT_QUAT, fovy=65.0),
        CameraSpec(
            "robot0_eye_in_hand",
            names.HAND,
            (-0.029, 0.0, 0.05),
            (-0.116144, -0.6975031, 0.6975031, 0.1161439),
            focal_pixel=(606.0, 606.0),
            resolution=(640, 480),
            sensor_size=(5.5, 3.0),
        ),
        _CENTER,
        _FRONT,
    ),
}


def add_cameras(spec: mujoco.MjSpec, camera_set: str = "default") -> None:
    """Add a set of cameras to the robot's bodies in `spec`.

    Raises:
        UnknownNameError: there is no camera set of that name.
    """
    if camera_set not in CAMERA_SETS:
        raise UnknownNameError("camera set", camera_set, CAMERA_SETS)
    for camera in CAMERA_SETS[camera_set]:
        added = spec.body(camera.parent).add_camera(name=camera.name, pos=camera.pos, quat=camera.quat)
        if camera.focal_pixel and camera.resolution and camera.sensor_size:
            added.focal_pixel = camera.focal_pixel
            added.resolution = camera.resolution
            added.sensor_size = camera.sensor_size
        else:
            added.fovy = camera.fovy


def camera_configs(model: mujoco.MjModel) -> dict[str, Any]:
    """Policy cameras: parent body, position (metres), quaternion wxyz, vertical field of view (degrees)."""
    return {
        name: {
            "parent_body": model.body(int(model.camera(name).bodyid[0])).name,
            "pos": model.camera(name).pos.tolist(),
            "quat": model.camera(name).quat.tolist(),
            "fovy": float(model.cam_fovy[model.camera(name).id]),
        }
        for name in contract.CAMERAS
    }
