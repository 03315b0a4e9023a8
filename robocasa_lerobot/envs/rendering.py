"""Pictures of a scene from its cameras: one OpenGL context per process and model, upright RGB out."""

from __future__ import annotations

import os
import weakref

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.gl import ensure_gl

COLLISION_GROUP = 0  # geoms that only collide are not shown


# Process that has made an OpenGL context; a forked child inherits the number, and the driver's dead threads with it.
_context_process: int | None = None


class ForkedContextError(UserError):
    """A process forked after OpenGL was used in its parent cannot render: its driver would hang for ever."""


class SceneRenderer:
    """Renders cameras of one model.

    Args:
        model: to render.
        height, width: of the pictures, pixels.
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
        self._renderer = mujoco.Renderer(model, height, width)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[COLLISION_GROUP] = 0
        self._shadows = shadows
        # Also at exit, before Python takes the OpenGL library down under the context.
        self._free = weakref.finalize(self, _close, self._renderer)
        self._names = {model.camera(i).name for i in range(model.ncam)}

    def render(self, data: mujoco.MjData, camera: str | mujoco.MjvCamera) -> NDArray[np.uint8]:
        """A picture of shape (height, width, 3), upright.

        Raises:
            UnknownNameError: the model has no camera of that name.
        """
        if isinstance(camera, str) and camera not in self._names:
            raise UnknownNameError("camera", camera, self._names)
        self._renderer.update_scene(data, camera, self._option)
        flags = self._renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._shadows
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = self._shadows
        return self._renderer.render()

    def close(self) -> None:
        """Free the OpenGL context."""
        self._free()


def _close(renderer: mujoco.Renderer) -> None:
    # MuJoCo's renderer frees its OpenGL objects in whichever context is current. With a second renderer alive that
    # would be the other's, whose textures and framebuffers of the same numbers would go: wrong pictures, no error.
    context = renderer._gl_context
    if context is not None:
        context.make_current()
    renderer.close()
