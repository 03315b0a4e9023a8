"""What lies behind all that has been drawn, known from its box: it need not be looked at triangle by triangle."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.physics.native import compiled
from robocasa_lerobot.envs.rendering.software.arrays import Pose, Shapes, Single, View

_MARGIN_PIXELS = 1.0  # corners of triangles are moved by parts of a pixel
_MARGIN = 1.0 + 1e-5  # for what rounding may bring nearer


@compiled
def is_hidden(geom: int, shapes: Shapes, pose: Pose, view: View, inverse: Single) -> bool:
    """Whether nothing of a geom can be seen, since all that its box covers of the view shows something nearer.

    False where it is in doubt. Triangles are nowhere drawn nearer than their nearest corner (`rasterization`), so that
    leaving a hidden geom out changes no pixel.

    Args:
        geom: of the model.
        shapes: of the model.
        pose: the state, as the camera sees it.
        view: rows that are drawn.
        inverse: of the distance from the camera's plane to what has been drawn, 1/m, row after row.
    """
    focal_x, focal_y, middle_x, middle_y, near = pose.lens
    axes, turn, box, eye = pose.axes, pose.rotations[geom], shapes.bounds[geom], pose.eye
    x = pose.positions[geom, 0] - eye[0] + turn[0] * box[0] + turn[1] * box[1] + turn[2] * box[2]
    y = pose.positions[geom, 1] - eye[1] + turn[3] * box[0] + turn[4] * box[1] + turn[5] * box[2]
    z = pose.positions[geom, 2] - eye[2] + turn[6] * box[0] + turn[7] * box[1] + turn[8] * box[2]
    middle_right = axes[0] * x + axes[3] * y + axes[6] * z
    middle_up = axes[1] * x + axes[4] * y + axes[7] * z
    middle_forward = -(axes[2] * x + axes[5] * y + axes[8] * z)
    right, up, forward = np.empty(3), np.empty(3), np.empty(3)  # of each half of the box's edges
    reach = 0.0
    for k in range(3):
        x, y, z = turn[k] * box[k + 3], turn[k + 3] * box[k + 3], turn[k + 6] * box[k + 3]
        right[k] = axes[0] * x + axes[3] * y + axes[6] * z
        up[k] = axes[1] * x + axes[4] * y + axes[7] * z
        forward[k] = -(axes[2] * x + axes[5] * y + axes[8] * z)
        reach += abs(forward[k])
    nearest = middle_forward - reach
    if nearest <= near:
        return False
    first_x, last_x, first_y, last_y = np.inf, -np.inf, np.inf, -np.inf
    for corner in range(8):
        x, y, z = middle_right, middle_up, middle_forward
        for k in range(3):
            side = 1.0 if corner & (1 << k) else -1.0
            x, y, z = x + side * right[k], y + side * up[k], z + side * forward[k]
        column, row = middle_x + focal_x * x / z, middle_y - focal_y * y / z
        first_x, last_x = min(first_x, column), max(last_x, column)
        first_y, last_y = min(first_y, row), max(last_y, row)
    left = int(max(first_x - _MARGIN_PIXELS, 0.0))
    end = int(min(last_x + _MARGIN_PIXELS + 1.0, float(view.width)))
    top = int(max(first_y - _MARGIN_PIXELS, float(view.first_row)))
    bottom = int(min(last_y + _MARGIN_PIXELS + 1.0, float(view.end_row)))
    if left >= end or top >= bottom:  # beside the view
        return True
    bound = np.float32(_MARGIN / nearest)
    for line in range(top - view.first_row, bottom - view.first_row):
        farther = np.int32(0)
        # Counted, not left at the first: this loop becomes vectors.
        for pixel in range(np.uint64(line * view.width + left), np.uint64(line * view.width + end)):
            farther += np.int32(inverse[pixel] <= bound)
        if farther > 0:
            return False
    return True
