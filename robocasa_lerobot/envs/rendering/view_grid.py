"""Camera poses on a grid, so that a camera that stands about still sees the very same view again.

Two of the three cameras stand on the base, which its servos hold: they move by micrometres in most steps. A grid of
0.2 mm and 0.2 mrad moves what is seen half a metre away by less than a tenth of a pixel of 256 (field of view 60
degrees): half a step of the grid by 0.04 in each direction, half a step of an angle by 0.02.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID_M = 2e-4
GRID_QUATERNION = 1e-4  # of its components, half the angle: 0.2 mrad


def on_grid(positions: Array, rotations: Array) -> tuple[Array, Array]:
    """The nearest poses of a grid: a function of these alone, so that a picture is one of the state alone.

    Args:
        positions: (n, 3), metres.
        rotations: matrices, (n, 9), row by row.
    """
    places = np.round(positions / GRID_M) * GRID_M
    turned = np.empty((len(rotations), 9))
    quaternion = np.empty(4)
    for number, rotation in enumerate(rotations):
        mujoco.mju_mat2Quat(quaternion, rotation)
        steps = np.round(quaternion / GRID_QUATERNION)
        quaternion[:] = steps / np.linalg.norm(steps)
        mujoco.mju_quat2Mat(turned[number], quaternion)
    return places, turned
