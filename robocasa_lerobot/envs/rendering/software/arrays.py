"""What is drawn, as arrays that compiled code takes together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Numbers = NDArray[np.int32]
Texels = NDArray[np.uint64]
Picture = NDArray[np.uint8]

OPAQUE = 0.999  # opacity from which on MuJoCo draws nothing through a geom
# Columns of `Pose.lights`.
DIRECTION, AMBIENT, DIFFUSE, SPECULAR, POSITION, ATTENUATION = 0, 3, 6, 9, 12, 15
NARROWEST_COSINE, EXPONENT, IS_FAR, LIGHT_COLUMNS = 18, 19, 20, 21


class Shapes(NamedTuple):
    """The triangles of a model, and what never changes of their looks.

    Attributes:
        first_vertex: of each geom, and the end, (ngeom + 1,).
        vertices: in the geoms' own frames, metres, (n, 3).
        normals: at the vertices, (n, 3).
        texcoords: at the vertices, (n, 2).
        first_face: of each geom, and the end, (ngeom + 1,).
        faces: vertices of each triangle, counter-clockwise from outside, (m, 3).
        geom_of: of each triangle, (m,).
        reach: radius of each geom around its origin, metres, 0 for one that is never out of view, (ngeom,).
        bounds: middle and half sizes of each geom's box in its own frame, metres, (ngeom, 6).
        is_backdrop: geoms behind all others, (ngeom,).
        texture_of: of each geom, negative for none, (ngeom,).
        texels, levels, counts: `textures.Textures`.
    """

    first_vertex: Numbers
    vertices: Single
    normals: Single
    texcoords: Single
    first_face: Numbers
    faces: Numbers
    geom_of: Numbers
    reach: Array
    bounds: Array
    is_backdrop: NDArray[np.bool_]
    texture_of: Numbers
    texels: Texels
    levels: Numbers
    counts: Numbers


class Pose(NamedTuple):
    """A state, as one camera sees it.

    Attributes:
        positions: of the geoms, metres, (ngeom, 3).
        rotations: of the geoms, row by row, (ngeom, 9).
        looks: of each geom colour and opacity, glow, highlights and their sharpness, (ngeom, 7).
        lights: of each, in these columns, its direction, its ambient, diffuse and specular colour, its position,
            attenuation (constant, with distance, with its square), the cosine of half its cone's angle, how it fades to
            the cone's edge, and whether it is infinitely far away, (lights, 21).
        eye: the camera's position, (3,).
        axes: its rotation, row by row, (9,).
        lens: focal lengths to the right and up, the principal point from the picture's left and upper edge, all in
            pixels, and the distance from which on is drawn, metres, (5,).
    """

    positions: Array
    rotations: Array
    looks: Array
    lights: Array
    eye: Array
    axes: Array
    lens: Array


class View(NamedTuple):
    """The rows of a picture that are drawn together.

    Attributes:
        first_row, end_row: from the upper edge.
        width: of the picture, pixels.
    """

    first_row: int
    end_row: int
    width: int


class Kept(NamedTuple):
    """What stands still in a view, drawn without the rest.

    Attributes:
        is_in: geoms that it has, (ngeom,).
        inverse: as in `Scratch`, of the whole picture, (height * width,).
        seen: as in `Scratch`, of the whole picture, (height * width,).
        colours: of what is seen, (height, width, 3).
    """

    is_in: NDArray[np.bool_]
    inverse: Single
    seen: Numbers
    colours: Picture

    @classmethod
    def of(cls, is_in: NDArray[np.bool_], height: int, width: int) -> Kept:
        """To be drawn, of a picture of that size."""
        pixels = height * width
        return cls(
            is_in,
            np.empty(pixels, dtype=np.float32),
            np.empty(pixels, dtype=np.int32),
            np.empty((height, width, 3), dtype=np.uint8),
        )


class Scratch(NamedTuple):
    """What the drawing of rows of a picture works in.

    Attributes:
        corners: vertices in the camera's frame, to its right, up, and forward, metres, (n, 3).
        is_lit: vertices whose light is known, (n,).
        lit: their light, red, green and blue from 0 to 1, (n, 3).
        inverse: of the distance from the camera's plane to what is seen, 1/m, row after row, (rows * width,).
        seen: number of the triangle that is seen, negative for none, row after row, (rows * width,).
        over_seen: the same of what is drawn over it, (rows * width,).
    """

    corners: Array
    is_lit: NDArray[np.bool_]
    lit: Single
    inverse: Single
    seen: Numbers
    over_seen: Numbers

    @classmethod
    def of(cls, vertices: int, height: int, width: int) -> Scratch:
        """Empty, for pictures of that size."""
        pixels = height * width
        return cls(
            np.empty((vertices, 3)),
            np.zeros(vertices, dtype=np.bool_),
            np.empty((vertices, 3), dtype=np.float32),
            np.empty(pixels, dtype=np.float32),
            np.empty(pixels, dtype=np.int32),
            np.full(pixels, -1, dtype=np.int32),
        )
