"""Pictures of a MuJoCo scene from its cameras: one OpenGL context per renderer, upright RGB out."""

from __future__ import annotations

import atexit
import os
import weakref
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.gl import ensure_gl

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
        if isinstance(camera, str) and camera not in self._names:
            raise UnknownNameError("camera", camera, self._names)
        groups = self._model.geom_group.copy()
        try:
            if isinstance(camera, str) and not self._shadows:
                self._model.geom_group[:] = np.where(
                    _in_view(self._model, data, camera, self._aspect), groups, _HIDDEN_GROUP
                )
            self._renderer.update_scene(data, camera, self._option)
        finally:
            self._model.geom_group[:] = groups
        flags = self._renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._shadows
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = self._shadows
        return self._renderer.render()

    def close(self) -> None:
        """Free the OpenGL context."""
        self._free()


def _in_view(model: mujoco.MjModel, data: mujoco.MjData, camera: str, aspect: float) -> NDArray[np.bool_]:
    """Which geoms (ngeom,) have a bounding sphere that reaches into a camera's view.

    MuJoCo draws every geom for every camera. Measured on a software rasterizer with the 168,000 visual triangles of
    robosuite's Lift: 43 instead of 31 images/s over three cameras, all pictures the same bit for bit. Shadows and
    reflections may come from geoms out of view, so this is for pictures without them.
    """
    camera_id = model.camera(camera).id
    if model.cam_projection[camera_id] != 0 or model.cam_sensorsize[camera_id].any():
        return np.ones(model.ngeom, dtype=bool)  # orthographic or given by focal lengths: draw all
    rotation = data.cam_xmat[camera_id].reshape(3, 3)
    relative = (data.geom_xpos - data.cam_xpos[camera_id]) @ rotation
    depth, radius = -relative[:, 2], model.geom_rbound
    half = np.deg2rad(model.cam_fovy[camera_id]) / 2
    seen: NDArray[np.bool_] = depth > -radius
    for axis, angle in ((1, half), (0, np.arctan(np.tan(half) * aspect))):
        seen &= np.abs(relative[:, axis]) * np.cos(angle) - depth * np.sin(angle) <= radius
    # Planes have no bounding sphere: their radius is 0.
    return seen | (radius == 0)


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
