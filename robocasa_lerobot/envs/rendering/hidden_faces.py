"""Faces of boxes that nobody sees: those that lie against another box, and the edges of boxes as thin as a line.

A third of a kitchen's triangles are backs against walls, undersides on floors and ends of boards that meet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A face counts as hidden when the places this far before it are in another box, or this near to it, metres.
_BEFORE_M, _NEAR_M = 5e-4, 2e-4
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
    corners = positions[:, None] + _places(halves).reshape(-1, 24, 3) @ rotations.transpose(0, 2, 1)
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
    near = bodies[:, None] == bodies[None, :]
    np.fill_diagonal(near, False)
    for axis in range(3):
        apart = np.abs(positions[:, None, axis] - positions[None, :, axis])
        near &= apart <= reach[:, None, axis] + reach[None, :, axis] + _BEFORE_M + _NEAR_M
    first, second = np.nonzero(near)
    return first, second


def _edges_of_thin(halves: Array) -> NDArray[np.bool_]:
    """The four narrow faces of each box that is thin in one direction alone, (n, 6)."""
    order = np.sort(halves, axis=1)
    thin = (2 * order[:, 0] < _THIN_M) & (order[:, 1] > 2 * order[:, 0])
    narrow = _AXES[None, :] != np.argmin(halves, axis=1)[:, None]
    return np.asarray(thin[:, None] & narrow)
