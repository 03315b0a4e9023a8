"""What has been drawn of views that may come again, and which shapes stand still meanwhile."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

Key = tuple[int, bytes]  # a camera, and from where and in what light it sees

KEPT_VIEWS = 8  # of a camera: a base that is held goes to and fro between few places of the grid
SEEN_VIEWS = 64  # that were drawn in full, to know one that comes again
RESTED = 10  # pictures for which a shape has not moved that belongs to what is kept anew


class StandingViews[T]:
    """Keeps something of type T for each view, as long as the shapes that it shows stand still."""

    def __init__(self) -> None:
        self._looks: NDArray[np.float64] = np.empty((0, 0))
        self._rested: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._seen: OrderedDict[Key, None] = OrderedDict()
        self._kept: OrderedDict[Key, tuple[T, NDArray[np.bool_], NDArray[np.float64]]] = OrderedDict()

    def note(self, looks: NDArray[np.float64]) -> None:
        """Take note of a new state: pose and colours of all shapes, (n, k), before its pictures are drawn."""
        if len(self._looks) != len(looks):
            self._rested = np.full(len(looks), RESTED)
        else:
            self._rested = np.where((looks != self._looks).any(axis=1), 0, self._rested + 1)
        self._looks = looks

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which shapes stand still, (n,)."""
        return np.asarray(self._rested >= RESTED)

    def find(self, key: Key) -> tuple[T, NDArray[np.bool_]] | None:
        """What is kept of a view and the shapes that it shows; None if there is nothing, or one of them has changed."""
        if key not in self._kept:
            return None
        found, still, looks = self._kept[key]
        if ((self._looks != looks).any(axis=1) & still).any():
            return None
        self._kept.move_to_end(key)
        return found, still

    def comes_again(self, key: Key) -> bool:
        """Whether a view was seen before; it is from now on."""
        if key in self._kept or key in self._seen:
            return True
        self._seen[key] = None
        while len(self._seen) > SEEN_VIEWS:
            self._seen.popitem(last=False)
        return False

    def keep(self, key: Key, kept: T, still: NDArray[np.bool_]) -> None:
        """Keep what shows these shapes of a view, of the present state."""
        self._kept[key] = kept, still, self._looks
        self._kept.move_to_end(key)
        mine = [other for other in self._kept if other[0] == key[0]]
        if len(mine) > KEPT_VIEWS:
            del self._kept[mine[0]]
