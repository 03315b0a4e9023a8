"""The robot's cameras: the three of the contract and the extra ones, as RoboCasa places them.

Positions in metres and quaternions wxyz are in the parent body's frame; `fovy` is the vertical field of view in
degrees. Source: RoboCasa 1.0.1 (agentviews and co-training set) and robosuite's Panda (eye in hand).

Two numbers of it are read differently. RoboCasa stores the orientations of the co-training agentviews as Euler
angles; they are quaternions here. And it gives `robot0_agentview_center` no field of view in its table of cameras, so
that MuJoCo's default of 45 degrees holds there; it has the 60 degrees of the other scene cameras here.
"""

from __future__ import annotations

from robocasa_lerobot.envs.robots.camera_noise import CameraNoise
from robocasa_lerobot.envs.robots.cameras import CameraSpec, Quat
from robocasa_lerobot.envs.robots.panda_omron import names

_LEFT_QUAT: Quat = (0.55623853, 0.29935253, -0.37678665, -0.6775092)
_RIGHT_QUAT: Quat = (0.67750919, 0.37678668, -0.29935256, -0.55623859)
# Turns by 90 degrees about x, -110 (left) or -65 (right) about y, -28 about x, in this order, each in the turned frame.
_COTRAINING_LEFT_QUAT: Quat = (0.49165097, 0.2954137, -0.42189449, -0.70215035)
_COTRAINING_RIGHT_QUAT: Quat = (0.72292757, 0.43437871, -0.27672976, -0.46055565)
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
        CameraSpec("robot0_agentview_left", names.SUPPORT, (-0.35, 0.4, 0.85), _COTRAINING_LEFT_QUAT, fovy=65.0),
        CameraSpec("robot0_agentview_right", names.SUPPORT, (-0.35, -0.35, 0.85), _COTRAINING_RIGHT_QUAT, fovy=65.0),
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

# RoboCasa's noise for each camera set; the real robot's cameras are mounted more exactly.
CAMERA_NOISE: dict[str, CameraNoise] = {
    "default": CameraNoise(),
    "cotraining": CameraNoise(scene_position_m=0.025, scene_angle_deg=0.75),
}
