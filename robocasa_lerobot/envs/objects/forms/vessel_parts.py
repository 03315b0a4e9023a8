"""What vessels share: hollow turned bodies, handles, glaze."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import Mesh, Points, lathe, loft, rounded, tube
from robocasa_lerobot.envs.objects.paint import (
    Pattern,
    Rgb,
    bands,
    mix,
    speckled,
)

STEEL: Rgb = (0.76, 0.77, 0.79)


BLACK: Rgb = (0.10, 0.10, 0.11)


WOOD: Rgb = (0.66, 0.47, 0.28)


def hollow(outer: Points, thickness: float, n: int = 16) -> Mesh:
    """A turned vessel: an outer profile from the middle of its foot up to its rim, and back down inside."""
    points = np.asarray(outer, float)
    inner = np.column_stack([np.maximum(points[:, 0] - thickness, 0.0), np.maximum(points[:, 1], thickness)])[::-1]
    inner[0] = [points[-1, 0] - thickness, points[-1, 1]]
    return lathe(np.concatenate([points, inner]), n)


def loop(x0: float, z0: float, z1: float, reach: float, radius: float, *, flat: float = 1.0) -> Mesh:
    """A handle from (x0, z0) to (x0, z1) that stands off by `reach` along +x."""
    t = np.linspace(0, np.pi, 8)
    path = np.column_stack([x0 + reach * np.sin(t) ** 0.7, np.zeros(8), z0 + (z1 - z0) * (0.5 - 0.5 * np.cos(t))])
    return tube(path, radius, 7, flat=flat)


def loop_solids(d: Draft, x0: float, z0: float, z1: float, reach: float, radius: float) -> None:
    """Its collision: two arms and an upright."""
    w = 2 * radius
    d.box((w, w, z1 - z0), (x0 + reach - radius * 0.3, 0, (z0 + z1) / 2))
    for z in (z0, z1):
        d.box((reach, w, w), (x0 + reach / 2, 0, z))


def glaze(d: Draft, *, inside: Rgb | None = None) -> Pattern:
    """Decoration of crockery, from the foot up the outside and down inside."""
    kind = d.seed % 4
    accent = mix(d.colour, (1, 1, 1) if sum(d.colour) < 1.6 else (0.2, 0.3, 0.55), 0.65)
    inner = inside or mix(d.colour, (1, 1, 1), 0.7)
    if kind == 0:
        return bands([d.colour, inner], [0.52, 1.0])
    if kind == 1:
        return bands([d.colour, accent, d.colour, inner], [0.36, 0.42, 0.52, 1.0], 48)
    if kind == 2:
        return bands([accent, d.colour, inner], [0.26, 0.52, 1.0])
    return speckled(d.colour, accent, 0.12, d.seed)


def vat(width: float, depth: float, z: float, wall: float, radius: float, *, taper: float = 0.9) -> Mesh:
    """A rectangular vessel with round corners, hollow."""
    foot, top = rounded(width * taper, depth * taper, radius, 3), rounded(width, depth, radius, 3)
    shrink = np.array([1 - 2 * wall / width, 1 - 2 * wall / depth])
    rings = [foot, top, top * shrink, foot * shrink]
    mesh = loft(rings, [0, z, z, min(wall, 0.5 * z)], smooth=False)
    # The lid of the loft is the floor inside, the base its foot.
    return mesh


def cover(d: Draft, r: float, z: float) -> None:
    """A round lid, flat below, and so high a knob that fingers close on it without touching the rest."""
    knob_r = min(0.016, 0.25 * r)
    dome = lathe([(0, 0), (r, 0), (r, 0.1 * z), (0.6 * r, 0.3 * z), (0, 0.36 * z)], 18)
    d.add(dome, (0.82, 0.86, 0.88) if not d.args.get("steel") else STEEL, "metal")
    stem, top = 0.7 * knob_r, 0.66 * z
    knob = [(stem, 0.34 * z), (stem, 0.5 * z), (knob_r, top), (knob_r, 0.96 * z), (0, z)]
    d.add(lathe(knob, 10), BLACK, "satin")
    d.cylinder(r, 0, 0.16 * z)
    d.cylinder(0.55 * r, 0.16 * z, 0.34 * z)
    d.cylinder(knob_r, 0.34 * z, z)
