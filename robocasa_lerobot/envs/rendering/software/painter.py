"""Draws the pictures of a look-alike on the CPU, several cameras at once."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import mujoco
import numpy as np

from robocasa_lerobot.envs.rendering.canvas import LAYER_EDGES_M
from robocasa_lerobot.envs.rendering.frustum import clipping_planes, view_frustum
from robocasa_lerobot.envs.rendering.software.arrays import (
    AMBIENT,
    ATTENUATION,
    DIFFUSE,
    DIRECTION,
    EXPONENT,
    IS_FAR,
    LIGHT_COLUMNS,
    NARROWEST_COSINE,
    POSITION,
    SPECULAR,
    Array,
    Kept,
    Picture,
    Pose,
    Scratch,
    Shapes,
    View,
)
from robocasa_lerobot.envs.rendering.software.drawing import KEEP, KEEP_NOTHING, USE_KEPT, draw
from robocasa_lerobot.envs.rendering.software.rasterization import nearest_m
from robocasa_lerobot.envs.rendering.standing_views import Key, StandingViews
from robocasa_lerobot.gl import note_own_renderer
from robocasa_lerobot.jobs.workers import cores_here

_EDGES_M = np.array(LAYER_EDGES_M)
_USUAL_COLOUR = (0.5, 0.5, 0.5, 1.0)  # of a geom, which a material's stands above
_USUAL_LOOK = (0.0, 0.5, 0.5)  # glow, highlights and their sharpness without a material
_DIRECTIONAL = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
_WIDEST_DEGREES = 90.0  # of a cone of light, half its angle: more is no cone
_MOST_THREADS = 4
_BANDS = 2  # of a picture, which are shared out: three cameras are no even work for two threads

# Threads that draw, by process: one that was forked has none of its parent's.
_threads: dict[int, ThreadPoolExecutor] = {}

_Work = tuple[Pose, View, int, Kept, Picture]  # rows of a picture


class Painter:
    """Draws one model into pictures of one size, in plain memory: no OpenGL, and any process and thread may use it.

    Args:
        model: to draw.
        height, width: of the pictures, pixels.
        shapes: of the model, as of `triangles.shapes_of`.
        keeps_views: draw only what moves in views that come again; the pictures are the same either way.
    """

    def __init__(
        self, model: mujoco.MjModel, height: int, width: int, shapes: Shapes, *, keeps_views: bool = True
    ) -> None:
        note_own_renderer()
        self._model = model
        self._size = (height, width)
        self._shapes = shapes
        self._scratch: list[Scratch] = []  # of each thread that draws
        self._keeps_views = keeps_views
        self._standing: StandingViews[Kept] = StandingViews()
        self._nothing = Kept.of(np.zeros(model.ngeom, dtype=np.bool_), 0, 0)
        self._near_m, self._far_m = clipping_planes(model)
        self._materials = np.append(
            np.column_stack((model.mat_emission, model.mat_specular, model.mat_shininess)).reshape(-1, 3),
            [_USUAL_LOOK],
            axis=0,
        )

    def pictures(self, data: mujoco.MjData, cameras: Sequence[int]) -> list[Picture]:
        """What each camera sees, upright RGB of shape (height, width, 3)."""
        looks = self._looks()
        pictures: list[Picture] = [np.empty((*self._size, 3), np.uint8) for _ in cameras]
        height, width = self._size
        threads = _threads_at_most()
        bands = 1 if threads == 1 else _BANDS
        rows = [(height * band // bands, height * (band + 1) // bands) for band in range(bands)]
        poses = [self._pose(data, camera, looks) for camera in cameras]
        if self._keeps_views:
            self._standing.note(np.column_stack((data.geom_xpos, data.geom_xmat, looks)))
        keys = [_view_key(camera, pose) for camera, pose in zip(cameras, poses, strict=True)]
        chosen = [self._kept(key) for key in keys]
        work: deque[_Work] = deque(
            (pose, View(first, end, width), *keeping, picture)
            for first, end in reversed(rows)  # the lower ones first: they show more, and take longer
            for pose, keeping, picture in zip(poses, chosen, pictures, strict=True)
        )
        count = min(threads, len(work))
        # Memory to draw in is ours again once all is drawn: after an interrupt, other threads may still write to it.
        scratches, self._scratch = self._scratch, []
        while len(scratches) < count:
            scratches.append(Scratch.of(len(self._shapes.vertices), height, width))
        try:
            # Compiled code leaves Python's lock alone: this thread draws what the others have not begun.
            others = [_pool().submit(self._draw, work, scratch) for scratch in scratches[1:count]]
            self._draw(work, scratches[0])
            for other in others:
                other.result()
        finally:
            work.clear()  # nobody waits any more for what an interrupt has left
        self._scratch = scratches
        for key, (keeping, kept) in zip(keys, chosen, strict=True):
            if keeping == KEEP:  # not before it is drawn: what an interrupt cut short is no view
                self._standing.keep(key, kept, kept.is_in)
        return pictures

    def _kept(self, key: Key) -> tuple[int, Kept]:
        """How a picture is drawn: `draw`'s `keeping` and `kept`."""
        if not self._keeps_views:
            return KEEP_NOTHING, self._nothing
        if (found := self._standing.find(key)) is not None:
            return USE_KEPT, found[0]
        if not self._standing.comes_again(key):
            return KEEP_NOTHING, self._nothing
        return KEEP, Kept.of(self._standing.still, *self._size)

    def _draw(self, work: deque[_Work], scratch: Scratch) -> None:
        """Draw what is left to do."""
        while work:
            try:
                pose, view, keeping, kept, picture = work.popleft()
            except IndexError:  # another thread was faster
                return
            draw(self._shapes, pose, scratch, view, _EDGES_M, self._far_m, keeping, kept, picture)

    def _looks(self) -> Array:
        """Colour, opacity, glow, highlights and their sharpness of each geom at present, (ngeom, 7)."""
        model = self._model
        self._materials[:-1, 0] = model.mat_emission
        colours = model.geom_rgba.astype(np.float64)
        own = (model.geom_rgba != _USUAL_COLOUR).any(axis=1) | (model.geom_matid < 0)
        if model.nmat:
            colours = np.where(own[:, None], colours, model.mat_rgba[model.geom_matid])
        return np.column_stack((colours, self._materials[model.geom_matid]))

    def _pose(self, data: mujoco.MjData, camera: int, looks: Array) -> Pose:
        """The state as a camera sees it."""
        height, width = self._size
        left, right, bottom, top = view_frustum(self._model, camera, width / height)
        focal_x, focal_y = width / (right - left), height / (top - bottom)
        near = nearest_m(self._near_m, max(focal_x, focal_y))
        axes = data.cam_xmat[camera].copy()
        return Pose(
            data.geom_xpos,
            data.geom_xmat,
            looks,
            self._lights(data, axes),
            data.cam_xpos[camera].copy(),
            axes,
            np.array((focal_x, focal_y, -left * focal_x, top * focal_y, near)),
        )

    def _lights(self, data: mujoco.MjData, axes: Array) -> Array:
        """What is lit at present, in the columns of `Pose.lights`; the headlight shines where the camera looks."""
        model, head = self._model, self._model.vis.headlight
        shining = np.flatnonzero(model.light_active)
        lights = np.zeros((len(shining) + bool(head.active), LIGHT_COLUMNS))
        if head.active:
            lights[0] = (*-axes[2::3], *head.ambient, *head.diffuse, *head.specular, 0, 0, 0, 1, 0, 0, -1, 0, 1)
        rows = lights[len(lights) - len(shining) :]
        for first, values in (
            (DIRECTION, data.light_xdir),
            (AMBIENT, model.light_ambient),
            (DIFFUSE, model.light_diffuse),
            (SPECULAR, model.light_specular),
            (POSITION, data.light_xpos),
            (ATTENUATION, model.light_attenuation),
        ):
            rows[:, first : first + 3] = values[shining]
        cone = model.light_cutoff[shining]
        rows[:, NARROWEST_COSINE] = np.where(cone > _WIDEST_DEGREES, -1.0, np.cos(np.deg2rad(cone)))
        rows[:, EXPONENT] = model.light_exponent[shining]
        rows[:, IS_FAR] = model.light_type[shining] == _DIRECTIONAL
        return lights


def _view_key(camera: int, pose: Pose) -> Key:
    """What tells a view from another: its camera, and from where and in what light it sees."""
    return camera, b"".join(part.tobytes() for part in (pose.eye, pose.axes, pose.lens, pose.lights))


@cache
def _threads_at_most() -> int:
    """How many threads of this process draw: its cores, up to four, or fewer by `OMP_NUM_THREADS`."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, min(cores_here(), _MOST_THREADS, int(asked) if asked.isdecimal() else _MOST_THREADS))


def _pool() -> ThreadPoolExecutor:
    """This process's threads that draw beside the one that asks."""
    if (pool := _threads.get(os.getpid())) is None:
        pool = _threads[os.getpid()] = ThreadPoolExecutor(_threads_at_most() - 1, "painter")
    return pool
