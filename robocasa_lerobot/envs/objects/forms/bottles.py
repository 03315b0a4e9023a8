"""Bottles, jars and shakers."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.labels import (
    BOTTLES,
    INK,
    STEEL,
    WHITE,
    around,
    name_on,
    shoulder,
)
from robocasa_lerobot.envs.objects.mesh import (
    Points,
    ball,
    box,
    lathe,
    loft,
    polygon,
    rounded,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    label,
    mix,
    shade,
    speckled,
    stripes,
)


@form
def bottle(d: Draft) -> None:
    """A bottle of a kind of BOTTLES with cap and label."""
    x, _, z = d.size
    r = x / 2
    profile = BOTTLES[d.args.get("profile", "straight")]
    cap_share = d.args.get("cap_height", 0.07)
    top = z * (1 - cap_share)
    points = [(p * r, q * top) for p, q in profile]
    finish = d.args.get("finish", "satin")
    clear = finish == "glass"
    liquid = d.args.get("liquid")
    n = 14
    d.add(lathe(points, n), (0.86, 0.92, 0.94) if clear else d.colour, "clear" if clear else finish)
    if clear:
        fill = float(d.args.get("fill", 0.75))
        rgb: Rgb = d.colour if liquid is None else tuple(liquid)
        # The liquid follows the glass a little inside it.
        inner = [(max(p - 0.06, 0) * r, max(q, 0.02) * top) for p, q in profile if q <= fill]
        edge = np.interp(fill, [q for _, q in profile], [p for p, _ in profile]) - 0.06
        d.add(lathe([*inner, (edge * r, fill * top), (0, fill * top)], n), rgb, "tinted")
    neck = points[-2][0]
    cap: Rgb = tuple(d.args.get("cap", (0.9, 0.9, 0.9)))
    kind = d.args.get("cap_kind", "screw")
    if kind == "screw":
        d.add(
            lathe([(neck * 1.18, top * 0.985), (neck * 1.18, z), (0, z)], 10),
            stripes(cap, shade(cap, 0.8), 10),
            "satin",
        )
    elif kind == "crown":
        d.add(lathe([(neck * 1.1, top * 0.985), (neck * 1.2, top), (neck * 1.0, z), (0, z)], 12), cap, "metal")
    elif kind == "foil":
        d.add(lathe([(neck * 1.08, top * 0.84), (neck * 1.1, z * 0.99), (0, z)], 10), cap, "satin")
    elif kind == "nozzle":
        d.add(
            lathe(
                [
                    (r * 0.62, top * 0.97),
                    (r * 0.62, top * 1.005),
                    (r * 0.24, top + 0.3 * (z - top)),
                    (r * 0.12, z),
                    (0, z),
                ],
                10,
            ),
            cap,
            "satin",
        )
    elif kind == "flip":
        d.add(lathe([(r * 0.66, top * 0.97), (r * 0.62, z * 0.99), (0, z)], 12), cap, "satin")
    elif kind == "cork":
        d.add(lathe([(neck * 0.8, top), (neck * 0.95, z), (0, z)], 9), (0.72, 0.54, 0.34))
    elif kind == "pourer":
        d.add(
            lathe(
                [
                    (neck * 1.15, top * 0.98),
                    (neck * 1.1, top + 0.35 * (z - top)),
                    (neck * 0.4, top + 0.45 * (z - top)),
                    (neck * 0.3, z),
                    (0, z),
                ],
                9,
            ),
            STEEL,
            "metal",
        )
    low, high = d.args.get("label", (0.2, 0.5))
    if high > low:
        widest = np.interp([low, high], [q for _, q in profile], [p for p, _ in profile]).max()
        paper: Rgb = tuple(d.args.get("paper", mix(d.colour, WHITE, 0.85)))
        ink: Rgb = tuple(d.args.get("ink", shade(d.colour, 0.45)))
        d.add(
            around(widest * r * 1.012, low * top, high * top), label(paper, ink, name_on(d), d.seed, around=2), "satin"
        )
    where = float(d.args.get("neck_from", shoulder(profile)))
    d.cylinder(r, 0, where * top)
    d.hull(lathe([(r, where * top), *[(p * r, q * top) for p, q in profile if q > where and p > 0], (neck, z)], 8))


@form
def jar(d: Draft) -> None:
    """A glass jar with contents, lid and label; without contents an empty one."""
    x, _, z = d.size
    r = x / 2
    lid: Rgb = tuple(d.args.get("lid", (0.8, 0.8, 0.82)))
    top = 0.84 * z
    empty = bool(d.args.get("empty"))
    if not empty:
        d.add(
            lathe([(0, 0.03 * z), (0.92 * r, 0.03 * z), (0.92 * r, 0.72 * z), (0, 0.72 * z)], 14),
            speckled(d.colour, shade(d.colour, 0.75), 0.2, d.seed),
            "satin",
        )
    d.add(
        lathe([(0, 0), (0.94 * r, 0), (r, 0.04 * z), (r, 0.7 * z), (0.84 * r, 0.82 * z), (0.84 * r, top)], 14),
        (0.88, 0.93, 0.95),
        "glass",
    )
    d.add(
        lathe([(0.9 * r, top - 0.01 * z), (0.92 * r, z * 0.99), (0.88 * r, z), (0, z)], 16),
        stripes(lid, shade(lid, 0.85), 16),
        "metal" if empty else "satin",
    )
    if not empty or d.args.get("text"):
        paper: Rgb = tuple(d.args.get("paper", WHITE))
        d.add(
            around(1.01 * r, 0.2 * z, 0.6 * z),
            label(paper, tuple(d.args.get("ink", shade(d.colour, 0.6))), name_on(d), d.seed, around=2),
        )
    d.cylinder(r, 0, 0.76 * z)
    d.cylinder(0.9 * r, 0.76 * z, z)


@form
def spice(d: Draft) -> None:
    """A small jar of powder with a shaker lid."""
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe([(0, 0), (0.9 * r, 0), (0.9 * r, 0.68 * z), (0, 0.68 * z)], 12),
        speckled(d.colour, shade(d.colour, 0.8), 0.3, d.seed),
    )
    d.add(lathe([(0, 0), (r, 0), (r, 0.76 * z), (0.85 * r, 0.8 * z)], 14), (0.9, 0.94, 0.95), "clear")
    d.add(around(1.015 * r, 0.2 * z, 0.56 * z), label(WHITE, shade(d.colour, 0.55), name_on(d), d.seed, around=2))
    cap: Rgb = tuple(d.args.get("lid", (0.2, 0.2, 0.2)))
    d.add(lathe([(0.95 * r, 0.79 * z), (0.95 * r, 0.97 * z), (0.88 * r, z), (0, z)], 14), cap, "satin")
    d.cylinder(r, 0, z)


@form
def shaker(d: Draft) -> None:
    """Salt or pepper: a glass body, a metal dome with holes."""
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe([(0, 0.02 * z), (0.86 * r, 0.02 * z), (0.7 * r, 0.55 * z), (0, 0.55 * z)], 10),
        speckled(d.colour, shade(d.colour, 0.8), 0.4, d.seed),
    )
    d.add(
        lathe([(0, 0), (r, 0), (r, 0.08 * z), (0.76 * r, 0.68 * z), (0.72 * r, 0.74 * z)], 10),
        (0.9, 0.94, 0.95),
        "clear",
    )
    d.add(lathe([(0.82 * r, 0.72 * z), (0.84 * r, 0.86 * z), (0.6 * r, 0.97 * z), (0, z)], 12), STEEL, "metal")
    for k in range(5):
        a = 2 * np.pi * k / 5
        d.add(ball((0.1 * r, 0.1 * r, 0.02 * z), (0.32 * r * np.cos(a), 0.32 * r * np.sin(a), 0.985 * z), 5, 3), INK)
    d.hull(lathe([(r, 0), (r, 0.08 * z), (0.8 * r, 0.72 * z), (0.84 * r, 0.86 * z), (0.5 * r, z)], 10))


@form
def shaker_pair(d: Draft) -> None:
    """A tall mill for pepper, or a white pot for salt."""
    x, _, z = d.size
    r = x / 2
    wood = d.colour
    profile: Points = [
        (0, 0),
        (r, 0),
        (r, 0.1 * z),
        (0.66 * r, 0.2 * z),
        (0.6 * r, 0.42 * z),
        (0.78 * r, 0.6 * z),
        (0.6 * r, 0.66 * z),
        (0.78 * r, 0.72 * z),
        (0.82 * r, 0.84 * z),
        (0.45 * r, 0.93 * z),
        (0, 0.94 * z),
    ]
    d.add(lathe(profile, 12), stripes(wood, shade(wood, 0.9), 9, duty=0.35, wobble=0.08, seed=d.seed), "satin")
    d.add(lathe([(0.62 * r, 0.645 * z), (0.68 * r, 0.66 * z), (0.62 * r, 0.675 * z)], 12), STEEL, "metal")
    d.add(ball((0.4 * r, 0.4 * r, 0.08 * z), (0, 0, 0.96 * z), 8, 5), STEEL, "metal")
    d.cylinder(r, 0, 0.12 * z)
    d.hull(
        lathe([(0.72 * r, 0.1 * z), (0.74 * r, 0.62 * z), (0.82 * r, 0.8 * z), (0.45 * r, 0.93 * z), (0.2 * r, z)], 8)
    )


@form
def honey_bear(d: Draft) -> None:
    """A squeeze bottle in the shape of a bear."""
    x, y, z = d.size
    r = x / 2
    d.add(
        lathe([(0, 0), (0.85, 0), (0.95, 0.05), (0.92, 0.3), (0.7, 0.48), (0, 0.5)], 14).scaled(r, y / 2, z),
        d.colour,
        "gloss",
    )
    d.add(ball((1.25 * r, 0.62 * y, 0.32 * z), (0, 0, 0.62 * z), 12, 8), d.colour, "gloss")
    for side in (-1, 1):
        d.add(ball((0.42 * r, 0.2 * y, 0.11 * z), (side * 0.5 * r, 0, 0.77 * z), 7, 5), d.colour, "gloss")
        d.add(ball((0.5 * r, 0.3 * y, 0.2 * z), (side * 0.78 * r, -0.2 * y, 0.3 * z), 7, 5), d.colour, "gloss")
        d.add(ball(0.1 * r, (side * 0.24 * r, -0.3 * y, 0.66 * z), 5, 4), INK)
    d.add(ball((0.36 * r, 0.16 * y, 0.08 * z), (0, -0.29 * y, 0.59 * z), 7, 5), mix(d.colour, WHITE, 0.4))
    d.add(
        lathe([(0.4 * r, 0.76 * z), (0.4 * r, 0.86 * z), (0.14 * r, 0.92 * z), (0.1 * r, z), (0, z)], 10),
        (0.95, 0.8, 0.1),
        "satin",
    )
    band = lathe([(0.955, 0.08), (0.945, 0.28)], 14).scaled(r, y / 2, z)
    d.add(band, label(WHITE, (0.55, 0.3, 0.05), "HONEY", d.seed, around=2))
    d.hull(lathe([(0.9, 0), (0.95, 0.05), (0.92, 0.3), (0.7, 0.5)], 10).scaled(r, y / 2, z))
    d.hull(ball((1.25 * r, 0.62 * y, 0.36 * z), (0, 0, 0.62 * z), 8, 6))
    d.cylinder(0.3 * r, 0.75 * z, z)


@form
def cruet_pair(d: Draft) -> None:
    """Oil and vinegar: two glass cruets in a wire stand, or one bottle with two colours."""
    x, y, z = d.size
    r = x / 4
    for side, rgb in ((-1, (0.80, 0.70, 0.15)), (1, (0.36, 0.14, 0.08))):
        at = side * r
        d.add(
            lathe([(0, 0.03 * z), (0.84 * r, 0.03 * z), (0.84 * r, 0.48 * z), (0, 0.48 * z)], 12).moved(at),
            rgb,
            "tinted",
        )
        d.add(
            lathe(
                [
                    (0, 0),
                    (0.95 * r, 0),
                    (0.96 * r, 0.52 * z),
                    (0.36 * r, 0.7 * z),
                    (0.32 * r, 0.86 * z),
                    (0.45 * r, 0.88 * z),
                ],
                12,
            ).moved(at),
            (0.9, 0.94, 0.95),
            "clear",
        )
        d.add(
            lathe([(0.28 * r, 0.86 * z), (0.36 * r, 0.9 * z), (0.3 * r, 0.98 * z), (0, z)], 8).moved(at),
            (0.72, 0.54, 0.34),
        )
        d.cylinder(0.96 * r, 0, 0.54 * z, at)
        d.cylinder(0.4 * r, 0.54 * z, z, at)
        band = around(1.0 * r, 0.14 * z, 0.36 * z, 12).moved(at)
        d.add(band, label(WHITE, shade(rgb, 0.7), "OIL" if side < 0 else "VINEGAR", d.seed, around=2))
    d.add(box((x, 0.9 * y, 0.03 * z), (0, 0, 0.015 * z)), d.colour, "satin")
    d.box((x, 0.9 * y, 0.03 * z), (0, 0, 0.015 * z))


@form
def sports_bottle(d: Draft) -> None:
    """A reusable bottle with a loop on its lid; thermos with a cup on top."""
    x, y, z = d.size
    r = x / 2
    if d.args.get("thermos"):
        d.add(lathe([(0, 0), (0.95 * r, 0), (r, 0.02 * z), (r, 0.7 * z), (0.86 * r, 0.76 * z)], 16), STEEL, "metal")
        d.add(lathe([(r * 1.01, 0.14 * z), (r * 1.01, 0.58 * z)], 16), d.colour, "satin")
        d.add(
            lathe([(0.9 * r, 0.75 * z), (0.92 * r, 0.96 * z), (0.84 * r, z), (0, z)], 16), shade(d.colour, 0.6), "satin"
        )
        d.add(lathe([(0.93 * r, 0.745 * z), (0.96 * r, 0.755 * z), (0.93 * r, 0.765 * z)], 16), STEEL, "metal")
        d.cylinder(r, 0, 0.74 * z)
        d.cylinder(0.91 * r, 0.74 * z, z)
        return
    d.add(
        lathe([(0, 0), (0.94 * r, 0), (r, 0.02 * z), (r, 0.7 * z), (0.62 * r, 0.82 * z), (0, 0.82 * z)], 14),
        d.colour,
        "satin",
    )
    d.add(around(1.005 * r, 0.1 * z, 0.18 * z), shade(d.colour, 0.6), "satin")
    d.add(
        lathe([(0.6 * r, 0.8 * z), (0.66 * r, 0.81 * z), (0.66 * r, 0.9 * z), (0, 0.9 * z)], 12),
        (0.15, 0.15, 0.17),
        "satin",
    )
    t = np.linspace(0, np.pi, 8)
    loop = np.column_stack([np.cos(t) * 0.4 * r, np.zeros(8), 0.9 * z + np.sin(t) * 0.09 * z])
    d.add(tube(loop, 0.09 * r, 6), (0.15, 0.15, 0.17), "satin")
    d.cylinder(r, 0, 0.72 * z)
    d.cylinder(0.66 * r, 0.72 * z, 0.9 * z)
    d.box((0.9 * r, 0.16 * r, 0.1 * z), (0, 0, 0.95 * z))


@form
def liquor(d: Draft) -> None:
    """A square-shouldered flask, amber, with a stopper."""
    x, y, z = d.size
    outline = rounded(x, y, 0.2 * min(x, y), 3)
    small = outline * 0.34
    d.add(
        loft([outline * 0.94, outline, outline, small, small], [0, 0.02 * z, 0.6 * z, 0.72 * z, 0.86 * z]),
        (0.9, 0.94, 0.95),
        "clear",
    )
    d.add(loft([outline * 0.9, outline * 0.93, outline * 0.93], [0.03 * z, 0.05 * z, 0.55 * z]), d.colour, "tinted")
    face = polygon([(-0.36 * x, 0), (0.36 * x, 0), (0.36 * x, 0.34 * z), (-0.36 * x, 0.34 * z)]).turned("x", np.pi / 2)
    d.add(face.moved(0, -0.51 * y, 0.12 * z), label((0.93, 0.9, 0.8), INK, name_on(d, "RUM"), d.seed))
    d.add(face.turned("z", np.pi).moved(0, 0.51 * y, 0.12 * z), label((0.93, 0.9, 0.8), INK, name_on(d, "RUM"), d.seed))
    d.add(lathe([(0.24 * x, 0.84 * z), (0.24 * x, 0.97 * z), (0.18 * x, z), (0, z)], 10), INK, "gloss")
    d.box((x, y, 0.62 * z), (0, 0, 0.31 * z))
    d.hull(
        np.concatenate(
            [
                np.column_stack([outline, np.full(len(outline), 0.62 * z)]),
                np.column_stack([small, np.full(len(small), 0.74 * z)]),
            ]
        )
    )
    d.cylinder(0.22 * x, 0.7 * z, z)
