"""Pictures of a MuJoCo scene from its cameras: one OpenGL context per renderer; upright RGB, depth and geom ids."""

from __future__ import annotations

import atexit
import os
import weakref
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.gl import ensure_gl, note_renderer

# robosuite's and RoboCasa's convention: group 0 holds collision shapes, group 1 what cameras see.
COLLISION_GROUP = 0
_HIDDEN_GROUP = 5  # MuJoCo's last geom group, which no camera draws

# Process that has made an OpenGL context; a forked child inherits the number, and the driver's dead threads with it.
_context_process: int | None = None


_OPEN: weakref.WeakSet[SceneRenderer] = weakref.WeakSet()


class ForkedContextError(UserError):
    """A process forked after OpenGL was used in its parent cannot render: its driver would hang for ever."""


class SceneRenderer:
    """Renders cameras of one model.

    Args:
        model: to render.
        height: of the pictures, pixels.
        width: of the pictures, pixels.
        shadows: shadows and reflections (render preset `quality`).

    Raises:
        NoOpenGLError: nothing on this machine can render.
        ForkedContextError: this process was forked from one that had rendered.
    """

    def __init__(self, model: mujoco.MjModel, height: int, width: int, *, shadows: bool = False) -> None:
        global _context_process
        if _context_process not in (None, os.getpid()):
            raise ForkedContextError(
                "this process was forked from one that had rendered, which hangs OpenGL drivers. "
                "Start env workers with AsyncVectorEnv(..., context='forkserver') or 'spawn'."
            )
        ensure_gl()
        _context_process = os.getpid()
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._model = model
        self._aspect = width / height
        self._renderer = mujoco.Renderer(model, height, width)
        note_renderer()
        self._option = mujoco.MjvOption()
        self._option.geomgroup[COLLISION_GROUP] = 0
        self._option.sitegroup[:] = 0  # sites are markers
        self._shadows = shadows
        self._free = weakref.finalize(self, _close, self._renderer)
        # At exit the context must go before MuJoCo ends its connection to the driver. Exit hooks run backwards, so
        # ours is set after MuJoCo's, which the first context has set.
        self._free.atexit = False
        _OPEN.add(self)
        _free_at_exit()
        self._names = {model.camera(i).name for i in range(model.ncam)}

    def render(self, data: mujoco.MjData, camera: str | mujoco.MjvCamera) -> NDArray[np.uint8]:
        """A picture of shape (height, width, 3), upright.

        Raises:
            UnknownNameError: the model has no camera of that name.
        """
        # Shadows and reflections may come from geoms out of view.
        self._update(data, camera, cull=not self._shadows)
        flags = self._renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._shadows
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = self._shadows
        return self._renderer.render()

    def geometry(
        self, data: mujoco.MjData, camera: str | mujoco.MjvCamera
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth and geom ids of what a camera sees, in one pass: two upright arrays of shape (height, width).

        Depth is in metres along the optical axis (not along the ray), between the model's clipping planes; where
        nothing is seen it is the distance of the far one. Ids count the model's geoms, -1 where none is seen. What
        looks transparent counts as opaque. The same in both render presets, but for the meshes that are drawn.

        Raises:
            UnknownNameError: the model has no camera of that name.
        """
        self._update(data, camera, cull=True)
        renderer, scene = self._renderer, self._renderer.scene
        usual = scene.flags.copy()
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
        colours = np.empty((renderer.height, renderer.width, 3), dtype=np.uint8)
        buffer = np.empty((renderer.height, renderer.width), dtype=np.float32)
        if renderer._gl_context is not None:
            renderer._gl_context.make_current()
        mujoco.mjr_render(renderer._rect, scene, renderer._mjr_context)
        mujoco.mjr_readPixels(colours, buffer, renderer._rect, renderer._mjr_context)
        scene.flags[:] = usual
        depth, ids = self._metres(buffer), _geom_ids(scene, colours)
        return np.ascontiguousarray(depth[::-1]), np.ascontiguousarray(ids[::-1])

    def _update(self, data: mujoco.MjData, camera: str | mujoco.MjvCamera, *, cull: bool) -> None:
        if isinstance(camera, str) and camera not in self._names:
            raise UnknownNameError("camera", camera, self._names)
        groups = self._model.geom_group.copy()
        try:
            if isinstance(camera, str) and cull:
                self._model.geom_group[:] = np.where(
                    _in_view(self._model, data, camera, self._aspect), groups, _HIDDEN_GROUP
                )
            self._renderer.update_scene(data, camera, self._option)
        finally:
            self._model.geom_group[:] = groups

    def _metres(self, buffer: NDArray[np.float32]) -> NDArray[np.float32]:
        """Distances of a reversed depth buffer: 1 at the near plane, 0 at the far one, linear in 1 / distance."""
        near, far = clipping_planes(self._model)
        return (near * far / (near + buffer.astype(np.float64) * (far - near))).astype(np.float32)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._free()


def clipping_planes(model: mujoco.MjModel) -> tuple[float, float]:
    """Distances in metres of the near and the far plane, between which cameras see."""
    extent = model.stat.extent
    return float(model.vis.map.znear * extent), float(model.vis.map.zfar * extent)


def view_frustum(model: mujoco.MjModel, camera_id: int, aspect: float) -> tuple[float, float, float, float]:
    """Left, right, bottom and top edge of a perspective camera's view at distance 1, as MuJoCo draws it.

    A camera given by its lens shows its whole sensor whatever the picture's `aspect` (width / height): a square
    picture of a 4:3 sensor is squeezed. Its principal point is the offset of the sensor's centre, in metres as the
    focal lengths are.
    """
    width, height = (float(size) for size in model.cam_sensorsize[camera_id])
    if height == 0.0:
        top = float(np.tan(np.deg2rad(model.cam_fovy[camera_id]) / 2))
        return -top * aspect, top * aspect, -top, top
    focal_x, focal_y, offset_x, offset_y = (float(length) for length in model.cam_intrinsic[camera_id])
    return (
        (offset_x - width / 2) / focal_x,
        (offset_x + width / 2) / focal_x,
        (-offset_y - height / 2) / focal_y,
        (-offset_y + height / 2) / focal_y,
    )


def _in_view(model: mujoco.MjModel, data: mujoco.MjData, camera: str, aspect: float) -> NDArray[np.bool_]:
    """Which geoms (ngeom,) have a bounding sphere that reaches into a camera's view.

    MuJoCo draws every geom for every camera. Measured on a software rasterizer with the 168,000 visual triangles of
    robosuite's Lift: 43 instead of 31 images/s over three cameras, all pictures the same bit for bit.
    """
    camera_id = model.camera(camera).id
    if model.cam_projection[camera_id] != 0:
        return np.ones(model.ngeom, dtype=bool)  # orthographic: draw all
    rotation = data.cam_xmat[camera_id].reshape(3, 3)
    relative = (data.geom_xpos - data.cam_xpos[camera_id]) @ rotation
    depth, radius = -relative[:, 2], model.geom_rbound
    seen: NDArray[np.bool_] = depth > -radius
    left, right, bottom, top = view_frustum(model, camera_id, aspect)
    # Signed distance to each side plane of the view, positive outside.
    for axis, sign, slope in ((0, -1.0, -left), (0, 1.0, right), (1, -1.0, -bottom), (1, 1.0, top)):
        seen &= sign * relative[:, axis] - slope * depth <= radius * np.hypot(1.0, slope)
    # Planes have no bounding sphere: their radius is 0.
    return seen | (radius == 0)


def _geom_ids(scene: mujoco.MjvScene, colours: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Geom ids (height, width) of a picture in which each drawn thing has the colour of its number, from 1 on."""
    channels = colours.astype(np.int32)
    numbers = channels[..., 0] + (channels[..., 1] << 8) + (channels[..., 2] << 16)
    present, places = np.unique(numbers, return_inverse=True)
    ids = np.full(len(present), -1, dtype=np.int32)
    for index, number in enumerate(present):
        if number > 0:
            drawn = scene.geoms[number - 1]
            assert drawn.segid == number - 1, "MuJoCo numbers what it draws in the order of the scene"
            if drawn.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                ids[index] = drawn.objid
    return ids[places].reshape(numbers.shape)


@cache
def _free_at_exit() -> None:
    atexit.register(_free_all)


def _free_all() -> None:
    for renderer in list(_OPEN):
        renderer.close()


def _close(renderer: mujoco.Renderer) -> None:
    # MuJoCo's renderer frees its OpenGL objects in whichever context is current. With a second renderer alive that
    # would be the other's, whose textures and framebuffers of the same numbers would go: wrong pictures, no error.
    context = renderer._gl_context
    if context is not None:
        context.make_current()
    renderer.close()
