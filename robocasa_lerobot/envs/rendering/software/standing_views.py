"""What stands still before cameras that stand still, kept so that only the rest is drawn anew."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from robocasa_lerobot.envs.rendering.software.arrays import Array, Kept, Pose
from robocasa_lerobot.envs.rendering.software.drawing import KEEP, KEEP_NOTHING, USE_KEPT

_VIEWS = 8  # that are kept for each camera: 0.7 MB each with 256 x 256 pixels
_SEEN_VIEWS = 16  # whose return is noticed
_STEADY_PICTURES = 10  # for which a geom has not changed before it is taken as standing still


class StandingViews:
    """Views of one model, in pictures of one size.

    Args:
        geoms: of the model.
        height: pixels.
        width: pixels.
        keeps: whether anything is kept.
    """

    def __init__(self, geoms: int, height: int, width: int, *, keeps: bool) -> None:
        self._size, self._keeps = (height, width), keeps
        self._nothing = Kept.of(np.zeros(geoms, dtype=np.bool_), 0, 0)
        self._last: tuple[Array, ...] = ()
        self._changed = np.zeros(geoms, dtype=np.int64)  # the number of the picture in which each changed last
        self._number = 0
        self._seen: dict[int, OrderedDict[bytes, None]] = {}
        self._kept: dict[int, OrderedDict[bytes, tuple[int, Kept]]] = {}

    def look(self, pose: Pose) -> None:
        """Take note of a new state, before the pictures of it are asked for."""
        if not self._keeps:
            return
        self._number += 1
        now = (pose.positions, pose.rotations, pose.looks)
        if self._last:
            for before, after in zip(self._last, now, strict=True):
                self._changed[(before != after).any(axis=1)] = self._number
        self._last = tuple(part.copy() for part in now)

    def choose(self, camera: int, pose: Pose) -> tuple[int, Kept]:
        """How a camera's picture of that state is drawn: `draw`'s `keeping` and `kept`."""
        if not self._keeps:
            return KEEP_NOTHING, self._nothing
        view = b"".join(part.tobytes() for part in (pose.eye, pose.axes, pose.lens, pose.lights))
        kept = self._kept.setdefault(camera, OrderedDict())
        if view in kept:
            number, found = kept[view]
            if not (self._changed[found.is_in] > number).any():
                kept.move_to_end(view)
                return USE_KEPT, found
            del kept[view]
        seen = self._seen.setdefault(camera, OrderedDict())
        if view not in seen:
            seen[view] = None
            if len(seen) > _SEEN_VIEWS:
                seen.popitem(last=False)
            return KEEP_NOTHING, self._nothing
        seen.move_to_end(view)
        if self._number <= _STEADY_PICTURES:
            return KEEP_NOTHING, self._nothing
        made = Kept.of(self._changed <= self._number - _STEADY_PICTURES, *self._size)
        kept[view] = (self._number, made)
        if len(kept) > _VIEWS:
            kept.popitem(last=False)
        return KEEP, made
