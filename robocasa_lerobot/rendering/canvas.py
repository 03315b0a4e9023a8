"""A drawing surface of its own OpenGL context for one model."""

from __future__ import annotations

import atexit
import os
import weakref
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gl import ensure_gl, note_renderer
from robocasa_lerobot.rendering.frustum import clipping_planes, distances, in_view

# robosuite's and RoboCasa's convention: group 0 holds collision shapes, group 1 what cameras see.
COLLISION_GROUP = 0
_HIDDEN_GROUP = 5  # MuJoCo's last geom group, which no camera draws
_SPARE_GEOMS = 200  # of a scene, beyond the model's own: lights, skins and the like
# Parts of what is seen that are drawn one after the other, the nearest first. Near ones hide the rest before its
# pixels are computed; more parts than this cost more than they save.
_LAYERS = 12

# Process that has made an OpenGL context; a forked child inherits the number, and the driver's dead threads with it.
_context_process: int | None = None
_open: weakref.WeakSet[Canvas] = weakref.WeakSet()


class ForkedContextError(UserError):
    """A process forked after OpenGL was used in its parent cannot render: its driver would hang for ever."""


class Canvas:
    """Draws one model into pictures of one size; shadows must be asked for when it is made.

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
        shadow_size = model.vis.quality.shadowsize
        if not shadows:  # the map of a shadow takes 64 MiB and a tenth of a second to make, used or not
            model.vis.quality.shadowsize = 0
        self._renderer = mujoco.Renderer(model, height, width, max_geom=model.ngeom + _SPARE_GEOMS)
        model.vis.quality.shadowsize = shadow_size
        note_renderer()
        self._option = mujoco.MjvOption()
        self._option.geomgroup[COLLISION_GROUP] = 0
        self._option.sitegroup[:] = 0  # sites are markers
        self._nothing_moved = mujoco.MjvPerturb()
        self._free = weakref.finalize(self, _close, self._renderer)
        # At exit the context must go before MuJoCo ends its connection to the driver. Exit hooks run backwards, so
        # ours is set after MuJoCo's, which the first context has set.
        self._free.atexit = False
        _open.add(self)
        _free_at_exit()

    def see(self, data: mujoco.MjData, camera: int | mujoco.MjvCamera, *, cull: bool) -> None:
        """Aim a camera, by its number or free; with `cull` only what reaches into its view will be drawn."""
        groups = self._model.geom_group.copy()
        try:
            if isinstance(camera, int) and cull:
                seen = in_view(self._model, data, camera, self._aspect)
                self._model.geom_group[:] = np.where(seen, groups, _HIDDEN_GROUP)
            self._renderer.update_scene(data, camera, self._option)
        finally:
            self._model.geom_group[:] = groups

    def see_nearest_first(self, data: mujoco.MjData, camera: int) -> None:
        """Aim a camera, and have what reaches into its view drawn from the nearest to the farthest.

        For models of geoms alone.
        """
        model, scene = self._model, self._renderer.scene
        groups = model.geom_group.copy()
        seen = np.flatnonzero(in_view(model, data, camera, self._aspect))
        order = seen[np.argsort(distances(model, data, camera)[seen], kind="stable")]
        try:
            model.geom_group[:] = _HIDDEN_GROUP
            self._renderer.update_scene(data, camera, self._option)
            for layer in np.array_split(order, _LAYERS):
                model.geom_group[layer] = groups[layer]
                every = int(mujoco.mjtCatBit.mjCAT_ALL)
                mujoco.mjv_addGeoms(model, data, self._option, self._nothing_moved, every, scene)
                model.geom_group[layer] = _HIDDEN_GROUP
        finally:
            model.geom_group[:] = groups

    def picture(self, *, shadows: bool) -> NDArray[np.uint8]:
        """What was last seen, RGB of shape (height, width, 3), upright; with shadows and reflections or without."""
        flags = self._renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = shadows
        return self._renderer.render()

    def geometry(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth in metres and geom ids (-1 where none is seen) of what was last seen, each (height, width), upright."""
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

    def close(self) -> None:
        """Free the OpenGL context."""
        self._free()

    def _metres(self, buffer: NDArray[np.float32]) -> NDArray[np.float32]:
        """Distances of a reversed depth buffer: 1 at the near plane, 0 at the far one, linear in 1 / distance."""
        near, far = clipping_planes(self._model)
        return (near * far / (near + buffer.astype(np.float64) * (far - near))).astype(np.float32)


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
    for canvas in list(_open):
        canvas.close()


def _close(renderer: mujoco.Renderer) -> None:
    # MuJoCo's renderer frees its OpenGL objects in whichever context is current. With a second renderer alive that
    # would be the other's, whose textures and framebuffers of the same numbers would go: wrong pictures, no error.
    context = renderer._gl_context
    if context is not None:
        context.make_current()
    renderer.close()
