"""Triangle meshes made by turning, extruding and sweeping.

Sharp edges are edges between vertices of different `ids`: normals are averaged over the faces that share an id.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Points = Sequence[Sequence[float]] | Array

_CREASE_COS = 0.72  # profiles that turn by more than about 44 degrees get a sharp edge


@dataclass(frozen=True)
class Mesh:
    """Triangles.

    Attributes:
        vertices: (n, 3), metres.
        faces: (m, 3) indices, counter-clockwise seen from outside.
        uv: (n, 2) texture coordinates in [0, 1], v upwards.
        ids: (n,) vertices with the same id share their normal.
    """

    vertices: Array
    faces: Ints
    uv: Array
    ids: Ints

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """Translated, metres."""
        return self.mapped(lambda v: v + np.array([x, y, z]))

    def scaled(self, x: float, y: float | None = None, z: float | None = None) -> Mesh:
        """Scaled about the origin; one number scales all axes."""
        factors = np.array([x, x if y is None else y, x if z is None else z])
        out = self.mapped(lambda v: v * factors)
        return out if factors.prod() > 0 else Mesh(out.vertices, out.faces[:, ::-1].copy(), out.uv, out.ids)

    def turned(self, axis: str, angle: float) -> Mesh:
        """Rotated about an axis through the origin, radians."""
        matrix = rotation(axis, angle)
        return self.mapped(lambda v: v @ matrix.T)

    def mapped(self, function: Callable[[Array], Array]) -> Mesh:
        """With the vertices (n, 3) replaced by a function of them."""
        return Mesh(function(self.vertices), self.faces, self.uv, self.ids)

    def flattened(self, share: float = 0.05) -> Mesh:
        """With its lowest `share` of the height pressed into a plane, to stand on."""
        low, high = self.vertices[:, 2].min(), self.vertices[:, 2].max()
        floor = low + share * (high - low)
        return self.mapped(lambda v: np.column_stack([v[:, :2], np.maximum(v[:, 2], floor)]))

    def above(self, z: float) -> Mesh:
        """With what lies below a height pressed up to it."""
        if float(self.vertices[:, 2].min()) >= z:
            return self
        return self.mapped(lambda v: np.column_stack([v[:, :2], np.maximum(v[:, 2], z)]))

    def fitted(self, size: Sequence[float], bottom: float = 0.0) -> Mesh:
        """Scaled to full extents (metres), centred in x and y, its lowest point at z = `bottom`."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        factor = np.asarray(size) / np.maximum(high - low, 1e-9)
        origin = np.array([*((low + high) / 2)[:2], low[2]])
        return self.mapped(lambda v: (v - origin) * factor + np.array([0.0, 0.0, bottom]))

    def normals(self) -> Array:
        """Unit normals by vertex, (n, 3)."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        face = np.cross(b - a, c - a)  # twice the area long
        total = np.zeros((int(self.ids.max()) + 1, 3))
        for i in range(3):
            np.add.at(total, self.ids[self.faces[:, i]], face)
        out = total[self.ids]
        length = np.linalg.norm(out, axis=1, keepdims=True)
        return np.where(length > 1e-15, out / np.maximum(length, 1e-15), np.array([0.0, 0.0, 1.0]))


def rotation(axis: str, angle: float) -> Array:
    """Rotation matrix (3, 3) about x, y or z by an angle in radians."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert axis == "z"
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    id_offsets = np.cumsum([0, *(int(m.ids.max()) + 1 for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + offset for m, offset in zip(meshes, offsets, strict=False)]),
        np.concatenate([m.uv for m in meshes]),
        np.concatenate([m.ids + offset for m, offset in zip(meshes, id_offsets, strict=False)]),
    )


def lathe(profile: Points, n: int = 14, arc: float = 2 * np.pi) -> Mesh:
    """Turn a profile of (radius, height) points about z; it runs upwards on the outside.

    u of the texture runs around, v along the profile. With an `arc` below a full turn both cut faces are closed.
    """
    points = np.asarray(profile, float)
    full = arc > 2 * np.pi - 1e-6
    step = np.diff(points, axis=0)
    length = np.linalg.norm(step, axis=1)
    along = np.concatenate([[0], np.cumsum(length)]) / max(length.sum(), 1e-12)
    unit = step / np.maximum(length, 1e-12)[:, None]
    rows: list[tuple[float, float, float, int]] = []  # radius, z, v, smoothing group
    group = 0
    for i, (r, z) in enumerate(points):
        rows.append((r, z, along[i], group))
        group += 1
        if 0 < i < len(points) - 1 and r > 1e-9 and float(unit[i - 1] @ unit[i]) < _CREASE_COS:
            rows.append((r, z, along[i], group))
            group += 1
    table = np.array(rows)
    angle = np.linspace(0.0, arc, n + 1)
    count = n + 1
    xy = table[:, 0, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)[None]
    z = np.repeat(table[:, 1, None], count, axis=1)
    vertices = np.concatenate([xy, z[..., None]], axis=2).reshape(-1, 3)
    uv = np.stack(np.broadcast_arrays(np.linspace(0, 1, count)[None, :], table[:, 2, None]), axis=-1).reshape(-1, 2)
    column = np.arange(count) % n if full else np.arange(count)
    column_ids = np.where(table[:, 0, None] < 1e-9, 0, column[None, :])
    ids = (table[:, 3, None].astype(int) * count + column_ids).reshape(-1)
    faces = []
    for row in range(len(table) - 1):
        if np.allclose(table[row, :2], table[row + 1, :2]):
            continue  # the two sides of a sharp edge
        a = row * count + np.arange(n)
        b, c, d = a + 1, a + count + 1, a + count
        if table[row + 1, 0] > 1e-9 or table[row, 0] > 1e-9:
            if table[row, 0] > 1e-9:
                faces.append(np.column_stack([a, b, c if table[row + 1, 0] > 1e-9 else d]))
            if table[row + 1, 0] > 1e-9:
                faces.append(np.column_stack([a, c, d]))
    out = Mesh(vertices, np.concatenate(faces), uv, ids)
    if full:
        return out
    caps = []
    outline = np.column_stack([points[:, 0], points[:, 1]])
    for end, sign in ((0.0, -1.0), (arc, 1.0)):
        face = polygon(outline)
        flat = np.column_stack([face.vertices[:, 0], np.zeros(len(outline)), face.vertices[:, 1]])
        cap = Mesh(flat @ rotation("z", end).T, face.faces, face.uv, face.ids)
        flipped = _area(outline) * sign > 0
        caps.append(cap if not flipped else Mesh(cap.vertices, cap.faces[:, ::-1].copy(), cap.uv, cap.ids))
    return joined([out, *caps])


def _area(outline: Array) -> float:
    x, y = outline[:, 0], outline[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def polygon(outline: Points) -> Mesh:
    """A flat polygon in the plane z = 0, facing +z, by cutting ears; texture coordinates over its bounding box."""
    points = np.asarray(outline, float)
    if _area(points) < 0:
        points = points[::-1]
    left = list(range(len(points)))
    faces: list[tuple[int, int, int]] = []
    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = points[i], points[j], points[m]
            if _cross(b - a, c - b) <= 1e-14:
                continue
            others = points[[p for p in left if p not in (i, j, m)]]
            inside = (
                (_cross(b - a, others - a) > 1e-12)
                & (_cross(c - b, others - b) > 1e-12)
                & (_cross(a - c, others - c) > 1e-12)
            )
            if not inside.any():
                faces.append((i, j, m))
                del left[k]
                break
        else:
            del left[0]  # only degenerate corners are left
    faces.append((left[0], left[1], left[2]))
    low, high = points.min(axis=0), points.max(axis=0)
    uv = (points - low) / np.maximum(high - low, 1e-9)
    vertices = np.column_stack([points, np.zeros(len(points))])
    return Mesh(vertices, np.array(faces), uv, np.zeros(len(points), int))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def prism(outline: Points, z0: float, z1: float, *, top: float = 1.0, smooth: bool = False) -> Mesh:
    """An outline in x, y extruded from z0 to z1; the upper outline is scaled by `top` about its centroid."""
    points = np.asarray(outline, float)
    if _area(points) < 0:
        points = points[::-1]
    middle = points.mean(axis=0)
    upper = middle + (points - middle) * top
    lid = polygon(upper).moved(z=z1)
    base = polygon(points)
    base = Mesh(base.vertices + np.array([0, 0, z0]), base.faces[:, ::-1].copy(), base.uv, base.ids)
    n = len(points)
    u = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1))])
    u = u / u[-1]
    vertices: list[tuple[float, float, float]] = []
    uv: list[tuple[float, float]] = []
    ids: list[int] = []
    faces: list[tuple[int, int, int]] = []
    for i in range(n):
        j = (i + 1) % n
        start = len(vertices)
        vertices += [(*points[i], z0), (*points[j], z0), (*upper[j], z1), (*upper[i], z1)]
        uv += [(u[i], 0), (u[i + 1], 0), (u[i + 1], 1), (u[i], 1)]
        ids += [i, j, n + j, n + i] if smooth else [i] * 4
        faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    side = Mesh(np.array(vertices, float), np.array(faces), np.array(uv, float), np.array(ids))
    return joined([side, lid, base])


def box(size: Sequence[float], center: Sequence[float] = (0, 0, 0), taper: float = 1.0) -> Mesh:
    """A box of full extents; `taper` scales the top. The texture covers each side once."""
    x, y, z = (s / 2 for s in size)
    faces: list[tuple[int, int, int]] = []
    vertices: list[tuple[float, float, float]] = []
    uv: list[tuple[float, float]] = []
    ids: list[int] = []
    sides = (
        [(-x, -y, -z), (x, -y, -z), (x, -y, z), (-x, -y, z)],
        [(x, y, -z), (-x, y, -z), (-x, y, z), (x, y, z)],
        [(x, -y, -z), (x, y, -z), (x, y, z), (x, -y, z)],
        [(-x, y, -z), (-x, -y, -z), (-x, -y, z), (-x, y, z)],
        [(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)],
        [(-x, y, -z), (x, y, -z), (x, -y, -z), (-x, -y, -z)],
    )
    for i, corners in enumerate(sides):
        faces += [(4 * i, 4 * i + 1, 4 * i + 2), (4 * i, 4 * i + 2, 4 * i + 3)]
        vertices += corners
        uv += [(0, 0), (1, 0), (1, 1), (0, 1)]
        ids += [i] * 4
    array = np.array(vertices, float)
    upper = array[:, 2] > 0
    array[upper, :2] *= taper
    return Mesh(array + np.asarray(center, float), np.array(faces), np.array(uv, float), np.array(ids))


def sides_of_box(size: Sequence[float], which: Sequence[int], center: Sequence[float] = (0, 0, 0)) -> Mesh:
    """Some sides of a box: 0 front (-y), 1 back, 2 right (+x), 3 left, 4 top, 5 bottom."""
    whole = box(size, center)
    faces = np.concatenate([whole.faces[2 * i : 2 * i + 2] for i in which])
    return Mesh(whole.vertices, faces, whole.uv, whole.ids)


def rounded(width: float, depth: float, radius: float, per_corner: int = 3) -> Array:
    """Outline (n, 2) of a rectangle with round corners, centred, metres."""
    radius = min(radius, width / 2 - 1e-6, depth / 2 - 1e-6)
    corners = []
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        for a in np.linspace(0, np.pi / 2, per_corner):
            angle = a + k * np.pi / 2
            corners.append(
                (sx * (width / 2 - radius) + radius * np.cos(angle), sy * (depth / 2 - radius) + radius * np.sin(angle))
            )
    return np.array(corners)


def cushion(size: Sequence[float], radius: float = 0.3, edge: float = 0.25, per_corner: int = 3) -> Mesh:
    """A block with round corners and chamfered edges; bottom at z = 0. `radius`, `edge`: shares of its extents."""
    x, y, z = size
    outline = rounded(x, y, radius * min(x, y), per_corner)
    inset = edge * z
    small = np.column_stack([outline[:, 0] * (1 - 2 * inset / x), outline[:, 1] * (1 - 2 * inset / y)])
    return loft([small, outline, outline, small], [0.0, inset, z - inset, z])


def loft(outlines: Sequence[Points], heights: Sequence[float], *, smooth: bool = True) -> Mesh:
    """Outlines of the same number of points at heights z, joined by side faces and closed below and above."""
    rings = [np.asarray(o, float) for o in outlines]
    n = len(rings[0])
    table = np.concatenate([np.column_stack([r, np.full(n, h)]) for r, h in zip(rings, heights, strict=True)])
    close = np.concatenate([np.arange(n), [0]])
    count = n + 1
    vertices = np.concatenate([table[k * n : (k + 1) * n][close] for k in range(len(rings))])
    u = np.linspace(0, 1, count)
    span = max(heights[-1] - heights[0], 1e-9)
    uv = np.concatenate([np.column_stack([u, np.full(count, (h - heights[0]) / span)]) for h in heights])
    ids = np.concatenate([k * n + close for k in range(len(rings))])
    if not smooth:
        ids = np.arange(len(vertices))
    faces = []
    for k in range(len(rings) - 1):
        a = k * count + np.arange(n)
        faces += [np.column_stack([a, a + 1, a + count + 1]), np.column_stack([a, a + count + 1, a + count])]
    side = Mesh(vertices, np.concatenate(faces), uv, ids)
    lid, base = polygon(rings[-1]).moved(z=heights[-1]), polygon(rings[0])
    base = Mesh(base.vertices + np.array([0, 0, heights[0]]), base.faces[:, ::-1].copy(), base.uv, base.ids)
    return joined([side, lid, base])


def ball(
    size: float | Sequence[float] | Array, center: Sequence[float] | Array = (0, 0, 0), n: int = 12, m: int = 8
) -> Mesh:
    """An ellipsoid of full extents, poles along z."""
    extents = np.broadcast_to(np.asarray(size, float), 3)
    t = np.linspace(-np.pi / 2, np.pi / 2, m + 1)
    profile = np.column_stack([np.maximum(np.cos(t), 0.0), np.sin(t)])
    profile[[0, -1], 0] = 0.0
    return lathe(profile, n).scaled(*(extents / 2)).moved(*center)


def tube(path: Points, radius: float | Sequence[float] | Array, n: int = 8, *, flat: float = 1.0) -> Mesh:
    """A round bar along a path of points, with its radius (or radii, one per point), closed at both ends.

    `flat` below 1 squeezes the section along the direction nearest to z.
    """
    points = np.asarray(path, float)
    radii = np.broadcast_to(np.asarray(radius, float), len(points))
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    up = np.array([0.0, 0.0, 1.0]) if np.abs(tangent[:, 2]).mean() < 0.8 else np.array([0.0, 1.0, 0.0])
    side = np.cross(up, tangent)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    top = np.cross(tangent, side)
    angle = np.linspace(0, 2 * np.pi, n + 1)
    ring = np.cos(angle)[None, :, None] * side[:, None] + flat * np.sin(angle)[None, :, None] * top[:, None]
    vertices = points[:, None] + radii[:, None, None] * ring
    count, rows = n + 1, len(points)
    uv = np.stack(np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, rows)), axis=-1).reshape(-1, 2)
    ids = (np.arange(rows)[:, None] * n + np.arange(count)[None] % n).reshape(-1)
    faces = []
    for k in range(rows - 1):
        a = k * count + np.arange(n)
        faces += [np.column_stack([a, a + 1, a + count + 1]), np.column_stack([a, a + count + 1, a + count])]
    parts = [Mesh(vertices.reshape(-1, 3), np.concatenate(faces), uv, ids)]
    for end, row, flip in ((0, 0, True), (1, rows - 1, False)):
        if radii[row] < 1e-9:
            continue
        rim = np.concatenate([vertices[row, :n], points[row : row + 1]])
        fan = np.column_stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)])
        cap_uv = np.concatenate([0.5 + 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])[:n], [[0.5, 0.5]]])
        fan = fan[:, ::-1].copy() if flip else fan
        parts.append(Mesh(rim, fan, cap_uv * [1, 0] + [0, end], np.zeros(n + 1, int)))
    return joined(parts)


def sheet(outline: Points, thickness: float = 0.001) -> Mesh:
    """A thin leaf of an outline, both sides visible, in the plane z = 0."""
    upper = polygon(outline)
    lower = Mesh(upper.vertices - [0, 0, thickness], upper.faces[:, ::-1].copy(), upper.uv, upper.ids)
    return joined([upper, lower])


def arc(radius: float, start: float, stop: float, n: int, center: Sequence[float] = (0, 0)) -> Array:
    """Points (n, 2) of a circular arc between angles in radians."""
    angle = np.linspace(start, stop, n)
    return np.column_stack([np.cos(angle), np.sin(angle)]) * radius + np.asarray(center)


def lumpy(rng: np.random.Generator, mesh: Mesh, amount: float, waves: int = 3) -> Mesh:
    """Radial bumps about the mesh's centre, smooth and seeded; `amount` is their relative height."""
    directions = rng.normal(size=(waves, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    frequency, phase = rng.uniform(1.5, 4.0, waves), rng.uniform(0, 2 * np.pi, waves)
    center = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    half = np.maximum((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)) / 2, 1e-9)

    def bump(v: Array) -> Array:
        unit = (v - center) / half
        wave = np.sin(unit @ directions.T * frequency + phase).mean(axis=1, keepdims=True)
        return np.asarray(center + (v - center) * (1 + amount * wave))

    return mesh.mapped(bump)


def bent(mesh: Mesh, angle: float) -> Mesh:
    """A mesh that extends along x bent in the x, y plane, by `angle` radians over its whole length."""
    low, high = mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()
    radius = (high - low) / angle

    def bend(v: Array) -> Array:
        turn = (v[:, 0] - (low + high) / 2) / radius
        r = radius - v[:, 1]
        return np.column_stack([np.sin(turn) * r, radius - np.cos(turn) * r, v[:, 2]])

    return mesh.mapped(bend)
