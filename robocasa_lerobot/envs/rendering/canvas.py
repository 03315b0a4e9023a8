"""A drawing surface for one model. All surfaces of a thread share one OpenGL context.

A driver compiles its programs anew for every context: on a software rasterizer a surface in a context of its own takes
65 ms to make and 14 ms more for its first pictures, in a shared one 10 ms.
"""

from __future__ import annotations

import atexit
import os
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.frustum import clipping_planes, distances, in_view
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gl import ensure_gl, no_context, note_renderer

# robosuite's and RoboCasa's convention: group 0 holds collision shapes, group 1 what cameras see.
COLLISION_GROUP = 0
# Of geoms behind all others, however near their boxes: drawn last, they cost next to nothing where they are hidden.
BACKDROP_GROUP = 2
_HIDDEN_GROUP = 5  # MuJoCo's last geom group, which no camera draws
_SPARE_GEOMS = 200  # of a scene, beyond the model's own: lights, skins and the like
# Distances in metres between the parts of a view that are drawn one after the other, the nearest first. Near
# ones hide the rest before its pixels are computed; more than a dozen parts cost more than they save.
LAYER_EDGES_M = (0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.5)
# What `MjrContext` knows of the framebuffer that pictures are drawn into.
_FRAMEBUFFER = ("offFBO", "offFBO_r", "offColor", "offColor_r", "offDepthStencil", "offDepthStencil_r")
_CONTEXT_SIZE = 64  # of the window that some drivers need; pictures are drawn elsewhere

# Process that has made an OpenGL context; a forked child inherits the number, and the driver's dead threads with it.
_context_process: int | None = None
_open: weakref.WeakSet[Canvas] = weakref.WeakSet()
_of_thread = threading.local()  # `context`: the thread's OpenGL context, which no other thread can use


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
        self._model = model
        self._aspect = width / height
        asked, quality = model.vis.global_, model.vis.quality
        usual = asked.offwidth, asked.offheight, quality.shadowsize
        # Every picture clears the whole framebuffer: one of MuJoCo's 640 x 480 takes 0.3 ms more than one of 256 x 256.
        asked.offwidth, asked.offheight = width, height
        if not shadows:  # the map of a shadow takes 64 MiB and a tenth of a second to make, used or not
            quality.shadowsize = 0
        self._surface = _Surface(model, height, width)
        asked.offwidth, asked.offheight, quality.shadowsize = usual
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + _SPARE_GEOMS)
        note_renderer()
        self._option = mujoco.MjvOption()
        self._option.geomgroup[COLLISION_GROUP] = 0
        self._option.sitegroup[:] = 0  # sites are markers
        self._nothing_moved = mujoco.MjvPerturb()
        self._free = weakref.finalize(self, self._surface.close)
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
            self._update(data, camera)
        finally:
            self._model.geom_group[:] = groups

    def see_nearest_first(self, data: mujoco.MjData, camera: int, geoms: NDArray[np.bool_]) -> None:
        """Aim a camera, and have these geoms, (ngeom,) of what is in its view, drawn from the nearest to the farthest.

        For models of geoms alone.
        """
        model, scene = self._model, self._scene
        groups = model.geom_group.copy()
        seen = np.flatnonzero(geoms)
        # By distance alone: where faces lie in one plane, the order decides, and must not hang on what was left out.
        layers = np.searchsorted(LAYER_EDGES_M, distances(model, data, camera)[seen])
        layers[groups[seen] == BACKDROP_GROUP] = len(LAYER_EDGES_M) + 1
        try:
            model.geom_group[:] = _HIDDEN_GROUP
            self._update(data, camera)
            for number in range(len(LAYER_EDGES_M) + 2):
                layer = seen[layers == number]
                if len(layer) == 0:
                    continue
                model.geom_group[layer] = groups[layer]
                every = int(mujoco.mjtCatBit.mjCAT_ALL)
                mujoco.mjv_addGeoms(model, data, self._option, self._nothing_moved, every, scene)
                model.geom_group[layer] = _HIDDEN_GROUP
        finally:
            model.geom_group[:] = groups

    def picture(self, *, shadows: bool) -> NDArray[np.uint8]:
        """What was last seen, RGB of shape (height, width, 3), upright; with shadows and reflections or without."""
        self.draw(shadows=shadows)
        return self.drawn()

    def draw(self, number: int = 0, *, shadows: bool) -> None:
        """Begin a picture of what was last seen; several may be begun, each with a number, before one is taken."""
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = shadows
        self._surface.draw(self._scene, number)

    def drawn(self, number: int = 0) -> NDArray[np.uint8]:
        """The picture of that number, RGB of shape (height, width, 3), upright."""
        colours, _ = self._surface.read(number, depth=False)
        return np.ascontiguousarray(colours[::-1])

    def drawn_with_depth(self, number: int = 0) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """The picture of that number and its reversed depth buffer, (height, width), both the lowest row first."""
        colours, buffer = self._surface.read(number, depth=True)
        assert buffer is not None
        return colours, buffer

    def drawn_depth(self, number: int = 0) -> NDArray[np.float32]:
        """The reversed depth buffer, (height, width), of what was last seen, as if nothing were transparent."""
        with self._as_segments():
            self._surface.draw(self._scene, number)
            return self.drawn_with_depth(number)[1]

    def in_view(self, data: mujoco.MjData, camera: int) -> NDArray[np.bool_]:
        """Which geoms, (ngeom,), reach into a camera's view."""
        return in_view(self._model, data, camera, self._aspect)

    def geometry(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth in metres and geom ids (-1 where none is seen) of what was last seen, each (height, width), upright."""
        with self._as_segments():
            self._surface.draw(self._scene)
            colours, buffer = self.drawn_with_depth()
        depth, ids = self._metres(buffer), _geom_ids(self._scene, colours)
        return np.ascontiguousarray(depth[::-1]), np.ascontiguousarray(ids[::-1])

    @contextmanager
    def _as_segments(self) -> Iterator[None]:
        """Each geom in the colour of its number, and opaque."""
        flags = self._scene.flags
        usual = flags.copy()
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
        try:
            yield
        finally:
            flags[:] = usual

    def close(self) -> None:
        """Free what it holds on the graphics card."""
        self._free()

    def _update(self, data: mujoco.MjData, camera: int | mujoco.MjvCamera) -> None:
        if isinstance(camera, int):
            number, camera = camera, mujoco.MjvCamera()
            camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, number
        every = int(mujoco.mjtCatBit.mjCAT_ALL)
        mujoco.mjv_updateScene(self._model, data, self._option, None, camera, every, self._scene)

    def _metres(self, buffer: NDArray[np.float32]) -> NDArray[np.float32]:
        """Distances of a reversed depth buffer: 1 at the near plane, 0 at the far one, linear in 1 / distance."""
        near, far = clipping_planes(self._model)
        return (near * far / (near + buffer.astype(np.float64) * (far - near))).astype(np.float32)


def _geom_ids(scene: mujoco.MjvScene, colours: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Geom ids (height, width) of a picture in which each drawn geom has the colour of its number, from 1 on."""
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
    context, _of_thread.context = getattr(_of_thread, "context", None), None
    if context is not None:
        context.free()


class _Surface:
    """What MuJoCo's renderer keeps on the graphics card for one model: framebuffers, meshes, textures.

    A picture is computed while the next one is prepared, if that goes into another framebuffer and is read later.
    """

    def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
        self._height, self._width = height, width
        self._context = _shared_context()
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._kept: mujoco.MjrContext | None = _context_of(model)
        self._samples = model.vis.quality.offsamples
        self._more: list[mujoco.MjrContext] = []  # of nothing: their framebuffers are used
        self._framebuffers = [_framebuffer(self._kept)]

    def draw(self, scene: mujoco.MjvScene, number: int = 0) -> None:
        """Have the framebuffer of that number drawn; it may not be finished yet when this returns."""
        mujoco.mjr_render(self._rectangle, scene, self._chosen(number))

    def read(self, number: int = 0, *, depth: bool) -> tuple[NDArray[np.uint8], NDArray[np.float32] | None]:
        """Colours (height, width, 3), and depth buffer (height, width) if asked for, the lowest row first."""
        colours = np.empty((self._height, self._width, 3), np.uint8)
        buffer = np.empty((self._height, self._width), np.float32) if depth else None
        mujoco.mjr_readPixels(colours, buffer, self._rectangle, self._chosen(number))
        return colours, buffer

    def _chosen(self, number: int) -> mujoco.MjrContext:
        """MuJoCo's context, current and with the framebuffer of that number: another surface's may have been."""
        assert self._kept is not None, "it is closed"
        if self._context is not None:
            self._context.make_current()
        while number >= len(self._framebuffers):
            self._more.append(_context_of(_nothing(self._height, self._width, self._samples)))
            self._framebuffers.append(_framebuffer(self._more[-1]))
        for name, value in self._framebuffers[number].items():
            setattr(self._kept, name, value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._kept)
        return self._kept

    def close(self) -> None:
        """Free all of it."""
        kept, self._kept = self._kept, None
        if kept is None:
            return
        # MuJoCo frees objects by their numbers in whichever context is current: not in that of another thread.
        if self._context is not None:
            self._context.make_current()
        for name, value in self._framebuffers[0].items():
            setattr(kept, name, value)  # each frees its own
        for context in (kept, *self._more):
            context.free()
        self._more.clear()


def _context_of(model: mujoco.MjModel) -> mujoco.MjrContext:
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
    except mujoco.FatalError as error:  # of a backend for windows, where there is no display
        raise no_context(error) from error
    context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
    return context


def _framebuffer(context: mujoco.MjrContext) -> dict[str, int]:
    """OpenGL's numbers of what a context draws into."""
    return {name: getattr(context, name) for name in _FRAMEBUFFER}


@cache
def _nothing(height: int, width: int, samples: int) -> mujoco.MjModel:
    """A model without anything in it, whose pictures have that size."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offheight, spec.visual.global_.offwidth = height, width
    spec.visual.quality.offsamples, spec.visual.quality.shadowsize = samples, 0
    return spec.compile()


def _shared_context() -> Any:
    """This thread's OpenGL context, current; None where MuJoCo draws without one."""
    if mujoco.GLContext is None:
        return None
    if getattr(_of_thread, "context", None) is None:
        _of_thread.context = mujoco.GLContext(_CONTEXT_SIZE, _CONTEXT_SIZE)
    _of_thread.context.make_current()
    return _of_thread.context
