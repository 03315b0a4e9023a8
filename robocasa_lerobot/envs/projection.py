"""From points of the world to pixels of a camera's picture, and back where the depth is known.

Pixel coordinates (u, v) count from the picture's upper left corner to the right and down; whole numbers are the
middles of pixels. The frame of a camera is that of computer vision: x to the right, y down, z along the optical axis.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering import clipping_planes, view_frustum
from robocasa_lerobot.errors import UnknownNameError, UserError

Array = NDArray[np.float64]


def camera_matrix(
    model: mujoco.MjModel, data: mujoco.MjData, camera: str, size: int | tuple[int, int]
) -> tuple[Array, Array]:
    """Intrinsics (3, 3) in pixels and present pose (4, 4), camera to world in metres, of a camera of the model.

    `size` is height and width of the picture, or both in one.

    Raises:
        UnknownNameError: the model has no camera of that name.
        UserError: the camera is orthographic.
    """
    names = [model.camera(i).name for i in range(model.ncam)]
    if camera not in names:
        raise UnknownNameError("camera", camera, names)
    index = names.index(camera)
    if model.cam_projection[index] != 0:
        raise UserError(f"camera {camera!r} is orthographic, which a camera matrix cannot say; use a perspective one.")
    height, width = (size, size) if isinstance(size, int) else size
    left, right, bottom, top = view_frustum(model, index, width / height)
    focal_x, focal_y = width / (right - left), height / (top - bottom)
    intrinsics = np.array([[focal_x, 0.0, -left * focal_x - 0.5], [0.0, focal_y, top * focal_y - 0.5], [0.0, 0.0, 1.0]])
    pose = np.eye(4)
    # MuJoCo's cameras look along -z with y up.
    pose[:3, :3] = data.cam_xmat[index].reshape(3, 3) * (1.0, -1.0, -1.0)
    pose[:3, 3] = data.cam_xpos[index]
    return intrinsics, pose


def project(points: Array, intrinsics: Array, pose: Array) -> tuple[Array, Array]:
    """Pixels (..., 2) and depths (...) in metres of world points (..., 3); a depth <= 0 lies behind the camera."""
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    depth = local[..., 2]
    return (local @ intrinsics.T)[..., :2] / depth[..., None], depth


def back_project(depth: NDArray[np.float32], intrinsics: Array, pose: Array) -> Array:
    """World points (height, width, 3), metres, of a depth picture of shape (height, width) or (height, width, 1)."""
    metres = np.asarray(depth, dtype=np.float64).reshape(depth.shape[:2])
    v, u = np.indices(metres.shape, dtype=np.float64)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(intrinsics).T
    points: Array = rays * metres[..., None] @ pose[:3, :3].T + pose[:3, 3]
    return points


def raw_depth(depth: NDArray[np.float32], model: mujoco.MjModel) -> NDArray[np.float32]:
    """Metres as the numbers that robosuite's depth observations hold: OpenGL's buffer, 0 near to 1 far, same shape.

    They depend on the clipping planes of the model, which are not those of robosuite's.
    """
    near, far = clipping_planes(model)
    metres = np.asarray(depth, dtype=np.float64)
    return (far * (metres - near) / (metres * (far - near))).astype(np.float32)
