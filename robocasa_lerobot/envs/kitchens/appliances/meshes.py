"""Meshes generated from a few numbers: lofts through rings, turned profiles, rounded blocks, pipes. Few triangles.

What was made last is kept: a kitchen has a hundred of them, nearly all in earlier kitchens too.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.fixtures.base import Vector

Points = NDArray[np.float64]

KEPT_MESHES = 2048  # of each kind; one takes about 3 kB


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3) in metres and triangles (m, 3) that wind counter-clockwise as seen from outside."""

    vertices: Points
    faces: NDArray[np.int64]

    @functools.cached_property
    def digest(self) -> str:
        """Sixteen characters that meshes which are equal to 10 micrometres have in common."""
        vertices = np.round(self.vertices, 5) + 0.0  # no negative zeros
        return hashlib.sha1(vertices.tobytes() + self.faces.tobytes(), usedforsecurity=False).hexdigest()[:16]


def _kept[**P](make: Callable[P, Mesh]) -> Callable[P, Mesh]:
    """Keep the meshes that a function has made last, by the bits of its arguments: 0.0 and -0.0 are not the same."""

    @functools.lru_cache(KEPT_MESHES)
    def made(arguments: bytes) -> Mesh:
        positional, named = pickle.loads(arguments)
        mesh = make(*positional, **named)
        for shared in (mesh.vertices, mesh.faces):
            shared.flags.writeable = False
        return mesh

    @functools.wraps(make)
    def kept(*positional: P.args, **named: P.kwargs) -> Mesh:
        return made(pickle.dumps((positional, named), protocol=pickle.HIGHEST_PROTOCOL))

    return kept


@_kept
def loft(rings: Sequence[Points], *, caps: bool = True, foot: bool = True) -> Mesh:
    """The skin through rings of n points each, counter-clockwise as seen against the direction of the rings' order.

    Args:
        rings: of shape (n, 3); a ring whose points coincide becomes a tip.
        caps: close the first and the last ring.
        foot: close the first one too, which nobody sees of what stands on something.
    """
    count = len(rings[0])
    vertices = np.concatenate(rings)
    faces: list[tuple[int, int, int]] = []
    for ring in range(len(rings) - 1):
        low, high = ring * count, (ring + 1) * count
        for i in range(count):
            j = (i + 1) % count
            faces.append((low + i, low + j, high + j))
            faces.append((low + i, high + j, high + i))
    if caps:
        last = (len(rings) - 1) * count
        for i in range(1, count - 1):
            if foot:
                faces.append((0, i + 1, i))
            faces.append((last, last + i, last + i + 1))
    return _merged(vertices, np.array(faces))


def _merged(vertices: Points, faces: NDArray[np.int64]) -> Mesh:
    """Without double vertices and triangles without area."""
    unique, index = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    good = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    return Mesh(unique, faces[good])


def circle(radius: float, z: float, segments: int, squash: float = 1.0) -> Points:
    """A ring of points about z, shape (segments, 3); `squash` scales it along y."""
    angle = 2 * np.pi * (np.arange(segments) + 0.5) / segments
    return np.stack([radius * np.cos(angle), squash * radius * np.sin(angle), np.full(segments, z)], axis=1)


def rounded_rectangle(width: float, depth: float, z: float, radius: float, per_corner: int = 3) -> Points:
    """A ring of 4 * per_corner points: a rectangle with rounded corners, counter-clockwise from above."""
    radius = min(radius, width / 2 - 1e-4, depth / 2 - 1e-4)
    points = []
    steps = np.linspace(0, np.pi / 2, per_corner) if per_corner > 1 else np.array([np.pi / 4])
    for corner, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angles = steps + corner * np.pi / 2
        cx, cy = sx * (width / 2 - radius), sy * (depth / 2 - radius)
        points += [(cx + radius * np.cos(a), cy + radius * np.sin(a), z) for a in angles]
    return np.array(points)


@_kept
def turned(profile: Sequence[tuple[float, float]], segments: int = 12, *, caps: bool = True, foot: bool = True) -> Mesh:
    """A body of revolution about z through (radius, z) points, which must go upwards along the outside.

    A profile may come back down on the inside, as of a bowl; then `caps` should be False.
    """
    return loft([circle(r, z, segments) for r, z in profile], caps=caps, foot=foot)


@_kept
def block(size: Vector, radius: float, *, bevel: float = 0.004, taper: float = 1.0, per_corner: int = 3) -> Mesh:
    """A block with upright edges of a radius and bevelled upper and lower edges; the top is scaled by `taper`."""
    width, depth, height = size
    bevel = min(bevel, height / 3)

    def at(z: float, inset: float) -> Points:
        share = 1.0 + (taper - 1.0) * (z / height + 0.5)
        return rounded_rectangle(
            width * share - 2 * inset, depth * share - 2 * inset, z, max(radius - inset, 1e-3), per_corner
        )

    low, high = -height / 2, height / 2
    return loft([at(low, bevel), at(low + bevel, 0.0), at(high - bevel, 0.0), at(high, bevel)])


@_kept
def dome(size: Vector, radius: float, *, shoulder: float, per_corner: int = 3) -> Mesh:
    """A block whose upper edge is rounded over the height `shoulder`; as bread bins, retro toasters and kettles."""
    width, depth, height = size
    low, high = -height / 2, height / 2
    rings = [rounded_rectangle(width, depth, low, radius, per_corner)]
    for angle in np.linspace(0, np.pi / 2, 4):
        inset = shoulder * (1 - np.cos(angle))
        z = high - shoulder * (1 - np.sin(angle))
        rings.append(rounded_rectangle(width - 2 * inset, depth - 2 * inset, z, max(radius - inset, 1e-3), per_corner))
    return loft(rings)


@_kept
def pipe(path: Sequence[Vector], radius: float, sides: int = 6) -> Mesh:
    """A round bar along a polyline of points, mitred at its bends, with flat ends."""
    points = _cut_corners(np.asarray(path, dtype=np.float64), 1.6 * radius)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    tangents = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    # A frame carried along without twist.
    normal = np.cross(tangents[0], [0.0, 0.0, 1.0] if abs(tangents[0][2]) < 0.9 else [1.0, 0.0, 0.0])
    normal /= np.linalg.norm(normal)
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for index, (point, tangent) in enumerate(zip(points, tangents, strict=True)):
        normal = normal - tangent * (normal @ tangent)
        normal /= np.linalg.norm(normal)
        other = np.cross(tangent, normal)
        step = steps[min(index, len(steps) - 1)]
        stretch = 1.0 / max(float(tangent @ step), 0.5)  # keeps the bar's thickness at a bend
        rings.append(point + radius * stretch * (np.cos(angle)[:, None] * normal + np.sin(angle)[:, None] * other))
    return loft(rings)


def _cut_corners(points: Points, cut: float) -> Points:
    """A polyline whose bends of more than 50 degrees are broken in two, `cut` metres before and after."""
    out = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        back, ahead = before - corner, after - corner
        lengths = float(np.linalg.norm(back)), float(np.linalg.norm(ahead))
        back, ahead = back / lengths[0], ahead / lengths[1]
        if back @ ahead > -np.cos(np.radians(50.0)):
            out += [corner + back * min(cut, lengths[0] * 0.4), corner + ahead * min(cut, lengths[1] * 0.4)]
        else:
            out.append(corner)
    return np.array([*out, points[-1]])


@_kept
def disc(radius: float, segments: int = 16) -> Mesh:
    """A flat cone about z, hardly raised in its middle, seen only from above: for what lies on a surface."""
    ring = circle(radius, 0.0, segments)
    vertices = np.concatenate([ring, [[0.0, 0.0, 1e-4]]])
    faces = [(i, (i + 1) % segments, segments) for i in range(segments)]
    return Mesh(vertices, np.array(faces))


@_kept
def crown(radius: float, height: float, points: int = 10) -> Mesh:
    """A ring of pointed tongues about z that lean outwards, seen from outside and from above: flames."""
    low, high = circle(radius, 0.0, 2 * points), circle(radius * 1.12, height, 2 * points)
    inner = circle(radius * 0.82, 0.0, 2 * points)
    vertices = np.concatenate([low, high, inner])
    faces = []
    for i in range(points):
        left, tip, right = 2 * i, 2 * points + 2 * i + 1, (2 * i + 2) % (2 * points)
        faces += [(left, right, tip), (4 * points + right, 4 * points + left, tip)]
    return Mesh(vertices, np.array(faces))
