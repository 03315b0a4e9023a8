"""Renders the cameras of a model: upright RGB, depth and geom ids."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.backgrounds import Backgrounds
from robocasa_lerobot.envs.rendering.canvas import Canvas
from robocasa_lerobot.envs.rendering.merged_model import VISIBLE_GROUPS, MergedModel, merged_model
from robocasa_lerobot.envs.rendering.software.painter import Painter
from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.gl import draws_on_cpu


class SceneRenderer:
    """Renders cameras of one model.

    Without shadows, RGB pictures are drawn from a look-alike of the model with merged shapes, the nearest first: by our
    own code for CPUs (`software`) where there is no graphics card, else by OpenGL. Pictures of the two differ by 0.2 of
    255 levels on average, at edges; those of the look-alike and the model by as much, at the facets of round shapes.
    They are seen from the nearest pose of a grid of 0.2 mm and 0.2 mrad, and of a view that comes again OpenGL draws
    only what moves (`backgrounds`). Shadows, free cameras, depth and ids are always drawn by OpenGL.

    Args:
        model: to render.
        height: of the pictures, pixels.
        width: of the pictures, pixels.
        shadows: shadows and reflections (render preset `quality`).
        alike: the model's look-alike, if it has been made already.
        opengl: whether OpenGL draws; None: where there is a graphics card (`gl.draws_on_cpu`).
        keeps_backgrounds: draw only what moves where a view comes again; the pictures are the same either way. Models
            whose pixels have several samples are always drawn in full.

    Raises:
        NoOpenGLError: OpenGL is needed, and nothing on this machine has it.
        ForkedContextError: OpenGL is needed, and this process was forked from one that had used it.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int,
        width: int,
        *,
        shadows: bool = False,
        alike: MergedModel | None = None,
        opengl: bool | None = None,
        keeps_backgrounds: bool = True,
    ) -> None:
        self._model = model
        self._size = (height, width)
        self._shadows = shadows
        self._cameras = {model.camera(i).name: i for i in range(model.ncam)}
        # A pixel of several samples is a mixture of what is near and what is far, which cannot be joined afterwards.
        self._keeps = keeps_backgrounds and model.vis.quality.offsamples == 0
        self._backgrounds: Backgrounds | None = None
        self._exact: Canvas | None = None
        self._merged: Canvas | None = None
        self._painter: Painter | None = None
        self._on_cpu = not shadows and (draws_on_cpu() if opengl is None else not opengl)
        self._alike = None if shadows else alike or self._made_alike()
        self._open_alike()
        if self._alike is None:
            self._open_exact()  # so that a machine without OpenGL fails here

    def render(self, data: mujoco.MjData, camera: str | mujoco.MjvCamera) -> NDArray[np.uint8]:
        """A picture of shape (height, width, 3), upright.

        Raises:
            UnknownNameError: the model has no camera of that name.
        """
        which = self._camera(camera)
        alike = self._merged_model()
        if alike is None or not isinstance(which, int):
            canvas = self._open_exact()
            canvas.see(data, which, cull=not self._shadows)  # shadows and reflections come from out of view, too
            return canvas.picture(shadows=self._shadows)
        alike.follow(data)
        return self._drawn([which])[0]

    def pictures(self, data: mujoco.MjData, cameras: Sequence[str]) -> list[NDArray[np.uint8]]:
        """One picture (height, width, 3) of each camera, all of the same state: cheaper than one by one.

        Raises:
            UnknownNameError: the model has no camera of that name.
        """
        alike = self._merged_model()
        if alike is None:
            return [self.render(data, camera) for camera in cameras]
        numbers = [number for number in map(self._camera, cameras) if isinstance(number, int)]
        alike.follow(data)
        return self._drawn(numbers)

    def resized(self, height: int, width: int) -> SceneRenderer:
        """Another renderer of the same model, for pictures of that size, in pixels.

        It shares the look-alike, which is most of what a new one takes to make. Close it for itself.
        """
        return SceneRenderer(
            self._model,
            height,
            width,
            shadows=self._shadows,
            alike=self._alike,
            opengl=not self._on_cpu,
            keeps_backgrounds=self._keeps,
        )

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
        which = self._camera(camera)
        canvas = self._open_exact()
        canvas.see(data, which, cull=True)
        return canvas.geometry()

    def close(self) -> None:
        """Free the OpenGL contexts."""
        for canvas in (self._exact, self._merged):
            if canvas is not None:
                canvas.close()

    def _drawn(self, cameras: Sequence[int]) -> list[NDArray[np.uint8]]:
        """Pictures of the state that the look-alike follows."""
        if self._painter is not None:
            assert self._alike is not None
            return self._painter.pictures(self._alike.data, cameras)
        assert self._merged is not None
        assert self._alike is not None
        if self._backgrounds is None:
            self._backgrounds = Backgrounds(self._alike, self._merged, keeps=self._keeps)
        return self._backgrounds.pictures(cameras)

    def _camera(self, camera: str | mujoco.MjvCamera) -> int | mujoco.MjvCamera:
        if not isinstance(camera, str):
            return camera
        if camera not in self._cameras:
            raise UnknownNameError("camera", camera, self._cameras)
        return self._cameras[camera]

    def _open_exact(self) -> Canvas:
        if self._exact is None:
            self._exact = Canvas(self._model, *self._size, shadows=self._shadows)
        return self._exact

    def _merged_model(self) -> MergedModel | None:
        """The look-alike, made anew when shapes have changed their looks beyond what it can follow."""
        if self._alike is not None and (changed := self._alike.changed()):
            self._alike = self._made_alike(self._alike.loose | changed)
            self._open_alike()
        return self._alike

    def _made_alike(self, loose: frozenset[int] = frozenset()) -> MergedModel | None:
        # What OpenGL draws as it is costs little; our own code draws look-alikes alone.
        return merged_model(self._model, VISIBLE_GROUPS, loose, always=self._on_cpu)

    def _open_alike(self) -> None:
        """Make ready what draws the look-alike: our own code, or OpenGL where that cannot, or shall not."""
        if self._merged is not None:
            self._merged.close()
        self._painter = self._merged = self._backgrounds = None
        if self._alike is not None and self._on_cpu and (shapes := self._alike.shapes) is not None:
            self._painter = Painter(self._alike.model, *self._size, shapes, keeps_views=self._keeps)
        if self._alike is not None and self._painter is None:
            self._merged = Canvas(self._alike.model, *self._size)
