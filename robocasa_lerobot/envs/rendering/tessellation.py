"""Surfaces of boxes, cylinders and capsules as triangles, with normals and MuJoCo's generated texture coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FACET_M = 0.015  # a round shape gets facets about this wide, up to the number asked for
MIN_SLICES = 6


@dataclass(frozen=True)
class Surface:
    """Triangles, counter-clockwise seen from outside.

    Attributes:
        vertices: metres, (n, 3).
        normals: at the vertices, unit length, (n, 3).
        texcoords: at the vertices, (n, 2); of a unit shape its x and y.
        faces: indices of vertices, (m, 3).
    """

    vertices: Array
    normals: Array
    texcoords: Array
    faces: NDArray[np.int32]


def joined(surfaces: Sequence[Surface]) -> Surface:
    """One surface of all."""
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces[:-1])])
    return Surface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([surface.normals for surface in surfaces]),
        np.concatenate([surface.texcoords for surface in surfaces]),
        np.concatenate([surface.faces + start for surface, start in zip(surfaces, starts, strict=True)]).astype(
            np.int32
        ),
    )


def boxes(half_sizes: Array, positions: Array, rotations: Array, repeat: Array, shown: NDArray[np.bool_]) -> Surface:
    """One surface of n boxes with sharp edges, placed and textured: many times faster than one by one.

    Args:
        half_sizes: metres, (n, 3).
        positions: of their middles, metres, (n, 3).
        rotations: (n, 3, 3).
        repeat: of the texture, as in `textured`, (n, 2).
        shown: which faces they have, to lower and higher x, then y, then z, (n, 6).
    """
    turned = rotations.transpose(0, 2, 1)
    vertices = (_BOX_CORNERS * half_sizes[:, None]) @ turned + positions[:, None]
    texcoords = textured(_BOX_CORNERS[:, :2], repeat[:, None])
    kept = np.repeat(shown, 4, axis=1)
    starts = 4 * np.arange(int(shown.sum()), dtype=np.int32)
    faces = (starts[:, None, None] + _BOX_FACES[:2]).reshape(-1, 3)
    return Surface(vertices[kept], (_BOX_NORMALS @ turned)[kept], texcoords[kept], faces)


def cylinders(
    radii: Array, half_lengths: Array, slices: int, positions: Array, rotations: Array, repeat: Array
) -> Surface:
    """One surface of n closed cylinders along their z, of equal numbers of vertices and of faces each; as `boxes`.

    Args:
        radii: metres, (n,).
        half_lengths: metres, (n,).
        slices: facets around each.
        positions: of their middles, metres, (n, 3).
        rotations: (n, 3, 3).
        repeat: of the texture, as in `textured`, (n, 2).
    """
    unit = _unit_cylinder(slices)
    vertices = unit.vertices * np.column_stack((radii, radii, half_lengths))[:, None]
    return _placed(unit, vertices, positions, rotations, repeat)


def capsules(
    radii: Array, half_lengths: Array, slices: int, positions: Array, rotations: Array, repeat: Array
) -> Surface:
    """As `cylinders`, with a half sphere on each end; `half_lengths` are of the cylinders, as in MuJoCo."""
    unit, ends = _unit_capsule(slices)
    vertices = radii[:, None, None] * unit.vertices + half_lengths[:, None, None] * ends
    return _placed(unit, vertices, positions, rotations, repeat)


@cache
def unit_box(quads: tuple[int, int, int], *, only_top: bool = False) -> Surface:
    """A box of half size 1, its edges along x, y and z parted into so many; or its upper face alone."""
    parts = []
    for axis, side in [(2, 1)] if only_top else [(axis, side) for axis in range(3) for side in (-1, 1)]:
        across, up = (axis + 1) % 3, (axis + 2) % 3
        wide, high = quads[across], quads[up]
        u, v = np.meshgrid(np.linspace(-1.0, 1.0, wide + 1), np.linspace(-1.0, 1.0, high + 1))
        vertices = np.empty((u.size, 3))
        vertices[:, axis], vertices[:, across], vertices[:, up] = side, side * u.ravel(), v.ravel()
        a = (np.arange(high)[:, None] * (wide + 1) + np.arange(wide)).ravel()
        b, c, d = a + 1, a + wide + 2, a + wide + 1
        faces = np.concatenate((np.stack((a, b, d), axis=1), np.stack((b, c, d), axis=1))).astype(np.int32)
        normals = np.zeros_like(vertices)
        normals[:, axis] = side
        parts.append(Surface(vertices, normals, vertices[:, :2], faces))
    return joined(parts)


def spheres(half_sizes: Array, slices: int, stacks: int) -> Surface:
    """An ellipsoid of half sizes (3,), metres, with so many facets around and from pole to pole."""
    rise = np.linspace(-np.pi / 2, np.pi / 2, stacks + 1)
    unit = _tube(_circle(slices), np.cos(rise), np.sin(rise), np.sin(rise))
    normals = unit.normals / half_sizes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Surface(unit.vertices * half_sizes, normals, unit.texcoords, unit.faces)


def _placed(unit: Surface, vertices: Array, positions: Array, rotations: Array, repeat: Array) -> Surface:
    """Copies of a unit shape that have `vertices` (n, k, 3) each."""
    turned = rotations.transpose(0, 2, 1)
    count, own = vertices.shape[:2]
    faces = unit.faces + own * np.arange(count, dtype=np.int32)[:, None, None]
    return Surface(
        (vertices @ turned + positions[:, None]).reshape(-1, 3),
        (unit.normals @ turned).reshape(-1, 3),
        textured(unit.texcoords, repeat[:, None]).reshape(-1, 2),
        faces.reshape(-1, 3),
    )


def textured(texcoords: Array, repeat: Array) -> Array:
    """Texture coordinates as MuJoCo generates them for primitives: projected along the shape's own z.

    `texcoords` (..., 2) are x and y from -1 to 1, `repeat` (..., 2) counts the texture's repetitions over a shape.
    The rule was measured on pictures of MuJoCo 3.17: u = repeat (1 + x) / 2 and v = repeat (1 - y) / 2.
    """
    return np.asarray(0.5 * repeat * (1.0 + texcoords * (1.0, -1.0)))


@cache
def _unit_cylinder(slices: int) -> Surface:
    circle = _circle(slices)
    side = _tube(circle, np.array((1.0, 1.0)), np.array((-1.0, 1.0)), np.zeros(2))
    return joined([side, _disk(circle, -1.0), _disk(circle, 1.0)])


@cache
def _unit_capsule(slices: int) -> tuple[Surface, Array]:
    """A unit sphere, parted at its equator, and for each vertex the direction (3,) of its end."""
    rings = max(1, slices // 4)
    rise = np.linspace(-np.pi / 2, 0.0, rings + 1)  # of the rings of the lower end, from its pole
    angles = np.concatenate((rise, -rise[::-1]))
    surface = _tube(_circle(slices), np.cos(angles), np.sin(angles), np.sin(angles))
    ends = np.zeros_like(surface.vertices)
    ends[:, 2] = np.repeat((-1.0, 1.0), (rings + 1) * (slices + 1))
    return surface, ends


def used_slices(radii: Array, most: int) -> NDArray[np.intp]:
    """How many facets round shapes of these radii, metres, get at most `most` of."""
    return np.clip(np.ceil(2 * np.pi * radii / FACET_M), MIN_SLICES, max(most, MIN_SLICES)).astype(np.intp)


def _circle(slices: int) -> Array:
    """Points of the unit circle, the first again at the end, (slices + 1, 2)."""
    angles = np.linspace(0.0, 2 * np.pi, slices + 1)
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def _tube(circle: Array, radii: Array, heights: Array, normal_z: Array) -> Surface:
    """Rings around z, joined from the lowest up; a ring's normals rise by `normal_z`."""
    count = len(circle)
    vertices = np.concatenate(
        [np.column_stack((circle * radius, np.full(count, z))) for radius, z in zip(radii, heights, strict=True)]
    )
    normals = np.concatenate(
        [np.column_stack((circle * np.sqrt(max(0.0, 1.0 - z * z)), np.full(count, z))) for z in normal_z]
    )
    low = np.arange(len(radii) - 1)[:, None] * count + np.arange(count - 1)
    a, b, c, d = low, low + 1, low + count + 1, low + count
    faces = np.concatenate((np.stack((a, b, c), axis=-1).reshape(-1, 3), np.stack((a, c, d), axis=-1).reshape(-1, 3)))
    return Surface(vertices, normals, vertices[:, :2], faces.astype(np.int32))


def _disk(circle: Array, side: float) -> Surface:
    """The unit disk at z = `side`, seen from there."""
    count = len(circle)
    vertices = np.column_stack((np.concatenate((np.zeros((1, 2)), circle)), np.full(count + 1, side)))
    rim = np.arange(1, count)
    faces = np.stack((np.zeros_like(rim), rim, rim + 1) if side > 0 else (np.zeros_like(rim), rim + 1, rim), axis=1)
    return Surface(vertices, np.tile((0.0, 0.0, side), (count + 1, 1)), vertices[:, :2], faces.astype(np.int32))


def _unit_box() -> tuple[Array, Array, NDArray[np.int32]]:
    corners: list[Array] = []
    normals: list[Array] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            start = len(corners)
            for u, v in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
                corner = np.empty(3)
                corner[[axis, (axis + 1) % 3, (axis + 2) % 3]] = side, u * side, v
                corners.append(corner)
                normals.append(side * np.eye(3)[axis])
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return np.array(corners), np.array(normals), np.array(faces, dtype=np.int32)


_BOX_CORNERS, _BOX_NORMALS, _BOX_FACES = _unit_box()
