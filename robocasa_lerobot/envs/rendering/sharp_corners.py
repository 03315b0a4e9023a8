"""Where MuJoCo draws a mesh with the normals of its triangles, though smooth ones are stored at its corners."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Of meshes without texture coordinates, corners whose normal is further from the triangle's get the triangle's: as
# MuJoCo draws them, measured on pictures (0.75 and 0.85 are worse).
SHARPEST_COSINE = 0.8
_TINY = 1e-12


def flat_normals(points: NDArray[Any]) -> NDArray[Any]:
    """Unit normals of triangles, (n, 3), from their corners, (n, 3, 3), counter-clockwise seen from outside."""
    flat = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), _TINY)
    return flat


def sharp_corners(flat: NDArray[Any], normals: NDArray[Any]) -> NDArray[np.bool_]:
    """Which corners, (n, 3), get the normals `flat`, (n, 3), of their triangles in place of their own, (n, 3, 3)."""
    return np.asarray((normals * flat[:, None]).sum(axis=2) < SHARPEST_COSINE)
