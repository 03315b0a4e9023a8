"""Small kitchen tools and cleaning utensils."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.tool_parts import BLACK, STEEL, WHITE, grip
from robocasa_lerobot.envs.objects.mesh import (
    Array,
    box,
    cushion,
    lathe,
    loft,
    polygon,
    prism,
    rounded,
    tube,
)
from robocasa_lerobot.envs.objects.paint import Rgb, canvas, gridded, label, pixels, shade, write


@form
def grater(d: Draft) -> None:
    """A box grater: a tapered steel tower with holes and a handle."""
    x, y, z = d.size
    image, draw = canvas(STEEL, 48, 48)
    for i in range(4, 44, 7):
        for j in range(4, 44, 7):
            draw.ellipse((i, j, i + 3, j + 4), fill=(60, 60, 64))
            draw.arc((i - 1, j - 1, i + 4, j + 5), 180, 360, fill=(235, 235, 238))
    body = 0.84 * z
    d.add(box((x, y, body), (0, 0, body / 2), taper=0.68), pixels(image), "metal")
    for h in (0.02, 0.95):
        w = 1.02 - 0.32 * h
        d.add(box((w * x, w * y, 0.05 * z), (0, 0, h * body + 0.01 * z)), d.colour, "satin")
    d.add(box((0.6 * x, 0.3 * y, 0.05 * z), (0, 0, 0.975 * z)), d.colour, "satin")
    for side in (-1, 1):
        d.add(box((0.08 * x, 0.3 * y, 0.16 * z), (side * 0.28 * x, 0, 0.9 * z)), d.colour, "satin")
    d.hull(box((x, y, body), (0, 0, body / 2), taper=0.68))
    d.box((0.64 * x, 0.3 * y, 0.16 * z), (0, 0, 0.92 * z))


@form
def opener(d: Draft) -> None:
    """A bottle opener: a flat handle and a ring with a tooth."""
    x, y, z = d.size
    grip(d, -0.5 * x, 0.18 * x, 0.6 * y, z, d.colour)
    t = np.linspace(0, 2 * np.pi, 15)
    ring = np.column_stack([0.33 * x + np.cos(t) * 0.135 * x, np.sin(t) * 0.4 * y, np.full(15, 0.4 * z)])
    d.add(tube(ring, 0.28 * z, 6), STEEL, "metal")
    d.add(box((0.1 * x, 0.24 * y, 0.4 * z), (0.24 * x, 0, 0.4 * z)), STEEL, "metal")
    d.box((0.32 * x, y, 0.7 * z), (0.34 * x, 0, 0.35 * z))


@form
def can_opener(d: Draft) -> None:
    """Two handles, a wheel and a turning key."""
    x, y, z = d.size
    for side in (-1, 1):
        mesh = cushion((0.66 * x, 0.2 * y, 0.55 * z), 0.4, 0.3, 3).turned("z", side * 0.1)
        d.add(mesh.moved(-0.17 * x, side * 0.2 * y, 0), d.colour, "satin")
    d.add(box((0.34 * x, 0.5 * y, 0.35 * z), (0.27 * x, 0, 0.35 * z)), STEEL, "metal")
    d.add(
        lathe([(0.26 * y, 0.5 * z), (0.3 * y, 0.56 * z), (0.26 * y, 0.62 * z), (0, 0.62 * z)], 12).moved(
            0.3 * x, 0.05 * y
        ),
        shade(STEEL, 0.8),
        "metal",
    )
    d.add(lathe([(0.05 * y, 0.6 * z), (0.05 * y, 0.8 * z), (0, 0.8 * z)], 6).moved(0.3 * x, 0.05 * y), STEEL, "metal")
    d.add(
        cushion((0.26 * x, 0.16 * y, 0.2 * z), 0.4, 0.3, 3).turned("z", 0.7).moved(0.3 * x, 0.05 * y, 0.8 * z),
        d.colour,
        "satin",
    )
    d.box((0.7 * x, 0.8 * y, 0.55 * z), (-0.15 * x, 0, 0.275 * z))
    d.box((0.34 * x, 0.6 * y, 0.95 * z), (0.3 * x, 0.02 * y, 0.475 * z))


@form
def pizza_cutter(d: Draft) -> None:
    """A wheel in a fork on a handle; lies on its side."""
    x, y, z = d.size
    r = y / 2
    d.add(
        lathe([(0, 0.35 * z), (0.8 * r, 0.35 * z), (r, 0.45 * z), (0.8 * r, 0.55 * z), (0, 0.55 * z)], 18).moved(
            x / 2 - r
        ),
        STEEL,
        "metal",
    )
    d.add(lathe([(0.16 * r, 0.5 * z), (0.16 * r, 0.7 * z), (0, 0.7 * z)], 8).moved(x / 2 - r), BLACK)
    d.add(box((0.7 * r, 0.22 * r, 0.16 * z), (x / 2 - 1.35 * r, 0, 0.66 * z)), STEEL, "metal")
    grip(d, -0.5 * x, x / 2 - 1.7 * r, min(0.5 * y, 0.028), z, d.colour)
    d.cylinder(r, 0.3 * z, 0.6 * z, x / 2 - r)
    d.cylinder(0.2 * r, 0, 0.7 * z, x / 2 - r)


@form
def reamer(d: Draft) -> None:
    """A juicer: a ribbed cone in a dish."""
    x, y, z = d.size
    r = y / 2
    shift = (x - y) / 2
    dish = lathe(
        [
            (0, 0),
            (0.8 * r, 0),
            (0.97 * r, 0.38 * z),
            (r, 0.42 * z),
            (0.93 * r, 0.4 * z),
            (0.78 * r, 0.12 * z),
            (0, 0.12 * z),
        ],
        18,
    )
    d.add(dish.moved(shift), d.colour, "gloss")
    cone = lathe([(0.46 * r, 0.1 * z), (0.42 * r, 0.35 * z), (0.26 * r, 0.75 * z), (0.06 * r, 0.98 * z), (0, z)], 20)

    def rib(v: Array) -> Array:
        angle = np.arctan2(v[:, 1], v[:, 0])
        k = 1 + 0.12 * np.cos(10 * angle)
        return np.column_stack([v[:, 0] * k, v[:, 1] * k, v[:, 2]])

    d.add(cone.mapped(rib).moved(shift), shade(d.colour, 1.08), "gloss")
    d.add(cushion((x - y + 0.1 * r, 0.5 * r, 0.14 * z), 0.4, 0.3, 3).moved(-y / 2, 0, 0.3 * z), d.colour, "gloss")
    d.cup(0.82 * r, r, 0, 0.42 * z, 0.08 * r, 8)
    d.hull(cone)
    d.solids = [s.moved((shift, 0, 0)) for s in d.solids]
    d.inside = None
    d.box((x - y, 0.5 * r, 0.14 * z), (-y / 2 + 0.0, 0, 0.37 * z))


@form
def scale(d: Draft) -> None:
    """A flat kitchen scale with a display."""
    x, y, z = d.size
    d.add(cushion((x, y, 0.6 * z), 0.12, 0.2, 3), d.colour, "satin")
    d.add(lathe([(0, 0.6 * z), (0.36 * y, 0.6 * z), (0.36 * y, z), (0, z)], 18).moved(0, 0.1 * y), STEEL, "metal")
    image, draw = canvas((0.62, 0.72, 0.6), 32, 16)
    write(image, "0.0 g", (0.08, 0.1, 0.08), (0.08, 0.1, 0.95, 0.95))
    draw.rectangle((0, 0, 31, 15), outline=(20, 20, 20))
    d.add(
        polygon([(-0.2 * x, -0.45 * y), (0.1 * x, -0.45 * y), (0.1 * x, -0.3 * y), (-0.2 * x, -0.3 * y)]).moved(
            z=0.61 * z
        ),
        pixels(image),
        "gloss",
    )
    for k in range(2):
        d.add(
            lathe([(0.05 * y, 0.6 * z), (0.05 * y, 0.66 * z), (0, 0.66 * z)], 8).moved(
                (0.22 + 0.12 * k) * x, -0.375 * y
            ),
            (0.8, 0.25, 0.2) if k else shade(d.colour, 0.6),
        )
    d.box((x, y, 0.6 * z), (0, 0, 0.3 * z))
    d.cylinder(0.36 * y, 0.6 * z, z, 0, 0.1 * y)
    d.holds((0, 0.1 * y, z + 0.03), (0.25 * y, 0.25 * y, 0.03))


@form
def peeler(d: Draft) -> None:
    """A Y peeler: a handle, two arms and a blade across."""
    x, y, z = d.size
    grip(d, -0.5 * x, 0.14 * x, 0.42 * y, z, d.colour)
    for side in (-1, 1):
        path = [
            (0.1 * x, side * 0.12 * y, 0.5 * z),
            (0.28 * x, side * 0.42 * y, 0.5 * z),
            (0.5 * x, side * 0.46 * y, 0.5 * z),
        ]
        d.add(tube(path, 0.3 * z, 6), d.colour, "satin")
    d.add(box((0.09 * x, 0.92 * y, 0.25 * z), (0.43 * x, 0, 0.5 * z)), STEEL, "metal")
    d.box((0.28 * x, y, 0.8 * z), (0.36 * x, 0, 0.4 * z))


@form
def dish_brush(d: Draft) -> None:
    x, y, z = d.size
    grip(d, -0.5 * x, 0.3 * x, min(0.022, 0.5 * y), 0.3 * z, d.colour, 0.62 * z)
    head = lathe([(0, 0.6 * z), (y / 2, 0.6 * z), (y / 2, 0.85 * z), (0.3 * y, z), (0, z)], 14)
    d.add(head.moved(x / 2 - y / 2), d.colour, "satin")
    for k in range(19):
        a, r = 2.4 * k, 0.42 * y * np.sqrt((k + 0.5) / 19)
        bristle = lathe([(0, 0), (0.1 * y, 0), (0.075 * y, 0.62 * z), (0, 0.62 * z)], 5)
        tone: Rgb = (0.25, 0.45, 0.75) if sum(d.colour) > 2.2 else WHITE
        d.add(bristle.moved(x / 2 - y / 2 + r * np.cos(a), r * np.sin(a)), tone if k % 2 else shade(tone, 0.85))
    d.cylinder(y / 2, 0, z, x / 2 - y / 2)
    # A prop under the handle's end, so that it lies as it is drawn.
    d.box((0.012, 0.05, 0.62 * z), (-0.48 * x, 0, 0.31 * z))


@form
def soap_dispenser(d: Draft) -> None:
    """A bottle with a pump."""
    x, y, z = d.size
    r = y / 2
    shift = -(x - y) / 2 if x > y else 0.0
    d.add(
        lathe(
            [
                (0, 0),
                (0.94 * r, 0),
                (r, 0.03 * z),
                (r, 0.55 * z),
                (0.8 * r, 0.64 * z),
                (0.4 * r, 0.68 * z),
                (0, 0.68 * z),
            ],
            14,
        ).moved(shift),
        d.colour,
        "gloss" if d.seed % 2 else "tinted",
    )
    d.add(
        lathe([(1.01 * r, 0.18 * z), (1.01 * r, 0.44 * z)], 14).moved(shift),
        label(WHITE, shade(d.colour, 0.5), "SOAP", d.seed, around=2),
    )
    d.add(
        lathe(
            [
                (0.42 * r, 0.67 * z),
                (0.42 * r, 0.74 * z),
                (0.14 * r, 0.76 * z),
                (0.14 * r, 0.9 * z),
                (0.3 * r, 0.91 * z),
                (0.3 * r, 0.98 * z),
                (0, z),
            ],
            10,
        ).moved(shift),
        WHITE,
        "satin",
    )
    tip = x / 2
    d.add(
        tube([(shift, 0, 0.95 * z), (0.7 * tip, 0, 0.95 * z), (tip, 0, 0.91 * z)], [0.14 * r, 0.13 * r, 0.11 * r], 7),
        WHITE,
        "satin",
    )
    d.cylinder(r, 0, 0.6 * z, shift)
    d.cylinder(0.42 * r, 0.6 * z, 0.76 * z, shift)
    d.cylinder(0.2 * r, 0.76 * z, z, shift)
    d.box((tip - shift, 0.26 * r, 0.07 * z), ((tip + shift) / 2, 0, 0.945 * z))


@form
def spray(d: Draft) -> None:
    """A cleaner with a trigger head."""
    x, y, z = d.size
    shift = -(x - y) / 2
    d.add(
        loft(
            [
                rounded(0.9 * y, 0.9 * y, 0.3 * y, 3),
                rounded(y, y, 0.3 * y, 3),
                rounded(y, y, 0.3 * y, 3),
                rounded(0.4 * y, 0.4 * y, 0.19 * y, 3),
                rounded(0.36 * y, 0.36 * y, 0.17 * y, 3),
            ],
            [0, 0.02 * z, 0.5 * z, 0.68 * z, 0.76 * z],
        ).moved(shift),
        d.colour,
        "satin",
    )
    band = loft([rounded(1.02 * y, 1.02 * y, 0.3 * y, 3)] * 2, [0.14 * z, 0.42 * z])
    d.add(band.moved(shift), label(WHITE, shade(d.colour, 0.5), "CLEAN", d.seed, around=2))
    head = prism(
        np.array(
            [
                (-0.5 * y, 0.86 * z),
                (-0.5 * y, 0.99 * z),
                (0.6 * y, 1.0 * z),
                (0.72 * y, 0.95 * z),
                (0.72 * y, 0.88 * z),
                (0.3 * y, 0.84 * z),
                (0.22 * y, 0.76 * z),
                (-0.22 * y, 0.76 * z),
            ]
        ),
        -0.16 * y,
        0.16 * y,
    )
    white: Rgb = (0.93, 0.93, 0.93) if d.seed % 2 else (0.85, 0.25, 0.2)
    d.add(head.turned("x", np.pi / 2).moved(shift), white, "satin")
    d.add(
        tube(
            [(shift + 0.4 * y, 0, 0.86 * z), (shift + 0.46 * y, 0, 0.78 * z), (shift + 0.62 * y, 0, 0.7 * z)],
            [0.1 * y, 0.08 * y, 0.06 * y],
            6,
        ),
        (0.15, 0.15, 0.16),
        "satin",
    )
    d.box((0.97 * y, 0.97 * y, 0.52 * z), (shift, 0, 0.26 * z))
    d.box((0.42 * y, 0.42 * y, 0.26 * z), (shift, 0, 0.64 * z))
    d.box((1.2 * y, 0.32 * y, 0.14 * z), (shift + 0.11 * y, 0, 0.92 * z))
    d.box((0.1 * y, 0.12 * y, 0.14 * z), (x / 2 - 0.08 * y, 0, 0.8 * z))


@form
def oven_mitt(d: Draft) -> None:
    """A quilted mitten, lying."""
    x, y, z = d.size
    outline = np.array(
        [
            (-0.5, -0.34),
            (0.1, -0.36),
            (0.4, -0.3),
            (0.5, -0.1),
            (0.46, 0.1),
            (0.2, 0.16),
            (0.26, 0.42),
            (0.12, 0.5),
            (0.0, 0.4),
            (-0.12, 0.16),
            (-0.5, 0.2),
        ]
    ) * [x, y]
    d.add(
        loft([outline * 0.94, outline, outline * 0.94], [0, 0.5 * z, z]),
        gridded(d.colour, shade(d.colour, 0.8), (6, 6), size=48, width=0.14),
    )
    d.box((x, 0.52 * y, 0.95 * z), (0, -0.1 * y, 0.48 * z))
