"""Pots, pans, trays, boards, baskets and sieves."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.vessel_parts import (
    BLACK,
    STEEL,
    WOOD,
    cover,
    hollow,
    vat,
)
from robocasa_lerobot.envs.objects.mesh import box, lathe, loft, polygon, prism, rounded, tube
from robocasa_lerobot.envs.objects.paint import (
    bands,
    bytes_of,
    canvas,
    gridded,
    mix,
    pixels,
    shade,
    stripes,
)


@form
def board(d: Draft) -> None:
    """Cutting board, with a hole to hang it by; placemat of cloth."""
    x, y, z = d.size
    if d.args.get("cloth"):
        d.add(box((x, y, z), (0, 0, z / 2)), shade(d.colour, 0.8))
        cloth = gridded(d.colour, shade(d.colour, 0.82), (12, 8), size=48, width=0.3)
        border = mix(d.colour, (1, 1, 1), 0.45)
        cloth[:4], cloth[-4:], cloth[:, :3], cloth[:, -3:] = (bytes_of(border),) * 4
        d.add(polygon([(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2)]).moved(z=1.01 * z), cloth)
        for k in range(9):
            for side in (-1, 1):
                d.add(box((0.03 * x, 0.05 * y, 0.5 * z), (side * 0.51 * x, (k - 4) * y / 9.5, 0.3 * z)), border)
        d.box((x, y, z), (0, 0, z / 2))
    else:
        outline = rounded(0.86 * x, y, 0.1 * y, 3)
        d.add(prism(outline, 0, z).moved(0.07 * x), d.colour, "satin")
        grain = stripes(d.colour, shade(d.colour, 0.84), 5, duty=0.35, wobble=0.1, seed=d.seed)
        d.add(polygon(outline).moved(0.07 * x, 0, 1.01 * z), np.rot90(grain).copy(), "satin")
        d.add(prism(rounded(0.24 * x, 0.24 * y, 0.06 * y, 3), 0, z).moved(-0.4 * x), d.colour, "satin")
        d.add(polygon(rounded(0.06 * x, 0.08 * y, 0.03 * y, 4)).moved(-0.45 * x, 0, 1.015 * z), BLACK)
        d.box((0.86 * x, y, z), (0.07 * x, 0, z / 2))
        d.box((0.16 * x, 0.24 * y, z), (-0.43 * x, 0, z / 2))
    d.holds((0.04 * x, 0, z + 0.03), (0.4 * x, 0.42 * y, 0.03))


@form
def tray(d: Draft) -> None:
    """Tray, oven tray, baking sheet: flat with a rim; handles where its record says so."""
    x, y, z = d.size
    wall = float(d.args.get("wall", 0.006))
    grips = bool(d.args.get("handles"))
    inner = 0.86 * x if grips else x
    paint = d.colour
    finish = d.args.get("finish", "satin")
    d.add(vat(inner, y, z if not grips else 0.8 * z, wall, 0.12 * y, taper=0.94), paint, finish)
    d.crate(inner * 0.98, y * 0.98, 0, z if not grips else 0.8 * z, wall)
    if grips:
        for side in (-1, 1):
            t = np.linspace(-1, 1, 7)
            path = np.column_stack(
                [side * (inner / 2 + (x - inner) / 2 * (1 - t**4)), t * 0.22 * y, np.full(7, 0.8 * z)]
            )
            d.add(tube(path, 0.1 * z + 0.002, 6), BLACK if finish != "metal" else STEEL, "satin")
            d.box(((x - inner) / 2, 0.4 * y, 0.2 * z), (side * (inner / 2 + (x - inner) / 4), 0, 0.8 * z))
    elif d.args.get("rolled", True):
        rim = rounded(x, y, 0.12 * y, 3)
        d.add(
            tube(np.column_stack([np.concatenate([rim, rim[:1]]), np.full(len(rim) + 1, 0.95 * z)]), 0.08 * z, 5),
            shade(paint, 0.85),
            finish,
        )
    d.inside = (np.array([0, 0, 0.03 + wall]), np.array([inner / 2 * 0.88, y / 2 * 0.88, 0.03]))


@form
def ice_cube_tray(d: Draft) -> None:
    x, y, z = d.size
    d.add(vat(x, y, z, 0.003, 0.004, taper=0.94), d.colour, "satin")
    columns = 6
    for i in range(columns):
        for j in range(2):
            where = ((i - (columns - 1) / 2) * x / columns * 0.97, (j - 0.5) * y * 0.47)
            d.add(box((x / columns * 0.72, y * 0.36, 0.04 * z), (*where, 0.86 * z)), (0.85, 0.94, 0.99), "satin")
    for i in range(columns - 1):
        d.add(
            box((0.02 * x, 0.92 * y, 0.9 * z), ((i - (columns - 2) / 2) * x / columns * 0.97, 0, 0.5 * z)),
            d.colour,
            "satin",
        )
    d.add(box((0.95 * x, 0.07 * y, 0.9 * z), (0, 0, 0.5 * z)), d.colour, "satin")
    d.box((x, y, 0.8 * z), (0, 0, 0.4 * z))
    d.crate(x, y, 0.5 * z, z, 0.003)


@form
def tupperware(d: Draft) -> None:
    """A food box: clear walls, a coloured rim, open."""
    x, y, z = d.size
    wall = 0.004
    d.add(vat(x, y, z, wall, 0.15 * y, taper=0.86), (0.9, 0.94, 0.96), "tinted")
    rim = rounded(x, y, 0.15 * y, 3)
    ring = np.column_stack([np.concatenate([rim, rim[:1]]), np.full(len(rim) + 1, 0.95 * z)])
    d.add(tube(ring, 0.006, 5), d.colour, "satin")
    for side in (-1, 1):
        d.add(box((0.02 * x, 0.3 * y, 0.1 * z), (side * 0.505 * x, 0, 0.9 * z)), d.colour, "satin")
    d.crate(x * 0.97, y * 0.97, 0, z, 0.006)


@form
def basket(d: Draft) -> None:
    x, y, z = d.size
    weave = gridded(d.colour, shade(d.colour, 0.6), (10, 8), size=48, width=0.24)
    outline = rounded(x, y, 0.3 * y, 4)
    shrink = 0.9
    rings = [outline * 0.8, outline * 0.97, outline * 0.97 * shrink, outline * 0.8 * shrink]
    d.add(loft(rings, [0, 0.92 * z, 0.92 * z, 0.05 * z], smooth=True), weave)
    d.add(
        tube(
            np.column_stack([np.concatenate([outline, outline[:1]]) * 0.95, np.full(len(outline) + 1, 0.93 * z)]),
            0.07 * z,
            6,
        ),
        stripes(d.colour, shade(d.colour, 0.6), 2, duty=0.5),
    )
    d.crate(x * 0.88, y * 0.88, 0, z, 0.05 * y)


@form
def pan(d: Draft) -> None:
    """Frying pan (low), saucepan (high): a long handle towards -x."""
    x, y, height = d.size
    steel = bool(d.args.get("steel"))
    r = y / 2
    shift = (x - y) / 2
    wall = float(d.args.get("wall", 0.005))
    flare = d.args.get("flare", 0.8)
    rgb = STEEL if steel else d.colour
    inner = mix(rgb, (0.5, 0.5, 0.5), 0.3) if steel else shade(d.colour, 0.55)
    body = hollow(
        [(0, 0), (flare * r, 0), ((flare + 0.07) * r, 0.1 * height), (0.97 * r, 0.95 * height), (r, height)], wall, 18
    )
    d.add(body.moved(shift), bands([rgb, inner], [0.5, 1.0]), "metal" if steel else "satin")
    length = x - y
    z0 = 0.72 * height
    rise = 0.12 * height if not steel else 0.0
    start = shift - r
    path = [
        (start + 0.01, 0, z0),
        (start - 0.25 * length, 0, z0 + rise),
        (start - 0.6 * length, 0, z0 + 1.4 * rise),
        (start - length, 0, z0 + rise),
    ]
    grip = 0.012
    d.add(
        tube(path, [0.7 * grip, 0.8 * grip, grip, 0.9 * grip], 8, flat=0.65),
        BLACK if not d.args.get("wood") else WOOD,
        "satin",
    )
    d.add(tube(path[:2], 0.85 * grip, 8, flat=0.65), STEEL, "metal")
    d.cup(flare * r, r, 0, height, wall, 10)
    d.solids = [s.moved((shift, 0, 0)) for s in d.solids]
    assert d.inside is not None
    d.inside = (d.inside[0] + [shift, 0, 0], d.inside[1])
    d.box((length, 1.9 * grip, 1.3 * grip), (start - length / 2, 0, z0 + rise))


@form
def saucepan_lid(d: Draft) -> None:
    """A lid that lies on the rim of its saucepan, with a knob to hold it by."""
    cover(d, d.size[0] / 2, d.size[2])


@form
def blender_lid(d: Draft) -> None:
    """A ribbed cap with a plug in its middle."""
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe(
            [(0, 0), (0.86 * r, 0), (0.86 * r, 0.3 * z), (r, 0.3 * z), (r, 0.66 * z), (0.9 * r, 0.7 * z), (0, 0.7 * z)],
            18,
        ),
        stripes(d.colour, shade(d.colour, 1.6), 18, duty=0.3),
        "satin",
    )
    d.add(lathe([(0.4 * r, 0.7 * z), (0.38 * r, 0.97 * z), (0.3 * r, z), (0, z)], 12), (0.8, 0.84, 0.87), "tinted")
    d.cylinder(0.86 * r, 0, 0.3 * z)
    d.cylinder(r, 0.3 * z, 0.68 * z)
    d.cylinder(0.4 * r, 0.68 * z, z)


@form
def pot(d: Draft) -> None:
    """A stock pot with two ears."""
    x, y, z = d.size
    r = y / 2
    wall = 0.006
    steel = bool(d.args.get("steel", d.seed % 2))
    rgb = STEEL if steel else d.colour
    d.add(
        hollow([(0, 0), (0.9 * r, 0), (0.97 * r, 0.07 * z), (0.98 * r, 0.94 * z), (r, 0.96 * z), (r, z)], wall, 18),
        bands([rgb, mix(rgb, (0.4, 0.4, 0.42), 0.4)], [0.5, 1.0]),
        "metal" if steel else "gloss",
    )
    d.cup(0.93 * r, r, 0, z, wall, 10)
    reach = (x - y) / 2
    for side in (-1, 1):
        t = np.linspace(-1, 1, 7)
        path = np.column_stack([side * (0.97 * r + (reach + 0.02 * r) * (1 - t**4)), t * 0.3 * r, np.full(7, 0.8 * z)])
        d.add(tube(path, 0.008, 6), BLACK if steel else rgb, "satin")
        d.box((0.016, 0.55 * r, 0.016), (side * (r + reach - 0.008), 0, 0.8 * z))
        for end in (-1, 1):
            d.box((reach, 0.016, 0.016), (side * (r + reach / 2), end * 0.27 * r, 0.8 * z))


@form
def colander(d: Draft) -> None:
    """A bowl with holes and two ears; strainer: of wire, with a long handle."""
    x, y, z = d.size
    strainer = bool(d.args.get("strainer"))
    r = y / 2
    shift = (x - y) / 2 if strainer else 0.0
    wall = 0.004
    image, draw = canvas(d.colour if not strainer else STEEL, 64, 32)
    if strainer:
        mesh_paint = gridded(STEEL, (0.45, 0.46, 0.48), (16, 16), size=64, width=0.4)
    else:
        for i in range(0, 64, 8):
            for j in range(3, 32, 6):
                u = i + 4 * ((j // 6) % 2)
                draw.ellipse((u, j, u + 3, j + 3), fill=(30, 30, 32))
        mesh_paint = pixels(image)
    foot = 0.5 if not strainer else 0.3
    body = hollow([(0, 0), (foot * r, 0), (0.8 * r, 0.42 * z), (0.97 * r, 0.85 * z), (r, z)], wall, 18)
    d.add(body.moved(shift), mesh_paint, "metal" if strainer or d.seed % 2 else "satin")
    d.add(
        lathe([(0.97 * r, 0.96 * z), (1.03 * r, 0.98 * z), (0.97 * r, z)], 18).moved(shift),
        STEEL if strainer else shade(d.colour, 0.8),
        "metal",
    )
    d.cup(0.62 * r, r, 0, z, 0.006, 10)
    d.solids = [s.moved((shift, 0, 0)) for s in d.solids]
    assert d.inside is not None
    d.inside = (d.inside[0] + [shift, 0, 0], d.inside[1])
    if strainer:
        start, length = shift - r, x - y
        d.add(tube([(start, 0, 0.96 * z), (start - 0.35 * length, 0, 0.96 * z)], 0.004, 6), STEEL, "metal")
        d.add(
            tube([(start - 0.3 * length, 0, 0.95 * z), (start - length, 0, 0.95 * z)], [0.008, 0.011], 8),
            d.colour,
            "satin",
        )
        d.box((length, 0.016, 0.016), (start - length / 2, 0, 0.96 * z - 0.003))
        d.box((0.03, 0.05, 0.006), (shift + r + 0.01, 0, 0.97 * z))
        d.add(box((0.03, 0.05, 0.004), (shift + r + 0.01, 0, 0.97 * z)), STEEL, "metal")
    else:
        reach = (x - y) / 2
        for side in (-1, 1):
            t = np.linspace(-1, 1, 7)
            path = np.column_stack([side * (0.98 * r + reach * (1 - t**4)), t * 0.35 * r, np.full(7, 0.95 * z)])
            d.add(tube(path, 0.006, 6), shade(d.colour, 0.8), "satin")
            d.box((0.012, 0.6 * r, 0.012), (side * (r + reach - 0.006), 0, 0.95 * z))
            d.box((reach, 0.012, 0.012), (side * (r + reach / 2), 0.3 * r, 0.95 * z))
            d.box((reach, 0.012, 0.012), (side * (r + reach / 2), -0.3 * r, 0.95 * z))
