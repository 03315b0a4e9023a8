"""Sweets, cheese and butter."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.bakery_parts import COLOURS, COOKIE_CHIPS, disc
from robocasa_lerobot.envs.objects.forms.produce import ROUND
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    ball,
    box,
    cushion,
    lathe,
    lumpy,
    prism,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    bytes_of,
    canvas,
    gradient,
    label,
    mix,
    pixels,
    shade,
    speckled,
    stripes,
)


@form
def marshmallow(d: Draft) -> None:
    x, y, z = d.size
    mesh = lathe([(0, 0), (0.42, 0), (0.5, 0.12), (0.5, 0.88), (0.42, 1), (0, 1)], 12).fitted(d.size)
    d.cylinder(x / 2, 0, z)
    d.add(mesh, None, "matte")


@form
def sugar_cube(d: Draft) -> None:
    d.add(box(d.size), speckled(d.colour, shade(d.colour, 0.88), 0.35, d.seed))
    d.box(d.size)


@form
def ice_cube(d: Draft) -> None:
    x, y, z = d.size
    d.add(cushion(d.size, 0.18, 0.16, 2), (0.80, 0.92, 0.98), "glass")
    d.add(lumpy(d.rng, ball((0.5 * x, 0.5 * y, 0.5 * z), (0, 0, z / 2), 7, 5), 0.3), (0.95, 0.98, 1.0), "glass")
    d.box(d.size, (0, 0, z / 2))


@form
def candy(d: Draft) -> None:
    """A sweet in twisted paper."""
    x, y, z = d.size
    d.rolls = True
    mesh = lathe(ROUND, 10).turned("y", np.pi / 2).fitted((0.5 * x, y, z)).flattened(0.1)
    d.add(mesh, stripes(d.colour, (0.97, 0.96, 0.94), 6, duty=0.4), "gloss")
    for side in (-1, 1):
        cone = (
            lathe([(0.06, 0), (0.3, 0.6), (0.42, 1.0), (0.06, 0.75)], 8)
            .scaled(y, y, 0.27 * x)
            .turned("y", side * np.pi / 2)
        )
        d.add(cone.moved(side * 0.23 * x, 0, z / 2), mix(d.colour, (1, 1, 1), 0.25), "gloss")
    d.hull(mesh)
    d.box((x, 0.35 * y, 0.35 * z), (0, 0, z / 2))


@form
def chocolate(d: Draft) -> None:
    """A bar half out of its wrapper."""
    x, y, z = d.size
    d.add(box((x, y, 0.6 * z), (0, 0, 0.3 * z)), shade(d.colour, 0.85), "satin")
    for i in range(6):
        for j in range(3):
            square = box(
                (x / 6 * 0.86, y / 3 * 0.86, 0.4 * z), ((i - 2.5) * x / 6, (j - 1) * y / 3, 0.8 * z), taper=0.82
            )
            if i > 2:
                d.add(square, d.colour, "satin")
    wrapper: Rgb = COLOURS[d.seed % 4]
    d.add(
        box((0.5 * x, 1.03 * y, 1.04 * z), (-0.26 * x, 0, 0.51 * z)),
        label(wrapper, shade(wrapper, 0.4), "CHOCO", d.seed),
        "satin",
    )
    d.add(box((0.05 * x, 1.02 * y, 0.95 * z), (0.01 * x, 0, 0.5 * z)), (0.8, 0.8, 0.82), "metal")
    d.box((x, y, z), (0, 0, z / 2))


@form
def ice_cream(d: Draft) -> None:
    """Two scoops in a paper cup, a wafer in them."""
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe(
            [(0, 0), (0.68 * r, 0), (0.95 * r, 0.52 * z), (0.98 * r, 0.55 * z), (0.9 * r, 0.55 * z), (0, 0.5 * z)], 14
        ),
        stripes((0.95, 0.93, 0.9), shade(d.colour, 0.8), 10, duty=0.4),
    )
    second = mix(d.colour, (0.35, 0.18, 0.1), 0.7)
    d.add(lumpy(d.rng, ball(1.02 * r, (-0.38 * r, 0, 0.62 * z), 10, 7), 0.08), d.colour, "satin")
    d.add(lumpy(d.rng, ball(1.02 * r, (0.4 * r, 0.1 * r, 0.62 * z), 10, 7), 0.08), second, "satin")
    d.add(lumpy(d.rng, ball(0.95 * r, (0, 0, 0.79 * z), 10, 7), 0.08), mix(d.colour, (1, 1, 1), 0.6), "satin")
    wafer = (
        lathe([(0, 0), (0.14 * r, 0), (0.14 * r, 0.42 * z), (0, 0.42 * z)], 7)
        .turned("x", -0.45)
        .moved(0, 0.2 * r, 0.62 * z)
    )
    d.add(wafer, stripes((0.85, 0.62, 0.32), (0.6, 0.4, 0.18), 6))
    d.hull(lathe([(0.68 * r, 0), (0.98 * r, 0.55 * z)], 10))
    d.hull(lathe([(0.9 * r, 0.55 * z), (0.85 * r, 0.7 * z), (0.4 * r, 0.95 * z), (0, 0.97 * z)], 8))


@form
def lollipop(d: Draft) -> None:
    """Lies on its side: a swirl on a stick."""
    x, y, z = d.size
    r = y / 2
    image, draw = canvas((0.97, 0.96, 0.94), 40, 40)
    for k in range(60):
        a, q = k * 0.32, k * 0.32
        draw.ellipse(
            (20 + q * np.cos(a) - 2.2, 20 + q * np.sin(a) - 2.2, 20 + q * np.cos(a) + 2.2, 20 + q * np.sin(a) + 2.2),
            fill=bytes_of(d.colour),
        )
    d.add(
        lathe([(0, 0), (0.9 * r, 0), (r, 0.3 * z), (r, 0.7 * z), (0.9 * r, z), (0, z)], 16).moved(x / 2 - r),
        d.colour,
        "gloss",
    )
    d.add(disc(0.92 * r, x / 2 - r, 0, 1.01 * z, 16), pixels(image), "gloss")
    d.add(tube([(-x / 2, 0, z / 2), (x / 2 - 2 * r, 0, z / 2)], 0.22 * z, 6), (0.95, 0.95, 0.95))
    d.cylinder(r, 0, z, x / 2 - r)
    d.box((x - 2 * r, 0.5 * z, 0.9 * z), (-r, 0, 0.45 * z))


@form
def jello(d: Draft) -> None:
    """A clear cup of jelly with a dab of cream."""
    x, _, z = d.size
    r = x / 2
    jelly = [(0, 0.05 * z), (0.68 * r, 0.05 * z), (0.92 * r, 0.74 * z), (0.7 * r, 0.82 * z), (0, 0.84 * z)]
    d.add(lathe(jelly, 14), d.colour, "gloss")
    d.add(
        lathe([(0, 0), (0.74 * r, 0), (0.98 * r, 0.8 * z), (r, 0.82 * z), (0.98 * r, 0.84 * z)], 14),
        (0.95, 0.96, 0.98),
        "clear",
    )
    cream = [(0.34 * r, 0.82 * z), (0.36 * r, 0.86 * z), (0.2 * r, 0.92 * z), (0.22 * r, 0.95 * z), (0, z)]
    d.add(lathe(cream, 10), (0.98, 0.97, 0.94))
    d.hull(lathe([(0.74 * r, 0), (r, 0.82 * z), (0.36 * r, 0.86 * z), (0, z)], 10))


@form
def cheese(d: Draft) -> None:
    """A wedge with holes."""
    x, y, z = d.size
    outline = np.array(
        [(-0.5 * x, 0.0), (0.42 * x, -0.5 * y), (0.5 * x, -0.2 * y), (0.5 * x, 0.2 * y), (0.42 * x, 0.5 * y)]
    )
    d.body(prism(outline, 0, z), d.colour, "satin")
    hole = shade(d.colour, 0.72)
    for u, w, s in ((0.05, 0.1, 0.16), (0.3, -0.15, 0.2), (0.32, 0.22, 0.12), (-0.15, -0.02, 0.1)):
        d.add(disc(s * y * 0.6, u * x, w * y, 1.005 * z, 8), hole)
    normal = np.array([0.92 * x, -0.5 * y])
    normal = np.array([-normal[1], normal[0]]) / np.linalg.norm(normal)
    for share, h, s in ((0.35, 0.5, 0.18), (0.6, 0.3, 0.25), (0.75, 0.7, 0.2), (0.9, 0.35, 0.14)):
        for side in (-1, 1):
            where = np.array([(-0.5 + 0.92 * share) * x, side * 0.5 * y * share, h * z])
            face = disc(s * z, n=8).turned("x", np.pi / 2).turned("z", np.arctan2(-0.5 * y, 0.92 * x))
            if side > 0:
                face = face.scaled(1, -1, 1)
            d.add(face.moved(*(where + [0, side * 0.0008, 0])), hole)


@form
def butter(d: Draft) -> None:
    """Butter, cream cheese: a bar half in printed paper."""
    x, y, z = d.size
    d.add(cushion((x, y * 0.96, z * 0.96), 0.04, 0.06, 2).moved(z=0.01 * z), mix(d.colour, (1, 1, 0.9), 0.1), "satin")
    wrap: Rgb = tuple(d.args.get("wrap", (0.92, 0.93, 0.95)))
    d.add(
        box((0.62 * x, y, z), (-0.19 * x, 0, z / 2)),
        label(wrap, (0.1, 0.25, 0.6), d.args.get("text", "BUTTER"), d.seed),
        "satin",
    )
    for k in range(5):
        fold = box((0.035 * x, 1.0 * y, 0.02 * z), (0.11 * x + 0.004 * k, 0, 1.0 * z))
        d.add(fold.turned("z", 0.04 * (k - 2)), shade(wrap, 0.9))
    d.box((x, y, z), (0, 0, z / 2))


@form
def cookie(d: Draft) -> None:
    """A flat round biscuit with chips."""
    x, y, z = d.size
    d.add(
        lumpy(d.rng, lathe([(0, 0), (0.44, 0), (0.5, 0.35), (0.4, 0.9), (0, 1)], 16), 0.03).fitted(d.size),
        speckled(d.colour, shade(d.colour, 0.85), 0.3, d.seed, blur=True),
    )
    for k in range(COOKIE_CHIPS):
        a, share = 2.4 * k, 0.4 * np.sqrt((k + 0.5) / COOKIE_CHIPS)
        d.add(
            ball((0.11 * x, 0.1 * x, 0.4 * z), (share * x * np.cos(a), share * x * np.sin(a), 0.86 * z), 6, 4),
            (0.2, 0.1, 0.05),
        )
    d.cylinder(x / 2, 0, 0.95 * z)


@form
def dough_ball(d: Draft) -> None:
    x, _, z = d.size
    d.rolls = True
    mesh = lumpy(d.rng, lathe(ROUND, 12), 0.06).fitted(d.size).flattened(0.08)
    d.body(mesh, speckled(d.colour, shade(d.colour, 0.9), 0.2, d.seed))
    for k in range(14):
        a, t = 2.4 * k, np.arcsin(-0.5 + 1.45 * (k + 0.5) / 14)
        where = (0.47 * x * np.cos(a) * np.cos(t), 0.47 * x * np.sin(a) * np.cos(t), z / 2 + 0.47 * z * np.sin(t))
        d.add(ball(0.13 * x, where, 5, 4), (0.22, 0.11, 0.06), "satin")


@form
def cupcake(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    paper = mix(d.colour, (0.4, 0.25, 0.15), 0.5)
    wrap = lathe([(0, 0), (0.68 * r, 0), (0.92 * r, 0.45 * z), (0, 0.45 * z)], 16)
    d.add(wrap, stripes(paper, shade(paper, 1.35), 16, duty=0.5))
    if d.args.get("muffin"):
        top = lumpy(d.rng, lathe([(0, 0.42), (0.98, 0.44), (1.0, 0.58), (0.8, 0.85), (0.4, 0.98), (0, 1.0)], 14), 0.05)
        d.add(top.scaled(r, r, z), speckled(d.colour, shade(d.colour, 0.65), 0.3, d.seed, blur=True))
        for k in range(8):
            a, share = 2.4 * k, 0.2 + 0.5 * ((k * 0.618) % 1)
            d.add(
                ball(0.13 * r, (share * r * np.cos(a), share * r * np.sin(a), (1.0 - 0.34 * share**2) * z), 6, 4),
                (0.2, 0.12, 0.25),
            )
        d.hull(wrap)
        d.hull(lathe([(0.98, 0.44), (1.0, 0.58), (0.8, 0.85), (0.4, 0.98)], 10).scaled(r, r, z))
        return
    frost = [
        (0, 0.43),
        (1.0, 0.45),
        (1.0, 0.55),
        (0.78, 0.6),
        (0.84, 0.68),
        (0.58, 0.76),
        (0.58, 0.83),
        (0.3, 0.9),
        (0, 0.96),
    ]
    d.add(lathe([(p * r, q * z) for p, q in frost], 14), d.colour, "satin")
    d.add(ball(0.14 * z, (0, 0, 0.94 * z), 7, 5), (0.8, 0.08, 0.12), "gloss")
    for k in range(10):
        a, h = 2.4 * k, 0.6 + 0.022 * k
        rr = np.interp(h, [0.55, 0.76, 0.96], [0.95, 0.62, 0.1]) * r
        d.add(
            box((0.05 * x, 0.015 * x, 0.02 * x)).turned("z", a + 1).moved(rr * np.cos(a), rr * np.sin(a), h * z),
            COLOURS[k % 5],
        )
    d.hull(wrap)
    d.hull(lathe([(0, 0.43), (1.0, 0.45), (1.0, 0.55), (0.6, 0.8), (0.0, 0.96)], 10).scaled(r, r, z))


@form
def cake(d: Draft) -> None:
    """A round cake with a slice missing, icing and cherries."""
    x, _, z = d.size
    r, top = x / 2, 0.84 * z
    gone = 0.16 * 2 * np.pi
    sponge: Rgb = d.args.get("sponge", (0.62, 0.36, 0.18))
    cream = mix(d.colour, (1, 1, 1), 0.55)
    profile = [(0.0, 0.0), (r, 0.0), (r, 0.9 * top), (0.94 * r, top), (0.0, top)]
    mesh = lathe(profile, 16, arc=2 * np.pi - gone)
    d.add(mesh, gradient([d.colour, d.colour], None, 4), "satin")
    for angle, flip in ((0.0, False), (2 * np.pi - gone, True)):
        for k, (z0, z1, rgb) in enumerate(((0.06, 0.42, sponge), (0.42, 0.5, cream), (0.5, 0.88, sponge))):
            del k
            quad = np.array(
                [(0.02 * r, 0, z0 * top), (0.95 * r, 0, z0 * top), (0.95 * r, 0, z1 * top), (0.02 * r, 0, z1 * top)]
            )
            faces = np.array([(0, 1, 2), (0, 2, 3)])
            out = Mesh(
                quad + [0, -0.004 * r if not flip else 0.004 * r, 0],
                faces[:, ::-1].copy() if flip else faces,
                np.zeros((4, 2)),
                np.zeros(4, int),
            )
            d.add(out.turned("z", angle), rgb)
    for k in range(7):
        a = (2 * np.pi - gone) * (k + 0.5) / 7
        swirl = lathe([(0.11 * r, 0), (0.13 * r, 0.05 * z), (0.05 * r, 0.12 * z), (0, 0.13 * z)], 7)
        d.add(swirl.moved(0.78 * r * np.cos(a), 0.78 * r * np.sin(a), top), cream)
        d.add(
            ball(0.13 * r, (0.78 * r * np.cos(a), 0.78 * r * np.sin(a), top + 0.13 * z), 6, 4),
            (0.75, 0.08, 0.12),
            "gloss",
        )
    for a0, a1 in ((0.0, 0.34), (0.33, 0.67), (0.66, 1.0)):
        turns = np.linspace(a0, a1, 6) * (2 * np.pi - gone)
        rim = np.column_stack([np.cos(turns), np.sin(turns)]) * r
        sector = np.concatenate([[[0, 0]], rim])
        d.hull(np.concatenate([np.column_stack([sector, np.full(7, height)]) for height in (0, top)]))
