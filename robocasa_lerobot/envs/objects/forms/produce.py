"""What fruit and vegetables share: profiles, stems, leaves, and how they stand or lie."""

from __future__ import annotations

import itertools

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import (
    Array,
    Mesh,
    Points,
    bent,
    joined,
    lathe,
    lumpy,
    sheet,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Paint,
    Rgb,
    bytes_of,
    canvas,
    mix,
    pixels,
    shade,
    speckled,
)

STEM: Rgb = (0.34, 0.24, 0.12)


LEAF: Rgb = (0.24, 0.46, 0.16)


DARK_LEAF: Rgb = (0.13, 0.34, 0.12)


ROUND = [(0, 0), (0.28, 0.04), (0.43, 0.2), (0.5, 0.47), (0.45, 0.76), (0.29, 0.95), (0, 1)]


DIMPLED = [
    (0, 0.06),
    (0.16, 0.01),
    (0.32, 0.05),
    (0.45, 0.26),
    (0.5, 0.55),
    (0.46, 0.8),
    (0.33, 0.97),
    (0.16, 0.99),
    (0, 0.88),
]


def leaf(length: float, width: float, *, lift: float = 0.35) -> Mesh:
    """A leaf from the origin along x, its tip bent upwards."""
    outline = [(0, -0.05), (0.3, -0.42), (0.65, -0.42), (1, 0), (0.65, 0.42), (0.3, 0.42), (0, 0.05)]
    points = np.asarray(outline) * [length, width]
    return sheet(points, 0.0012).mapped(
        lambda v: np.column_stack([v[:, 0], v[:, 1], v[:, 2] + lift * v[:, 0] ** 2 / length])
    )


def rosette(count: int, length: float, width: float, *, lift: float, phase: float = 0.0) -> Mesh:
    """Leaves around the z axis."""
    return joined([leaf(length, width, lift=lift).turned("z", phase + 2 * np.pi * k / count) for k in range(count)])


def stem(height: float, radius: float, z: float, *, lean: float = 0.25) -> Mesh:
    """A short stalk on top."""
    return tube([(0, 0, z), (0.3 * lean * height, 0, z + 0.6 * height), (lean * height, 0, z + height)], radius, 6)


def ribbed(mesh: Mesh, count: int, amount: float) -> Mesh:
    """Lobes around the z axis (bell pepper, garlic, pumpkin)."""

    def lobes(v: Array) -> Array:
        angle = np.arctan2(v[:, 1], v[:, 0])
        factor = 1 + amount * np.cos(count * angle)
        return np.column_stack([v[:, 0] * factor, v[:, 1] * factor, v[:, 2]])

    return mesh.mapped(lobes)


def standing(
    d: Draft, profile: Points, paint: Paint | None = None, finish: str = "satin", *, flat: float = 0.04, n: int = 14
) -> Mesh:
    """The main body of something round that stands: turned, pressed flat below, its hull collides."""
    x, y, z = d.size
    d.rolls = True
    return d.body(lathe(profile, n).fitted((x, y, z)).flattened(flat), paint, finish)


def lying(
    d: Draft,
    profile: Points,
    paint: Paint | None = None,
    finish: str = "satin",
    *,
    bend: float = 0.0,
    flat: float = 0.06,
    n: int = 10,
    lumps: float = 0.0,
) -> Mesh:
    """The main body of something long that lies along x: turned, laid down, bent sideways."""
    x, y, z = d.size
    mesh = lathe(dense(profile) if bend else profile, n).turned("y", np.pi / 2)
    if lumps:
        mesh = lumpy(d.rng, mesh, lumps)
    mesh = mesh.fitted((x, y, z))
    if bend:
        mesh = bent(mesh, bend)
    d.rolls = True
    mesh = mesh.flattened(flat)
    if abs(bend) < 0.5:
        return d.body(mesh, paint, finish)
    low, high = mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()
    for k in range(3):  # a bent object is three convex pieces
        a, b = low + (high - low) * (k / 3 - 0.03), low + (high - low) * ((k + 1) / 3 + 0.03)
        d.hull(mesh.vertices[(mesh.vertices[:, 0] >= a) & (mesh.vertices[:, 0] <= b)])
    return d.add(mesh, paint, finish)


def dense(profile: Points) -> Array:
    """The profile with points added, so that it can be bent."""
    points = np.asarray(profile, float)
    out = [points[0]]
    for a, b in itertools.pairwise(points):
        steps = max(1, round(abs(b[1] - a[1]) / 0.13))
        out += [a + (b - a) * k / steps for k in range(1, steps + 1)]
    return np.array(out)


def blush(d: Draft, other: Rgb) -> Paint:
    """The main colour with patches of another."""
    return speckled(d.colour, mix(d.colour, other, 0.22), 0.35, d.seed, blur=True)


def leaf_veins(rgb: Rgb, vein: Rgb) -> Paint:
    """A leaf: a midrib and side veins, a darker rim."""
    image, draw = canvas(rgb, 32, 32)
    draw.rectangle((0, 0, 31, 31), outline=bytes_of(shade(rgb, 1.2)))
    draw.line((16, 31, 16, 5), fill=bytes_of(vein), width=2)
    for k in range(4):
        for side in (-1, 1):
            draw.line((16, 28 - 7 * k, 16 + side * 13, 19 - 7 * k), fill=bytes_of(mix(rgb, vein, 0.45)))
    return pixels(image)


def leaf_cap(radius: float, z: float, span: float, width: float, *, ruffle: float, phase: float) -> Mesh:
    """A leaf that hugs a ball, from its foot up to a share of its height, its rim turned outwards."""
    v = np.linspace(0, 1, 5)[:, None]
    u = np.linspace(-1, 1, 6)[None, :]
    around = width * np.sin(np.pi * (0.16 + 0.66 * v)) * u
    tilt = np.pi * (-0.42 + 0.8 * span * v)
    edge = np.maximum(np.abs(u) ** 3, v**4)
    r = radius * (1.02 + (0.08 + 0.16 * ruffle) * edge) * (1 + 0.05 * ruffle * np.sin(7 * u + phase) * v)
    x = r * np.cos(tilt) * np.cos(around)
    y = r * np.cos(tilt) * np.sin(around)
    height = z / 2 + z / 2 * np.sin(tilt) + 0.04 * ruffle * z * np.sin(9 * u + phase) * v
    points = np.stack([x, y, np.maximum(height, 0.0)], axis=-1).reshape(-1, 3)
    uv = np.stack(np.broadcast_arrays(0.5 + 0.5 * u, v), axis=-1).reshape(-1, 2)
    corner = (np.arange(4)[:, None] * 6 + np.arange(5)[None]).reshape(-1)
    faces = np.concatenate(
        [np.column_stack([corner, corner + 1, corner + 7]), np.column_stack([corner, corner + 7, corner + 6])]
    )
    front = Mesh(points, faces, uv, np.arange(30))
    back = Mesh(points * [0.985, 0.985, 1], faces[:, ::-1].copy(), uv, np.arange(30))
    return joined([front, back])
