"""The overlap test of footprints, compiled: searches for a free place or a path of the base ask it 100,000 times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled

Array = NDArray[np.float64]


@compiled
def overlapping(
    places: Array, half: tuple[float, float], corners: Array, axes: Array, low: Array, high: Array, margin: float
) -> NDArray[np.bool_]:
    """Which of n footprints come closer than a margin to one of m marks, by separating axes; shape (n,).

    Args:
        places: middles and yaws of the footprints, (n, 3), metres and radians.
        half: half sizes of all of them, metres.
        corners: of the marks, (m, 4, 2), metres.
        axes: of the marks' edges, (m, 2, 2), unit vectors as rows.
        low: where the marks begin along their own axes, (m, 2), metres.
        high: where they end.
        margin: metres.
    """
    found = np.zeros(len(places), dtype=np.bool_)
    mine, own = np.empty((4, 2)), np.empty((2, 2))
    for index in range(len(places)):
        x, y, yaw = places[index]
        cos, sin = np.cos(yaw), np.sin(yaw)
        own[0, 0], own[0, 1], own[1, 0], own[1, 1] = cos, sin, -sin, cos
        for corner in range(4):
            along = half[0] if corner in (0, 3) else -half[0]
            across = half[1] if corner in (0, 1) else -half[1]
            mine[corner, 0] = x + (along * cos - across * sin)
            mine[corner, 1] = y + (along * sin + across * cos)
        for mark in range(len(corners)):
            apart = False
            for axis in range(2):
                first, last = _span(mine, own[axis])
                start, end = _span(corners[mark], own[axis])
                if end + margin < first or last + margin < start:
                    apart = True
                    break
                first, last = _span(mine, axes[mark, axis])
                if high[mark, axis] + margin < first or last + margin < low[mark, axis]:
                    apart = True
                    break
            if not apart:
                found[index] = True
                break
    return found


@compiled
def _span(corners: Array, axis: Array) -> tuple[float, float]:
    """What corners (4, 2) cover of an axis (2,)."""
    low = high = corners[0, 0] * axis[0] + corners[0, 1] * axis[1]
    for corner in range(1, 4):
        at = corners[corner, 0] * axis[0] + corners[corner, 1] * axis[1]
        low, high = min(low, at), max(high, at)
    return low, high
