"""What bread, cakes and sweets share."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    arc,
    lathe,
    polygon,
)
from robocasa_lerobot.envs.objects.paint import (
    Pattern,
    Rgb,
    gradient,
    mix,
    shade,
)

CRUMB: Rgb = (0.96, 0.88, 0.70)


COLOURS: tuple[Rgb, ...] = (
    (0.85, 0.2, 0.25),
    (0.95, 0.8, 0.2),
    (0.3, 0.6, 0.85),
    (0.45, 0.75, 0.35),
    (0.95, 0.95, 0.95),
)


def crust(d: Draft) -> Pattern:
    """Baked: darker on top."""
    return gradient([mix(d.colour, CRUMB, 0.35), d.colour, shade(d.colour, 0.8)], None, 16)


def disc(radius: float, x: float = 0.0, y: float = 0.0, z: float = 0.0, n: int = 14) -> Mesh:
    """A flat round face upwards."""
    return polygon(arc(radius, 0, 2 * np.pi, n + 1)[:-1]).moved(x, y, z)


def ring(radius: float, thickness: float, z: float, *, start: float = -np.pi, stop: float = np.pi, n: int = 16) -> Mesh:
    """A torus, or its part between two angles of the section (0 outwards, pi / 2 up)."""
    a = np.linspace(start, stop, 9)
    profile = np.column_stack([radius + np.cos(a) * thickness / 2, z + np.sin(a) * thickness / 2])
    return lathe(profile, n)


COOKIE_CHIPS = 9
