"""Which triangle is seen in each pixel: vertices into a camera's frame, then triangle by triangle.

As in OpenGL, a pixel is covered if its middle is, corners are moved to 1/256 of a pixel, an edge that two triangles
share belongs to one of them. Of what is as near the triangle of the higher number is seen, so that the order of drawing
does not matter. Colours are computed afterwards, once for each pixel (`shading`).
"""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.physics.native import compiled
from robocasa_lerobot.envs.rendering.software.arrays import Array, Numbers, Pose, Scratch, Shapes, Single, View

_FRACTION_BITS = 8  # of a pixel: what OpenGL asks of its implementations at least is 4
_STEPS = 1 << _FRACTION_BITS
_NARROW_PIXELS = 8  # rows of triangles up to this wide are tested pixel by pixel, of wider ones the ends are computed
# Corners that are nearer to the camera's plane are cut off: edges of what is up to _REACH_M wide stay within 2**30
# steps of a pixel, and their products within 64 bits.
_REACH_M = 20.0
NOTHING = -1  # number of the triangle where none is seen


def nearest_m(near_m: float, focal_pixels: float) -> float:
    """Distance from a camera's plane, metres, from which on triangles are drawn."""
    return max(near_m, focal_pixels * _REACH_M * _STEPS / (1 << 30))


@compiled
def to_camera(geom: int, shapes: Shapes, pose: Pose, scratch: Scratch) -> None:
    """Take the vertices of a geom into the camera's frame: into `scratch.corners`."""
    vertices, first_vertex, found = shapes.vertices, shapes.first_vertex, scratch.corners
    positions, rotations, eye, axes = pose.positions, pose.rotations, pose.eye, pose.axes
    x, y, z = positions[geom, 0] - eye[0], positions[geom, 1] - eye[1], positions[geom, 2] - eye[2]
    right = axes[0] * x + axes[3] * y + axes[6] * z
    up = axes[1] * x + axes[4] * y + axes[7] * z
    back = axes[2] * x + axes[5] * y + axes[8] * z
    turn = rotations[geom]
    r0 = axes[0] * turn[0] + axes[3] * turn[3] + axes[6] * turn[6]
    r1 = axes[0] * turn[1] + axes[3] * turn[4] + axes[6] * turn[7]
    r2 = axes[0] * turn[2] + axes[3] * turn[5] + axes[6] * turn[8]
    u0 = axes[1] * turn[0] + axes[4] * turn[3] + axes[7] * turn[6]
    u1 = axes[1] * turn[1] + axes[4] * turn[4] + axes[7] * turn[7]
    u2 = axes[1] * turn[2] + axes[4] * turn[5] + axes[7] * turn[8]
    b0 = axes[2] * turn[0] + axes[5] * turn[3] + axes[8] * turn[6]
    b1 = axes[2] * turn[1] + axes[5] * turn[4] + axes[8] * turn[7]
    b2 = axes[2] * turn[2] + axes[5] * turn[5] + axes[8] * turn[8]
    for vertex in range(first_vertex[geom], first_vertex[geom + 1]):
        x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
        found[vertex, 0] = r0 * x + r1 * y + r2 * z + right
        found[vertex, 1] = u0 * x + u1 * y + u2 * z + up
        found[vertex, 2] = -(b0 * x + b1 * y + b2 * z + back)


@compiled
def visible(
    first: int,
    end: int,
    hides: bool,
    faces: Numbers,
    corners: Array,
    lens: Array,
    view: View,
    inverse: Single,
    seen: Numbers,
) -> None:
    """Note for each pixel which of the triangles from `first` to `end` is seen there, and its inverse distance.

    Args:
        first: of the triangles, which are drawn in their order.
        end: one more than the last.
        hides: whether they hide what is drawn after them; else `inverse` is left as it is.
        faces: vertices of each triangle, (m, 3).
        corners: vertices in the camera's frame, (n, 3).
        lens: as in `Pose`.
        view: rows that are drawn.
        inverse: of the distance from the camera's plane, 1/m, where something was drawn before, row after row.
        seen: number of the triangle, row after row; both are changed.
    """
    focal_x, focal_y, middle_x, middle_y, near = lens
    left, right = -middle_x / focal_x, (view.width - middle_x) / focal_x
    top, bottom = (middle_y - view.first_row) / focal_y, (middle_y - view.end_row) / focal_y
    cut, steps_x, steps_y = np.empty((4, 3)), np.empty(4, np.int64), np.empty(4, np.int64)
    for face in range(first, end):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
        bx, by, bz = corners[b, 0], corners[b, 1], corners[b, 2]
        cx, cy, cz = corners[c, 0], corners[c, 1], corners[c, 2]
        ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        away = ax * nx + ay * ny + az * nz
        if away <= 0.0:  # its back is turned; the camera's frame is left-handed
            continue
        if (
            (ax < left * az and bx < left * bz and cx < left * cz)
            or (ax > right * az and bx > right * bz and cx > right * cz)
            or (ay > top * az and by > top * bz and cy > top * cz)
            or (ay < bottom * az and by < bottom * bz and cy < bottom * cz)
            or (az < near and bz < near and cz < near)
        ):
            continue
        cut[0, 0], cut[0, 1], cut[0, 2] = ax, ay, az
        cut[1, 0], cut[1, 1], cut[1, 2] = bx, by, bz
        cut[2, 0], cut[2, 1], cut[2, 2] = cx, cy, cz
        count = 3
        if az < near or bz < near or cz < near:
            count = _cut_off((ax, ay, az), (bx, by, bz), (cx, cy, cz), near, cut)
        for k in range(count):
            steps_x[k] = _steps(middle_x + focal_x * cut[k, 0] / cut[k, 2])
            steps_y[k] = _steps(middle_y - focal_y * cut[k, 1] / cut[k, 2])
        # Inverse distance is linear over the picture: (n . ray) / away, with ray = ((x - mx) / fx, (my - y) / fy, 1).
        along, down = nx / away / focal_x, -ny / away / focal_y
        corner = nz / away - along * middle_x - down * middle_y
        # Of a triangle that is seen from its edge the middle of a pixel may lie far before it: corners are moved.
        most = np.float32(1.0 / max(near, min(az, bz, cz)))
        for k in range(2, count):
            _fill(
                steps_x[0],
                steps_y[0],
                steps_x[k],
                steps_y[k],
                steps_x[k - 1],
                steps_y[k - 1],
                along,
                down,
                corner,
                most,
                face,
                hides,
                view,
                inverse,
                seen,
            )


@compiled
def _steps(pixels: float) -> int:
    """The nearest 1/256 of a pixel."""
    return int(np.floor(pixels * _STEPS + 0.5))


@compiled
def _cut_off(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    c: tuple[float, float, float],
    near: float,
    cut: Array,
) -> int:
    """How many corners what lies beyond a distance from the camera's plane has, three or four; they go into `cut`."""
    count = 0
    for k in range(3):
        if k == 0:
            one, other = a, b
        elif k == 1:
            one, other = b, c
        else:
            one, other = c, a
        if one[2] >= near:
            cut[count, 0], cut[count, 1], cut[count, 2] = one
            count += 1
        if (one[2] >= near) != (other[2] >= near):
            part = (near - one[2]) / (other[2] - one[2])
            cut[count, 0] = one[0] + part * (other[0] - one[0])
            cut[count, 1] = one[1] + part * (other[1] - one[1])
            cut[count, 2] = near
            count += 1
    return count


@compiled
def _fill(
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    x2: int,
    y2: int,
    along: float,
    down: float,
    corner: float,
    most: np.float32,
    face: int,
    hides: bool,
    view: View,
    inverse: Single,
    seen: Numbers,
) -> None:
    """Note a triangle wherever it is the nearest so far.

    Its corners are in 1/256 of a pixel from the picture's upper left corner, clockwise as they are seen; its inverse
    distance is `corner` there, and grows by `along` and `down` with each pixel, but to no more than `most`.
    """
    half = _STEPS // 2
    first_x = max(0, (min(x0, x1, x2) + half - 1) >> _FRACTION_BITS)
    last_x = min(view.width - 1, (max(x0, x1, x2) - half) >> _FRACTION_BITS)
    first_y = max(view.first_row, (min(y0, y1, y2) + half - 1) >> _FRACTION_BITS)
    last_y = min(view.end_row - 1, (max(y0, y1, y2) - half) >> _FRACTION_BITS)
    if first_x > last_x or first_y > last_y:
        return
    # Of each edge a number that is at least 0 inside, at the first pixel's middle, and how it grows.
    px, py = (first_x << _FRACTION_BITS) + half, (first_y << _FRACTION_BITS) + half
    ax, ay, bx, by, cx, cy = y0 - y1, x1 - x0, y1 - y2, x2 - x1, y2 - y0, x0 - x2
    a, b, c = ay * (py - y0) + ax * (px - x0), by * (py - y1) + bx * (px - x1), cy * (py - y2) + cx * (px - x2)
    if not (ax > 0 or (ax == 0 and ay > 0)):  # pixels whose middle is on the edge belong to the triangle beyond
        a -= 1
    if not (bx > 0 or (bx == 0 and by > 0)):
        b -= 1
    if not (cx > 0 or (cx == 0 and cy > 0)):
        c -= 1
    ax, ay, bx, by, cx, cy = ax * _STEPS, ay * _STEPS, bx * _STEPS, by * _STEPS, cx * _STEPS, cy * _STEPS
    last = last_x - first_x
    # By itself in each row, so that a picture is the same whatever rows are drawn together.
    corner += along * (first_x + 0.5)
    number = np.int32(face)
    if last < _NARROW_PIXELS:
        for y in range(first_y, last_y + 1):
            here_a, here_b, here_c = a, b, c
            at_pixel = corner + down * (y + 0.5)
            row = (y - view.first_row) * view.width
            for x in range(first_x, last_x + 1):
                if (here_a | here_b | here_c) >= 0:
                    single = min(np.float32(at_pixel), most)
                    before = inverse[row + x]
                    if single > before or (single == before and number > seen[row + x]):
                        if hides:
                            inverse[row + x] = single
                        seen[row + x] = number
                here_a += ax
                here_b += bx
                here_c += cx
                at_pixel += along
            a += ay
            b += by
            c += cy
        return
    part_a, part_b, part_c = 1.0 / max(1, abs(ax)), 1.0 / max(1, abs(bx)), 1.0 / max(1, abs(cx))
    for y in range(first_y, last_y + 1):
        low, high = _inside(a, ax, part_a, 0, last)
        low, high = _inside(b, bx, part_b, low, high)
        low, high = _inside(c, cx, part_c, low, high)
        if low <= high:
            begin, step = np.float32(corner + down * (y + 0.5) + along * low), np.float32(along)
            row = (y - view.first_row) * view.width + first_x
            count = np.int32(0)
            # Numbers without a sign, which need no look at whether they count from the end: this loop becomes vectors.
            for pixel in range(np.uint64(row + low), np.uint64(row + high + 1)):
                near = begin + step * np.float32(count)
                near = near if near < most else most
                count = np.int32(count + 1)
                before = inverse[pixel]
                nearer = (near > before) | ((near == before) & (number > seen[pixel]))
                inverse[pixel] = near if nearer and hides else before
                seen[pixel] = number if nearer else seen[pixel]
        a += ay
        b += by
        c += cy


@compiled
def _inside(value: int, growth: int, part: float, low: int, high: int) -> tuple[int, int]:
    """Of the steps from `low` to `high` the first and last at which `value` + steps * `growth` is at least 0.

    `part` is 1 / abs(growth): what is computed with it is off by one at most.
    """
    if growth > 0:
        if value < 0:
            first = int(-value * part)
            if value + first * growth < 0:
                first += 1
            elif value + (first - 1) * growth >= 0:
                first -= 1
            low = max(low, first)
    elif value < 0:
        high = low - 1
    elif growth < 0:
        end = int(value * part)
        if value + end * growth < 0:
            end -= 1
        elif value + (end + 1) * growth >= 0:
            end += 1
        high = min(high, end)
    return low, high
