"""Faces of boxes that nobody sees: those that lie against another box, and the edges of boxes as thin as a line.

A third of a kitchen's triangles are backs against walls, undersides on floors and ends of boards that meet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A face counts as hidden when the places this far before it are in another box, or this near to it, metres.
_BEFORE_M, _NEAR_M = 5e-4, 2e-4
_ROUNDING_M = 1e-6  # what a quick question allows for, so that the exact one after it decides
# A box thinner than this shows its two broad faces only: at a metre's distance a pixel covers 4 mm.
_THIN_M = 0.002
_AXES = np.repeat(np.arange(3), 2)  # of a box's faces, in the order of `tessellation.box`
_SIDES = np.tile((-1.0, 1.0), 3)


def shown_faces(
    positions: Array, rotations: Array, halves: Array, bodies: NDArray[np.intp] | None = None
) -> NDArray[np.bool_]:
    """Which faces of opaque boxes can be seen that others of their body do not cover, (n, 6).

    Args:
        positions: of their middles, metres, (n, 3).
        rotations: (n, 3, 3).
        halves: half sizes, metres, (n, 3).
        bodies: which boxes do not move against each other, and share a frame, (n,); None: all.
    """
    hidden = _edges_of_thin(halves)
    bodies = np.zeros(len(positions), np.intp) if bodies is None else bodies
    inner, outer = _touching(positions, (np.abs(rotations) @ halves[:, :, None])[:, :, 0], bodies)
    places = _places(halves)
    # Few pairs have a face whose middle is covered, which is soon asked.
    middles = positions[:, None] + places.mean(axis=2) @ rotations.transpose(0, 2, 1)
    local = np.abs((middles[inner] - positions[outer, None]) @ rotations[outer])
    near = (local <= halves[outer, None] + _NEAR_M + _ROUNDING_M).all(axis=2).any(axis=1)
    inner, outer = inner[near], outer[near]
    corners = positions[:, None] + places.reshape(-1, 24, 3) @ rotations.transpose(0, 2, 1)
    local = (corners[inner] - positions[outer, None]) @ rotations[outer]
    within = np.abs(local) <= halves[outer, None] + _NEAR_M
    covered = within.reshape(-1, 6, 4 * 3).all(axis=2)
    np.logical_or.at(hidden, inner, covered)
    return ~hidden


def _places(halves: Array) -> Array:
    """A little before each corner of each face, in the box's frame: (n, 6, 4, 3)."""
    out = np.empty((len(halves), 6, 4, 3))
    for face, (axis, side) in enumerate(zip(_AXES, _SIDES, strict=True)):
        across, up = (axis + 1) % 3, (axis + 2) % 3
        out[:, face, :, axis] = side * (halves[:, axis, None] + _BEFORE_M)
        out[:, face, :, across] = halves[:, across, None] * (-1.0, 1.0, 1.0, -1.0)
        out[:, face, :, up] = halves[:, up, None] * (-1.0, -1.0, 1.0, 1.0)
    return out


def _touching(positions: Array, reach: Array, bodies: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Ordered pairs of different boxes of one body whose bounds, (n, 3) half sizes, come near each other."""
    first, second = _overlapping(positions[:, 0], reach[:, 0] + (_BEFORE_M + _NEAR_M) / 2 + _ROUNDING_M)
    near = bodies[first] == bodies[second]
    for axis in range(3):
        first, second = first[near], second[near]
        apart = np.abs(positions[first, axis] - positions[second, axis])
        near = apart <= reach[first, axis] + reach[second, axis] + _BEFORE_M + _NEAR_M
    first, second = first[near], second[near]
    return np.concatenate((first, second)), np.concatenate((second, first))


def _overlapping(middles: Array, halves: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of intervals (n,) that overlap, each once: of all pairs of a kitchen's boxes one in five."""
    order = np.argsort(middles - halves)
    low, high = (middles - halves)[order], (middles + halves)[order]
    after = np.arange(1, len(order) + 1)
    counts = np.maximum(np.searchsorted(low, high, side="right") - after, 0)
    first = np.repeat(after - 1, counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    return order[first], order[second]


def _edges_of_thin(halves: Array) -> NDArray[np.bool_]:
    """The four narrow faces of each box that is thin in one direction alone, (n, 6)."""
    order = np.sort(halves, axis=1)
    thin = (2 * order[:, 0] < _THIN_M) & (order[:, 1] > 2 * order[:, 0])
    narrow = _AXES[None, :] != np.argmin(halves, axis=1)[:, None]
    return np.asarray(thin[:, None] & narrow)
