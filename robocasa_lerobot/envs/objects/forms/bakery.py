"""Bread and pastry."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.bakery_parts import COLOURS, CRUMB, disc, ring
from robocasa_lerobot.envs.objects.forms.produce import leaf
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    ball,
    bent,
    box,
    cushion,
    joined,
    lathe,
    loft,
    polygon,
    prism,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    gradient,
    gridded,
    mix,
    shade,
    speckled,
)
from robocasa_lerobot.envs.objects.solids import Solid, about


@form
def torus(d: Draft) -> None:
    """Bagel; donut with icing and sprinkles."""
    x, _, z = d.size
    radius = x / 2 - z * 0.62
    wide = z * 1.24
    squash = z / wide
    body = ring(radius, wide, 0.0).scaled(1, 1, squash).moved(z=z / 2).flattened(0.08)
    iced = bool(d.args.get("icing"))
    dough: Rgb = (0.80, 0.56, 0.28) if iced else d.colour
    d.add(body, gradient([mix(dough, CRUMB, 0.4), dough, dough], None, 8), "satin")
    if iced:
        top = ring(radius, wide * 1.06, 0.0, start=0.12, stop=np.pi - 0.12).scaled(1, 1, squash).moved(z=z * 0.5)
        d.add(top, None, "gloss")
        for k in range(18):
            a, r = 2.4 * k, radius + (((k * 0.618) % 1) - 0.5) * wide * 0.55
            up = z / 2 + squash * 0.54 * np.sqrt(max((wide / 2) ** 2 - (r - radius) ** 2, 0)) * 2 * 0.98
            bit = box((0.05 * x, 0.016 * x, 0.016 * x)).turned("z", a * 1.7).moved(r * np.cos(a), r * np.sin(a), up)
            d.add(bit, COLOURS[k % 5])
    else:
        for k in range(20):
            a, r = 2.4 * k, radius + (((k * 0.618) % 1) - 0.5) * wide * 0.5
            d.add(
                ball((0.035 * x, 0.02 * x, 0.012 * x), (0, 0, 0), 5, 3)
                .turned("z", a)
                .moved(r * np.cos(a), r * np.sin(a), 0.97 * z),
                CRUMB,
            )
    count = 6
    for k in range(count):  # every second one ends a little higher: it stands on three
        a = 2 * np.pi * k / count
        half_z = z / 2 - 0.0006 * (k % 2)
        size = (float(wide * 0.44), float(radius * np.tan(np.pi / count) + 0.1 * wide), float(half_z))
        pos = (float(radius * np.cos(a)), float(radius * np.sin(a)), float(z - half_z))
        d.solids.append(Solid("box", size, pos, about("z", a)))


@form
def baguette(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.22, 0.01), (0.42, 0.07), (0.5, 0.2), (0.5, 0.8), (0.42, 0.93), (0.22, 0.99), (0, 1)]
    mesh = lathe(profile, 10).turned("y", np.pi / 2).fitted(d.size).flattened(0.12)
    d.body(mesh, speckled(d.colour, shade(d.colour, 0.8), 0.3, d.seed, blur=True), "satin")
    for k in range(5):
        slash = ball((0.13 * x, 0.3 * y, 0.1 * z), (0, 0, 0), 8, 4).turned("z", 0.7)
        d.add(slash.moved((-0.32 + 0.16 * k) * x, 0, 0.965 * z), CRUMB)


@form
def loaf(d: Draft) -> None:
    x, y, z = d.size
    t = np.linspace(0, np.pi, 7)
    outline = np.concatenate(
        [
            [(-0.42 * y, 0), (0.42 * y, 0), (0.44 * y, 0.45 * z)],
            np.column_stack([np.cos(t) * 0.5 * y, 0.62 * z + np.sin(t) * 0.38 * z]),
            [(-0.44 * y, 0.45 * z)],
        ]
    )
    mesh = prism(outline, -x / 2, x / 2, smooth=True).turned("x", np.pi / 2).turned("z", np.pi / 2)
    d.hull(mesh)
    d.add(mesh, speckled(d.colour, shade(d.colour, 0.85), 0.3, d.seed, blur=True), "satin")
    middle = outline.mean(axis=0)
    for side, face in ((1, x / 2 * 1.004), (-1, -x / 2 * 1.004)):
        cut = polygon(middle + (outline - middle) * 0.9).turned("x", np.pi / 2).turned("z", np.pi / 2)
        if side < 0:
            cut = Mesh(cut.vertices, cut.faces[:, ::-1].copy(), cut.uv, cut.ids)
        d.add(cut.moved(x=face), speckled(CRUMB, shade(CRUMB, 0.85), 0.15, d.seed))
    for k in range(4):
        slash = ball((0.035 * x, 0.55 * y, 0.04 * z), ((-0.3 + 0.2 * k) * x, 0, 0.985 * z), 8, 4)
        d.add(slash, mix(d.colour, CRUMB, 0.6))


@form
def slice_bread(d: Draft) -> None:
    x, y, z = d.size
    t = np.linspace(-0.3, np.pi + 0.3, 9)
    outline = np.concatenate(
        [
            [(-0.4 * x, -0.5 * y), (0.4 * x, -0.5 * y)],
            np.column_stack([np.cos(t) * 0.5 * x, 0.15 * y + np.sin(t) * 0.35 * y]),
        ]
    )
    d.body(prism(outline, 0, z * 0.97, smooth=True), d.colour)
    middle = outline.mean(axis=0)
    d.add(polygon(middle + (outline - middle) * 0.9).moved(z=z), speckled(CRUMB, shade(CRUMB, 0.87), 0.15, d.seed))


@form
def flatbread(d: Draft) -> None:
    """Flat bread, pancake: a soft disc with browned patches; pancake with butter."""
    x, y, z = d.size
    stack = int(d.args.get("stack", 1))
    step = z / stack * (0.86 if d.args.get("butter") else 1.0)
    for k in range(stack):
        mesh = lathe([(0, 0), (0.45, 0), (0.5, 0.4), (0.46, 1), (0, 1)], 16).scaled(
            x * (1 - 0.03 * k), y * (1 - 0.03 * k), step
        )
        mesh = mesh.moved(0.008 * x * np.sin(2 * k), 0.008 * y * np.cos(3 * k), k * step)
        d.add(mesh, mix(d.colour, CRUMB, 0.5), "matte")
        face = disc(
            0.455 * x * (1 - 0.03 * k), 0.008 * x * np.sin(2 * k), 0.008 * y * np.cos(3 * k), (k + 1.02) * step, 16
        ).scaled(1, y / x, 1)
        brown = mix(d.colour, (0.5, 0.28, 0.1), 0.45)
        d.add(face, speckled(d.colour, brown, 0.3 if d.args.get("spots", True) else 0.08, d.seed + k, blur=True))
    if d.args.get("butter"):
        d.add(
            cushion((0.2 * x, 0.2 * x, z - stack * step), 0.2, 0.2, 2).moved(z=stack * step * 1.01),
            (0.98, 0.88, 0.45),
            "satin",
        )
    d.hull(lathe([(0.49 * x, 0), (0.49 * x, stack * step)], 16).scaled(1, y / x, 1))


@form
def scone(d: Draft) -> None:
    x, y, z = d.size
    outline = np.array(
        [(-0.5, -0.5), (-0.38, -0.5), (0.42, -0.08), (0.5, 0.0), (0.42, 0.08), (-0.38, 0.5), (-0.5, 0.5), (-0.54, 0.0)]
    ) * [x, y]
    inner = outline * 0.9
    d.body(
        loft([outline, outline * 1.02, inner], [0, 0.7 * z, z]),
        speckled(d.colour, shade(d.colour, 0.78), 0.3, d.seed, blur=True),
    )
    for _ in range(9):
        u, w = d.rng.uniform(-0.4, 0.25), d.rng.uniform(-0.25, 0.25)
        d.add(ball(0.09 * y, (u * x, w * y, 0.98 * z), 6, 4), (0.3, 0.1, 0.25))


@form
def croissant(d: Draft) -> None:
    x, y, z = d.size
    n = 9
    segments = []
    for k in range(n):
        share = (k + 0.5) / n * 2 - 1
        r = 0.5 * (1 - 0.75 * abs(share) ** 1.6)
        rows = [(0, 0.0), (0.8 * r, 0.02), (1.05 * r, 0.4), (0.95 * r, 0.96), (0, 1.0)]
        one = lathe(rows, 9).turned("y", np.pi / 2).scaled(1.12 / n, 1, 1).moved(k / n - 0.5)
        segments.append(one)
    whole = joined(segments)
    shaped = bent(whole.scaled(1.35 * x, 0.62 * y, z), 1.9)
    shaped = shaped.fitted((x, y, z)).flattened(0.2)
    d.add(shaped, gradient([shade(d.colour, 0.7), d.colour, shade(d.colour, 1.12)], [0, 0.5, 1], 8), "satin")
    low, high = shaped.vertices[:, 0].min(), shaped.vertices[:, 0].max()
    for a, b in ((0, 0.36), (0.3, 0.7), (0.64, 1)):
        inside = (shaped.vertices[:, 0] >= low + a * (high - low)) & (shaped.vertices[:, 0] <= low + b * (high - low))
        d.hull(shaped.vertices[inside])


@form
def waffle(d: Draft) -> None:
    x, y, z = d.size
    d.add(
        lathe([(0, 0), (0.48, 0), (0.5, 0.3), (0.5, 0.7), (0.48, 1), (0, 1)], 18).scaled(x, y, z), shade(d.colour, 0.85)
    )
    d.add(
        disc(0.485 * x, z=1.01 * z, n=18).scaled(1, y / x, 1),
        gridded(shade(d.colour, 0.62), mix(d.colour, CRUMB, 0.3), (8, 8), size=64, width=0.36),
    )
    for k in range(-2, 3):  # the ribs stand up
        reach = np.sqrt(0.25 - (k * 0.12) ** 2) * 1.9
        for turn in (0.0, np.pi / 2):
            d.add(
                box((reach * x, 0.03 * x, 0.18 * z), (0, k * 0.125 * x * 1.0 + 0.0, 1.03 * z)).turned("z", turn),
                d.colour,
            )
    d.cylinder(0.5 * x, 0, z)


@form
def pizza(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe([(0, 0), (0.95 * r, 0), (r, 0.5 * z), (0.95 * r, 0.95 * z), (0.86 * r, 0.6 * z), (0, 0.55 * z)], 20),
        speckled(d.colour, shade(d.colour, 0.7), 0.3, d.seed, blur=True),
    )
    d.add(
        disc(0.87 * r, z=0.64 * z, n=20),
        speckled((0.96, 0.80, 0.36), (0.85, 0.35, 0.15), 0.35, d.seed, blur=True),
        "satin",
    )
    for k in range(9):
        a, share = 2.4 * k, np.sqrt((k + 0.5) / 9) * 0.72
        d.add(
            lathe([(0.115 * r, 0.64 * z), (0.105 * r, 0.82 * z), (0, 0.82 * z)], 9).moved(
                share * r * np.cos(a), share * r * np.sin(a)
            ),
            (0.72, 0.16, 0.1),
            "satin",
        )
    for k in range(6):
        a = 2.4 * k + 1.0
        d.add(
            leaf(0.16 * r, 0.1 * r, lift=0.1)
            .turned("z", 3 * a)
            .moved(0.5 * r * np.cos(a), 0.5 * r * np.sin(a), 0.72 * z),
            (0.2, 0.5, 0.16),
        )
    d.cylinder(r, 0, 0.9 * z)


@form
def sandwich(d: Draft) -> None:
    """Two triangles of toast with a filling."""
    x, y, z = d.size
    triangle = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5)]) * [x, y]
    layers = (
        (0, 0.3, d.colour),
        (0.3, 0.4, (0.97, 0.78, 0.25)),
        (0.4, 0.5, (0.86, 0.45, 0.4)),
        (0.5, 0.62, (0.45, 0.68, 0.25)),
        (0.62, 0.7, (0.82, 0.2, 0.14)),
        (0.7, 1.0, d.colour),
    )
    for k, (low, high, rgb) in enumerate(layers):
        out = triangle * (1.0 if k in (0, 5) else 1.02)
        d.add(prism(out, low * z, high * z), rgb)
    middle = triangle.mean(axis=0)
    d.add(
        polygon(middle + (triangle - middle) * 0.88).moved(z=1.005 * z),
        speckled(CRUMB, d.colour, 0.35, d.seed, blur=True),
    )
    d.hull(np.concatenate([np.column_stack([triangle, np.full(3, h)]) for h in (0, z)]))


@form
def pretzel(d: Draft) -> None:
    x, y, z = d.size
    # One strand from the middle of the bow, around, over the crossing and down to the bow's other side.
    across = (0.0, 0.2, 0.38, 0.47, 0.44, 0.32, 0.16, 0.05, 0.0, -0.06, -0.14, -0.22)
    along = (-0.42, -0.4, -0.3, -0.08, 0.18, 0.37, 0.4, 0.26, 0.1, -0.06, -0.22, -0.38)
    half = np.column_stack([across, along])
    for side in (-1, 1):
        points = np.column_stack([half * [side, 1], np.full(len(half), 0.4)])
        points[8:, 2] = 0.55 + 0.1 * side
        radii = np.interp(np.arange(len(half)), [0, 6, 11], [0.4, 0.34, 0.22]) * z
        mesh = tube(points * [x, y, z], radii, 7).flattened(0.1)
        d.add(mesh, speckled(d.colour, (0.97, 0.96, 0.94), 0.04, d.seed), "gloss")
        for first in (0, 3, 6):
            d.hull(mesh.vertices[first * 8 : (first + 4) * 8])
        d.hull(mesh.vertices[9 * 8 : 12 * 8])
