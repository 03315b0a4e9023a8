"""What stands still before a camera, kept as colours and depth, so that only what moves is drawn anew.

A picture does not depend on what is kept: whatever is joined from a background equals the full drawing bit for bit.
Where that is not certain (something moves that is transparent or is seen through it, or two surfaces are at one
depth) the view is drawn in full.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.rendering.canvas import Canvas
from robocasa_lerobot.envs.rendering.depth_join import join_by_depth
from robocasa_lerobot.envs.rendering.frustum import opaque
from robocasa_lerobot.envs.rendering.merged_model import MergedModel
from robocasa_lerobot.envs.rendering.standing_views import Key, StandingViews
from robocasa_lerobot.gl import is_software, note_renderer

Picture = NDArray[np.uint8]

TIMED = 8  # drawings of each kind whose shortest time decides whether joining is cheaper on a graphics card
DOUBTFUL = 20  # pictures of a camera that are drawn in full after one that could not be joined for certain
MOST_MOVED = 0.5  # share of the shapes in view from which on nothing is gained

# By OpenGL's name of a graphics card: whether joining takes less time there than drawing in full; reading depth back
# may take more than drawing. It decides how long a picture takes, never what is seen.
_joining_pays: dict[str, bool] = {}


@dataclass(frozen=True)
class Background:
    """One view of the shapes that stand still.

    Attributes:
        colours: (height, width, 3), the lowest row first.
        depth: reversed depth buffer of what is opaque, (height, width).
        veil: that of what is transparent, if anything is.
        still: which shapes are in it, (n,).
    """

    colours: Picture
    depth: NDArray[np.float32]
    veil: NDArray[np.float32] | None
    still: NDArray[np.bool_]


@dataclass(frozen=True)
class _Plan:
    """How a view is drawn: in full without `still`; else what is still is kept, or drawn now and then kept."""

    camera: int
    in_view: NDArray[np.bool_]
    key: Key | None = None
    still: NDArray[np.bool_] | None = None
    background: Background | None = None


class Backgrounds:
    """Draws views of a look-alike on its canvas, and, unless told otherwise, keeps what stands still in them."""

    def __init__(self, alike: MergedModel, canvas: Canvas, *, keeps: bool = True) -> None:
        self._alike, self._canvas, self._keeps = alike, canvas, keeps
        self._device = note_renderer()
        self._views: StandingViews[Background] = StandingViews()
        self._doubtful: dict[int, int] = {}  # pictures that are still to be drawn in full, by camera
        self._solid: NDArray[np.bool_] = np.empty(0, dtype=np.bool_)

    def pictures(self, cameras: Sequence[int]) -> list[Picture]:
        """One picture (height, width, 3), upright, of each camera, of the state that the look-alike follows."""
        if self._keeps:
            self._views.note(self._alike.looks())
            self._solid = opaque(self._alike.model)
        plans = [self._plan(camera) for camera in cameras]
        # All are begun before one is read: the device draws while the next one is prepared.
        for place, plan in enumerate(plans):
            if plan.still is not None and plan.background is None:
                self._draw(plan, plan.still, place + len(plans))
            self._draw(plan, None if plan.still is None else ~plan.still, place)
        return [self._finished(plan, place, place + len(plans)) for place, plan in enumerate(plans)]

    def _draw(self, plan: _Plan, shapes: NDArray[np.bool_] | None, place: int) -> None:
        """Begin a picture of what is in view, or of those shapes of it."""
        self._see(plan, shapes)
        self._canvas.draw(place, shadows=False)

    def _see(self, plan: _Plan, shapes: NDArray[np.bool_] | None) -> None:
        seen = plan.in_view if shapes is None else plan.in_view & shapes
        self._canvas.see_nearest_first(self._alike.data, plan.camera, seen)

    def _plan(self, camera: int) -> _Plan:
        """How a view is drawn: over a background if it has come before and most of it stands still."""
        full = _Plan(camera, self._canvas.in_view(self._alike.data, camera))
        if not self._keeps or not _joining_pays.get(self._device, True):
            return full
        if self._doubtful.get(camera, 0) > 0:
            self._doubtful[camera] -= 1
            return full
        key = (camera, self._alike.view(camera))
        found = self._views.find(key)
        if found is None and not self._views.comes_again(key):
            return full
        background, still = (None, self._views.still) if found is None else found
        moved = ~still & full.in_view
        if moved.sum() > MOST_MOVED * full.in_view.sum() or (moved & ~self._solid).any():
            return full
        return replace(full, key=key, still=still, background=background)

    def _finished(self, plan: _Plan, place: int, behind: int) -> Picture:
        """The picture of a plan, whose parts have been begun in these places."""
        if plan.still is None:
            return self._canvas.drawn(place)
        background = plan.background
        if background is None:
            background = self._made(plan, plan.still, behind)
            if not is_software(self._device) and self._device not in _joining_pays:
                self._compare(plan, background, behind)
        assert plan.key is not None
        self._views.keep(plan.key, background, background.still)
        colours, depth = self._canvas.drawn_with_depth(place)
        picture, certain = join_by_depth(background.colours, background.depth, colours, depth, background.veil)
        if certain:
            return np.ascontiguousarray(picture[::-1])
        self._doubtful[plan.camera] = DOUBTFUL
        self._draw(plan, None, place)
        return self._canvas.drawn(place)

    def _made(self, plan: _Plan, still: NDArray[np.bool_], place: int) -> Background:
        """What has been drawn in a place of what stands still."""
        colours, depth = self._canvas.drawn_with_depth(place)
        veil = None
        if (still & ~self._solid & plan.in_view).any():
            self._see(plan, still & ~self._solid)
            veil = self._canvas.drawn_depth(place)
            self._see(plan, still & self._solid)
            depth = self._canvas.drawn_depth(place)
        return Background(colours, depth, veil, still)

    def _compare(self, plan: _Plan, background: Background, place: int) -> None:
        """Measure once for each graphics card whether joining pays."""
        seconds: dict[bool, list[float]] = {True: [], False: []}
        for joins in (True, False) * TIMED:
            started = time.perf_counter()
            self._draw(plan, ~background.still if joins else None, place)
            if joins:
                colours, depth = self._canvas.drawn_with_depth(place)
                join_by_depth(background.colours, background.depth, colours, depth, background.veil)
            else:
                self._canvas.drawn(place)
            seconds[joins].append(time.perf_counter() - started)
        _joining_pays[self._device] = min(seconds[True]) < min(seconds[False])
