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
            if not _apart(mine, own, corners[mark], axes[mark], low[mark], high[mark], margin):
                found[index] = True
                break
    return found


@compiled
def clear(
    poses: Array,
    shapes: Array,
    starts: NDArray[np.int64],
    corners: Array,
    axes: Array,
    low: Array,
    high: Array,
    middles: Array,
    reaches: Array,
) -> NDArray[np.bool_]:
    """At which of n poses none of k rectangles that are fixed to it comes near a mark of its own set; shape (n,).

    As `overlapping` for each of the k, but marks that are too far away to be met are passed over.

    Args:
        poses: (n, 3), metres and radians.
        shapes: of the rectangles, (k, 4): how far ahead of the pose its middle is, its half sizes, and the margin.
        starts: (k + 1,) where each one's marks begin among all m.
        corners: as of `overlapping`, like the next three.
        axes: the same.
        low: the same.
        high: the same.
        middles: of the marks, (m, 2), metres.
        reaches: of the marks' corners from their middles, (m,), metres.
    """
    found = np.ones(len(poses), dtype=np.bool_)
    mine, own = np.empty((4, 2)), np.empty((2, 2))
    for index in range(len(poses)):
        yaw = poses[index, 2]
        cos, sin = np.cos(yaw), np.sin(yaw)
        own[0, 0], own[0, 1], own[1, 0], own[1, 1] = cos, sin, -sin, cos
        for shape in range(len(shapes)):
            ahead, half_x, half_y, margin = shapes[shape, 0], shapes[shape, 1], shapes[shape, 2], shapes[shape, 3]
            x, y = poses[index, 0] + ahead * cos, poses[index, 1] + ahead * sin
            for corner in range(4):
                along = half_x if corner in (0, 3) else -half_x
                across = half_y if corner in (0, 1) else -half_y
                mine[corner, 0] = x + (along * cos - across * sin)
                mine[corner, 1] = y + (along * sin + across * cos)
            reach = np.sqrt(half_x * half_x + half_y * half_y) + margin + 1e-6
            for mark in range(starts[shape], starts[shape + 1]):
                away_x, away_y = middles[mark, 0] - x, middles[mark, 1] - y
                if away_x * away_x + away_y * away_y > (reach + reaches[mark]) ** 2:
                    continue
                if not _apart(mine, own, corners[mark], axes[mark], low[mark], high[mark], margin):
                    found[index] = False
                    break
            if not found[index]:
                break
    return found


@compiled
def _apart(mine: Array, own: Array, corners: Array, axes: Array, low: Array, high: Array, margin: float) -> bool:
    """Whether a footprint, by corners and axes, keeps a margin to one mark: some edge of either lies between them."""
    for axis in range(2):
        first, last = _span(mine, own[axis])
        start, end = _span(corners, own[axis])
        if end + margin < first or last + margin < start:
            return True
        first, last = _span(mine, axes[axis])
        if high[axis] + margin < first or last + margin < low[axis]:
            return True
    return False


@compiled
def _span(corners: Array, axis: Array) -> tuple[float, float]:
    """What corners (4, 2) cover of an axis (2,)."""
    low = high = corners[0, 0] * axis[0] + corners[0, 1] * axis[1]
    for corner in range(1, 4):
        at = corners[corner, 0] * axis[0] + corners[corner, 1] * axis[1]
        low, high = min(low, at), max(high, at)
    return low, high
