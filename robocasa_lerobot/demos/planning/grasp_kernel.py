"""The search for grasps, compiled: lines through convex pieces, what pads can close on, and whether the hand has room.

All functions stand in one file because numba's cache on disk follows the changes of a function's own file only (why
compiled: `docs/decisions/0040`). Frame: any with z up; the hand comes straight down. Lengths in metres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled

Array = NDArray[np.float64]

LINE_STEP_M = 0.01
GAP_M = 0.002  # between pieces along a line: closed
THINNEST_M = 0.002
EDGE_M = 0.002  # lines keep this far from where the object ends
PRESSED_M = 0.004  # a surface within this of the interval's end touches the pads
PARALLEL = 1e-9
ALIKE_M, ALIKE_COS = 0.012, 0.95
PALM_STEP_M, FINGERS_ABOVE_M, TIPS_CLEAR_M = 0.012, 0.02, 0.001

# The pads press from 12 mm below the grip site to 9 mm above; three rows and three heights stand for their faces.
PAD_ROW_M, PAD_LOW_M, PAD_MIDDLE_M, PAD_HIGH_M = 0.006, -0.010, -0.002, 0.006
PAD_LINES, LOWER_LINE, MIDDLE_LINE = 9, 3, 4
# What is askew to the pads costs little up to 20 degrees, as walls of bowls lean: in units of slope, for the square of
# the tangent. Points whose distances along a line differ less than by that are met at once.
ASKEW, MOST_SLOPE, TIE_M = 5.0, 4.0, 1e-6


class Faces(NamedTuple):
    """Faces of convex pieces: inside where normals . x <= offsets.

    Attributes:
        normals: (pieces, faces, 3) unit vectors; a piece's rows beyond its count are not read.
        offsets: (pieces, faces) metres.
        counts: (pieces,) faces of each.
    """

    normals: Array
    offsets: Array
    counts: NDArray[np.int64]


class Hand(NamedTuple):
    """What of a gripper must have room; see `GripperGeometry`."""

    opening: float
    tips_below_grip: float
    palm_above_grip: float
    finger_inner: float
    finger_outer: float
    finger_half_width: float
    palm_half_along: float
    palm_half_across: float


@compiled
def _crossed(faces: Faces, start: Array, direction: Array, parts: Array) -> None:
    """Write the parts (pieces, 4) of a line start + t * direction inside each piece; (inf, -inf) where none is.

    After where it enters and leaves, the numbers of the faces there.
    """
    for piece in range(len(faces.counts)):
        low, high, missed = -np.inf, np.inf, False
        into, out_of = 0, 0
        for face in range(faces.counts[piece]):
            normal = faces.normals[piece, face]
            rate = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2]
            room = faces.offsets[piece, face] - (normal[0] * start[0] + normal[1] * start[1] + normal[2] * start[2])
            if rate > PARALLEL:
                if room / rate < high:
                    high, out_of = room / rate, face
            elif rate < -PARALLEL:
                if room / rate > low:
                    low, into = room / rate, face
            elif room < 0:
                missed = True
            if missed or low >= high:
                missed = True
                break
        parts[piece, 0] = np.inf if missed else low
        parts[piece, 1] = -np.inf if missed else high
        parts[piece, 2], parts[piece, 3] = into, out_of


@compiled
def _merged(parts: Array, out: Array) -> int:
    """Write the union of intervals, in the first two columns, as disjoint ones that rise, and return how many.

    Small gaps are closed.
    """
    order = np.argsort(parts[:, 0])
    count = 0
    for index in order:
        low, high = parts[index, 0], parts[index, 1]
        if not np.isfinite(low):
            break
        if count and low <= out[count - 1, 1] + GAP_M:
            out[count - 1, 1] = max(out[count - 1, 1], high)
        else:
            out[count, 0], out[count, 1] = low, high
            count += 1
    return count


@compiled
def _intervals(parts: Array, span: bool, out: Array) -> int:
    """What pads can close on along a line: what is filled without a gap, and, with `span`, all of it."""
    count = _merged(parts, out)
    if span and count > 1:
        out[count, 0], out[count, 1] = out[0, 0], out[count - 1, 1]
        count += 1
    return count


@compiled
def _spread(values: Array, count: int) -> float:
    """Standard deviation of the first `count` values."""
    mean = 0.0
    for index in range(count):
        mean += values[index]
    mean /= count
    total = 0.0
    for index in range(count):
        total += (values[index] - mean) ** 2
    return float(np.sqrt(total / count))


@compiled
def _askew(normal: Array, u: Array) -> float:
    """Tangent, squared, of the angle between a unit normal and the line that the fingers open on."""
    along = normal[0] * u[0] + normal[1] * u[1] + normal[2] * u[2]
    return float(1.0 / max(along * along, 1e-6) - 1.0)


@compiled
def candidates(
    faces: Faces, cloud: Array, center: Array, angles: Array, levels: Array, opening: float, span: bool
) -> Array:
    """All places to close on: rows (score, low, high, row, z, angle).

    The fingers open along u = (cos angle, sin angle, 0), from `low` to `high`, and have their width along
    w = (-sin angle, cos angle, 0), about `row`; z is the grip site's height.

    Args:
        faces: of the object's pieces.
        cloud: (n, 3) corners of the pieces.
        center: (3,) of mass.
        angles: radians.
        levels: heights of the grip site.
        opening: wider is not held.
        span: whether what has holes is held across them as well.
    """
    pieces = len(faces.counts)
    parts = np.empty((PAD_LINES, pieces, 4))
    found = np.empty((pieces + 1, 2))
    lows, highs = np.empty(PAD_LINES), np.empty(PAD_LINES)
    out: Array = np.empty((1024, 6))
    count = 0
    for angle in angles:
        u = np.array([np.cos(angle), np.sin(angle), 0.0])
        w = np.array([-np.sin(angle), np.cos(angle), 0.0])
        reach = cloud[:, 0] * w[0] + cloud[:, 1] * w[1]
        least, most = reach.min(), reach.max()
        middle = center[0] * w[0] + center[1] * w[1]
        steps = int(np.ceil((most - least) / LINE_STEP_M / 2))
        rows = middle + np.arange(-steps, steps + 1) * LINE_STEP_M
        rows = rows[(rows > least + EDGE_M) & (rows < most - EDGE_M)]
        if not len(rows):
            rows = np.array([middle])
        for z in levels:
            for row in rows:
                for line in range(PAD_LINES):
                    aside = row + (line // 3 - 1) * PAD_ROW_M
                    rise = (PAD_LOW_M, PAD_MIDDLE_M, PAD_HIGH_M)[line % 3]
                    start = np.array([aside * w[0], aside * w[1], z + rise])
                    _crossed(faces, start, u, parts[line])
                # A surface lower than the pads' middle is held by their lower ends.
                several = _intervals(parts[MIDDLE_LINE], span, found)
                if not several:
                    several = _intervals(parts[LOWER_LINE], span, found)
                for index in range(several):
                    low, high = found[index]
                    if not THINNEST_M < high - low < opening:
                        continue
                    touched = 0
                    lowest, highest, low_askew, high_askew = np.inf, -np.inf, 0.0, 0.0
                    for line in range(PAD_LINES):
                        first, last = np.inf, -np.inf
                        left, right = 0, 0
                        for piece in range(pieces):
                            if parts[line, piece, 0] < high + PRESSED_M and parts[line, piece, 1] > low - PRESSED_M:
                                if parts[line, piece, 0] < first:
                                    first, left = parts[line, piece, 0], piece
                                if parts[line, piece, 1] > last:
                                    last, right = parts[line, piece, 1], piece
                        if first < np.inf:
                            lows[touched], highs[touched] = first, last
                            touched += 1
                            if first < lowest - TIE_M:
                                lowest, low_askew = first, _askew(faces.normals[left, int(parts[line, left, 2])], u)
                            if last > highest + TIE_M:
                                highest, high_askew = last, _askew(faces.normals[right, int(parts[line, right, 3])], u)
                    # Higher for large and flat faces, near the centre of mass, with room between the fingers. What is
                    # askew where the pads touch first turns in them, though they meet no more of it than that.
                    slope = (_spread(lows, touched) + _spread(highs, touched)) / 2 / 0.004 if touched > 1 else 1.0
                    slope = max(slope, min(ASKEW * (low_askew + high_askew) / 2, MOST_SLOPE))
                    x = (low + high) / 2 * u[0] + row * w[0] - center[0]
                    y = (low + high) / 2 * u[1] + row * w[1] - center[1]
                    lever, above = np.sqrt(x * x + y * y) / 0.05, abs(z - center[2]) / 0.06
                    tight = max(high - low - 0.066, 0.0) / 0.01
                    if count == len(out):
                        out = np.concatenate((out, np.empty_like(out)))
                    out[count, 0] = 2.0 * touched / PAD_LINES - 0.8 * slope - lever - 0.15 * above - 0.7 * tight
                    out[count, 1], out[count, 2], out[count, 3], out[count, 4] = low, high, row, z
                    out[count, 5] = angle
                    count += 1
    return out[:count].copy()


@compiled
def has_room(faces: Faces, candidate: Array, top: float, hand: Hand) -> bool:
    """Whether the open fingers and the palm meet nothing, at a row of `candidates` of an object as high as `top`."""
    middle, row, z, angle = (candidate[1] + candidate[2]) / 2, candidate[3], candidate[4], candidate[5]
    u = np.array([np.cos(angle), np.sin(angle), 0.0])
    w = np.array([-np.sin(angle), np.cos(angle), 0.0])
    parts = np.empty((len(faces.counts), 4))
    # The fingers, from their tips to the palm, and nothing beside the object to be held.
    for side in (-hand.finger_half_width, 0.0, hand.finger_half_width):
        for rise in (TIPS_CLEAR_M - hand.tips_below_grip, 0.0, FINGERS_ABOVE_M):
            start = np.array([(row + side) * w[0], (row + side) * w[1], z + rise])
            _crossed(faces, start, u, parts)
            for piece in range(len(parts)):
                low, high = parts[piece, 0] - middle, parts[piece, 1] - middle
                near = high > -hand.finger_outer and low < hand.finger_outer
                if near and (low < -hand.finger_inner or high > hand.finger_inner):
                    return False
    # The palm: nothing crosses lines along it, from its height up to the top.
    for height in np.arange(z + hand.palm_above_grip, top, PALM_STEP_M):
        for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
            side = share * hand.palm_half_across
            start = np.array([(row + side) * w[0], (row + side) * w[1], height])
            _crossed(faces, start, u, parts)
            for piece in range(len(parts)):
                if parts[piece, 1] - middle > -hand.palm_half_along and parts[piece, 0] - middle < hand.palm_half_along:
                    return False
    return True


@compiled
def _position(candidate: Array) -> tuple[float, float, float]:
    middle, row, angle = (candidate[1] + candidate[2]) / 2, candidate[3], candidate[5]
    cosine, sine = np.cos(angle), np.sin(angle)
    return middle * cosine - row * sine, middle * sine + row * cosine, candidate[4]


@compiled
def chosen(faces: Faces, rows: Array, top: float, hand: Hand, most: int) -> NDArray[np.int64]:
    """Numbers of up to `most` rows of `candidates`, in order, such that no two are alike and the hand has room."""
    kept = np.empty(most, dtype=np.int64)
    places = np.empty((most, 3))
    count = 0
    for index in range(len(rows)):
        place = _position(rows[index])
        alike = False
        for other in range(count):
            x, y, z = place[0] - places[other, 0], place[1] - places[other, 1], place[2] - places[other, 2]
            if x * x + y * y + z * z < ALIKE_M**2 and abs(np.cos(rows[index, 5] - rows[kept[other], 5])) > ALIKE_COS:
                alike = True
                break
        if alike or not has_room(faces, rows[index], top, hand):
            continue
        kept[count] = index
        places[count, 0], places[count, 1], places[count, 2] = place
        count += 1
        if count == most:
            break
    return kept[:count].copy()
