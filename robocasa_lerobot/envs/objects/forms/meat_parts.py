"""What meat and dishes share."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import (
    Array,
    Mesh,
    arc,
    loft,
    polygon,
)
from robocasa_lerobot.envs.objects.paint import (
    Pattern,
    Rgb,
    bytes_of,
    canvas,
    mix,
    pixels,
)

FAT: Rgb = (0.93, 0.86, 0.78)
BONE: Rgb = (0.93, 0.90, 0.82)


def marbled(d: Draft, rgb: Rgb) -> Pattern:
    """Raw meat: veins of fat."""
    image, draw = canvas(rgb, 48, 48)
    rng = np.random.default_rng(d.seed)
    for _ in range(9):
        x, y = rng.uniform(4, 44, 2)
        for _ in range(3):
            dx, dy = rng.uniform(-9, 9, 2)
            draw.line((x, y, x + dx, y + dy), fill=bytes_of(mix(rgb, FAT, 0.75)), width=1)
            x, y = x + dx, y + dy
    return pixels(image)


def cut(outline: Array, z: float, *, edge: float = 0.2) -> Mesh:
    """A flat piece with soft edges."""
    middle = (outline.max(axis=0) + outline.min(axis=0)) / 2
    small = middle + (outline - middle) * 0.9
    return loft([small, outline, outline, small], [0, edge * z, (1 - edge) * z, z])


CHOP = np.array(
    [
        (-0.5, 0.1),
        (-0.42, -0.25),
        (-0.15, -0.45),
        (0.15, -0.4),
        (0.4, -0.48),
        (0.5, -0.2),
        (0.42, 0.05),
        (0.25, 0.2),
        (0.22, 0.42),
        (0.0, 0.5),
        (-0.3, 0.42),
    ]
)


def facing(ry: float, rz: float, x: float, z: float, n: int = 12) -> Mesh:
    """A disc that faces -x."""
    disc = polygon(arc(1.0, 0, 2 * np.pi, n + 1)[:-1]).turned("y", -np.pi / 2)
    return disc.scaled(1, ry, rz).moved(x, 0, z)


def upper_face(radius: float, x: float, y: float, z: float, n: int = 10) -> Mesh:
    return polygon(arc(radius, 0, 2 * np.pi, n + 1)[:-1]).moved(x, y, z)
