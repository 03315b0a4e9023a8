"""Meat and fish."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.meat_parts import BONE, CHOP, FAT, cut, facing, marbled, upper_face
from robocasa_lerobot.envs.objects.forms.produce import lying
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    arc,
    ball,
    joined,
    lathe,
    loft,
    polygon,
    sheet,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    bands,
    gradient,
    mix,
    shade,
    speckled,
    stripes,
)


@form
def steak(d: Draft) -> None:
    """Steak; with a bone: pork chop, lamb chop."""
    x, y, z = d.size
    outline = CHOP * [x, y]
    d.body(cut(outline, z), FAT, "satin")
    middle = outline.mean(axis=0)
    face = polygon(middle + (outline - middle) * 0.84).moved(z=1.01 * z)
    d.add(face, marbled(d, d.colour), "satin")
    kind = d.args.get("bone")
    if kind == "rib":
        d.add(
            tube(
                [(-0.3 * x, 0.2 * y, 0.5 * z), (0.1 * x, 0.22 * y, 0.55 * z), (0.75 * x, 0.14 * y, 0.55 * z)],
                [0.3 * z, 0.28 * z, 0.3 * z],
                7,
            ),
            BONE,
        )
        d.box((0.4 * x, 0.12 * y, 0.5 * z), (0.56 * x, 0.17 * y, 0.5 * z))
    elif kind == "t":
        for a, b in (((-0.38, 0.15), (0.3, 0.2)), ((-0.05, 0.17), (0.05, -0.25))):
            d.add(
                tube([(a[0] * x, a[1] * y, 0.95 * z), (b[0] * x, b[1] * y, 0.95 * z)], 0.1 * z + 0.02 * y, 6, flat=0.6),
                BONE,
            )


@form
def bacon(d: Draft) -> None:
    x, y, z = d.size
    n = 13
    u = np.linspace(-0.5, 0.5, n)
    wave = 0.32 * z * np.sin(u * 22)
    strip = []
    for side in (-0.5, 0.5):
        strip.append(np.column_stack([u * x, np.full(n, side * y) + 0.06 * y * np.sin(u * 17), 0.5 * z + wave]))
    points = np.concatenate([strip[0], strip[1]])
    uv = np.column_stack([np.tile(np.linspace(0, 1, n), 2), np.repeat([0, 1], n)])
    faces = []
    for k in range(n - 1):
        faces += [(k, k + 1, n + k + 1), (k, n + k + 1, n + k)]
    top = Mesh(points, np.array(faces), uv, np.arange(2 * n))
    under = Mesh(points - [0, 0, 0.25 * z], np.array(faces)[:, ::-1].copy(), uv, np.arange(2 * n))
    paint = bands([d.colour, FAT, d.colour, FAT, shade(d.colour, 0.85)], [0.3, 0.45, 0.68, 0.8, 1.0])
    d.add(joined([top, under]), paint, "satin")
    d.box((x, y, z * 0.9), (0, 0, 0.45 * z))


@form
def chicken_breast(d: Draft) -> None:
    profile = [(0, 0), (0.2, 0.03), (0.4, 0.2), (0.5, 0.45), (0.42, 0.7), (0.18, 0.93), (0, 1)]
    lying(
        d,
        profile,
        speckled(d.colour, shade(d.colour, 0.92), 0.3, d.seed, blur=True),
        "satin",
        bend=0.4,
        flat=0.12,
        lumps=0.08,
        n=12,
    )


@form
def drumstick(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.28, 0.02), (0.46, 0.14), (0.5, 0.3), (0.36, 0.52), (0.2, 0.68), (0.14, 0.76), (0.0, 0.78)]
    mesh = lathe(profile, 12).turned("y", np.pi / 2).scaled(x, y, z).moved(z=z / 2)
    d.rolls = True
    d.body(mesh.flattened(0.1), speckled(d.colour, shade(d.colour, 0.75), 0.3, d.seed, blur=True), "satin")
    d.add(tube([(0.7 * x, 0, z / 2), (0.93 * x, 0, z / 2)], [0.075 * y, 0.07 * y], 7), BONE)
    for side in (-1, 1):
        d.add(ball((0.1 * x, 0.15 * y, 0.17 * z), (0.95 * x, side * 0.06 * y, z / 2), 7, 5), BONE)
    d.box((0.24 * x, 0.2 * y, 0.54 * z), (0.87 * x, 0, 0.33 * z))


@form
def fish(d: Draft) -> None:
    x, y, z = d.size
    shares = np.array([0.0, 0.06, 0.16, 0.34, 0.55, 0.72, 0.82])
    high = np.array([0.1, 0.35, 0.66, 1.0, 0.8, 0.4, 0.2])
    thick = np.array([0.15, 0.5, 0.85, 1.0, 0.8, 0.4, 0.18])
    ring = arc(1.0, 0, 2 * np.pi, 11)[:-1]
    outlines = [ring * [h * 0.42 * y, t * z / 2] for h, t in zip(high, thick, strict=True)]
    mesh = loft(outlines, (shares * x).tolist()).turned("y", np.pi / 2).turned("x", np.pi / 2)
    mesh = mesh.mapped(lambda v: v + [0, 0, z / 2]).flattened(0.12)
    pale = mix(d.colour, (0.95, 0.95, 0.95), 0.7)
    d.body(mesh, stripes(pale, d.colour, 1, duty=0.5, wobble=0.02), "gloss")
    tail = sheet(
        [
            (0.0, 0.0),
            (0.09 * x, 0.24 * y),
            (0.22 * x, 0.48 * y),
            (0.17 * x, 0.0),
            (0.22 * x, -0.48 * y),
            (0.09 * x, -0.24 * y),
        ],
        0.08 * z,
    )
    d.add(tail.moved(0.78 * x, 0, 0.54 * z), shade(d.colour, 0.8))
    fin = sheet([(0, 0), (0.12 * x, 0.18 * y), (0.3 * x, 0.12 * y), (0.34 * x, 0)], 0.06 * z)
    d.add(fin.moved(0.28 * x, 0.33 * y, 0.52 * z), shade(d.colour, 0.75))
    d.add(
        sheet([(0, 0), (0.08 * x, -0.12 * y), (0.16 * x, -0.1 * y), (0.12 * x, 0)], 0.05 * z).moved(
            0.45 * x, -0.34 * y, 0.5 * z
        ),
        shade(d.colour, 0.75),
    )
    d.add(
        sheet([(0, 0), (0.1 * x, 0.07 * y), (0.13 * x, -0.03 * y)], 0.04 * z).moved(0.26 * x, -0.04 * y, 0.99 * z),
        shade(d.colour, 0.6),
    )
    d.add(ball((0.034 * x, 0.034 * x, 0.12 * z), (0.1 * x, 0.08 * y, 0.79 * z), 8, 4), (0.95, 0.93, 0.8))
    d.add(ball((0.02 * x, 0.02 * x, 0.1 * z), (0.1 * x, 0.08 * y, 0.84 * z), 8, 4), (0.05, 0.05, 0.05), "gloss")
    gill = tube(
        [(0.185 * x, 0.2 * y, 0.85 * z), (0.21 * x, 0.0, 0.95 * z), (0.185 * x, -0.2 * y, 0.85 * z)], 0.03 * z, 5
    )
    d.add(gill, shade(d.colour, 0.55))
    d.box((0.2 * x, 0.5 * y, 0.1 * z), (0.87 * x, 0, 0.5 * z))


@form
def ham(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0.0), (0.4, 0.0), (0.48, 0.08), (0.5, 0.3), (0.4, 0.6), (0.24, 0.82), (0.15, 0.88), (0, 0.9)]
    mesh = lathe(profile, 14).turned("y", np.pi / 2).scaled(x, y, z).moved(z=z / 2).flattened(0.14)
    d.body(mesh, speckled(d.colour, shade(d.colour, 0.75), 0.3, d.seed, blur=True), "gloss")
    d.add(facing(0.44 * y, 0.44 * z, -0.004 * x, z / 2), (0.95, 0.82, 0.78))
    d.add(facing(0.36 * y, 0.36 * z, -0.009 * x, z / 2), mix(d.colour, (0.95, 0.5, 0.5), 0.6), "satin")
    d.add(facing(0.07 * y, 0.07 * z, -0.014 * x, 0.55 * z), BONE)
    d.add(tube([(0.85 * x, 0, z / 2), (1.0 * x, 0, z / 2)], [0.07 * y, 0.06 * y], 7), BONE)
    d.add(ball(0.17 * y, (1.0 * x, 0.04 * y, z / 2), 7, 5), BONE)
    d.add(ball(0.17 * y, (1.0 * x, -0.04 * y, z / 2), 7, 5), BONE)
    d.half_turn()


@form
def roast(d: Draft) -> None:
    """Salami, pork loin: a round bar with a cut face."""
    x, y, z = d.size
    profile = [(0, 0), (0.46, 0), (0.5, 0.03), (0.5, 0.9), (0.42, 0.98), (0, 1)]
    mesh = lathe(profile, 14).turned("y", np.pi / 2).scaled(x, y, z).moved(z=z / 2).flattened(0.06)
    d.rolls = True
    salami = bool(d.args.get("salami"))
    skin = (
        stripes(d.colour, FAT, 12, duty=0.12, wobble=0.2, seed=d.seed)
        if salami
        else gradient([mix(d.colour, FAT, 0.8), d.colour], None, 8)
    )
    d.body(mesh, skin, "satin")
    red: Rgb = (0.62, 0.13, 0.12) if salami else mix(d.colour, (0.85, 0.5, 0.48), 0.6)
    inner = speckled(red, FAT, 0.22 if salami else 0.05, d.seed)
    d.add(facing(0.455 * y, 0.455 * z, -0.003 * x, z / 2), inner, "satin")
    if salami:
        d.add(tube([(x, 0, z / 2), (1.04 * x, 0, z / 2)], [0.08 * y, 0.06 * y], 6), (0.85, 0.8, 0.7))
        slice_ = lathe([(0, 0), (0.45, 0), (0.45, 1), (0, 1)], 12).scaled(y, y, 0.06 * x).turned("y", -1.2)
        d.add(slice_.fitted((0.22 * x, 0.9 * y, 0.8 * z)).moved(-0.13 * x, 0, 0.0), inner, "satin")
    else:
        for k in range(3):
            ring = lathe([(0.5, -0.01), (0.515, 0), (0.5, 0.01)], 14).turned("y", np.pi / 2).scaled(x, y, z)
            d.add(ring.moved((0.25 + 0.25 * k) * x, 0, z / 2).flattened(0.07), (0.95, 0.93, 0.85))
    d.half_turn()


@form
def sausage(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.3, 0.02), (0.46, 0.07), (0.5, 0.15), (0.5, 0.85), (0.46, 0.93), (0.3, 0.98), (0, 1)]
    lying(d, profile, speckled(d.colour, shade(d.colour, 0.8), 0.15, d.seed), "gloss", bend=0.55)
    for side in (-1, 1):
        d.add(ball((0.04 * x, 0.22 * z, 0.22 * z), (side * 0.485 * x, 0.07 * x, 0.5 * z), 6, 4), shade(d.colour, 0.6))


@form
def scallops(d: Draft) -> None:
    x, y, z = d.size
    for k, (px, py) in enumerate(((-0.24, -0.2), (0.24, -0.16), (0.0, 0.24))):
        one = lathe([(0, 0), (0.42, 0), (0.5, 0.2), (0.5, 0.75), (0.4, 1), (0, 1)], 12).fitted((0.5 * x, 0.5 * y, z))
        d.add(one.moved(px * x, py * y), gradient([d.colour, d.colour], None, 4), "satin")
        d.add(
            upper_face(0.19 * x, px * x, py * y, 1.01 * z),
            speckled((0.78, 0.52, 0.25), d.colour, 0.3, d.seed + k, blur=True),
        )
        d.cylinder(0.25 * x, 0, z, px * x, py * y)


@form
def shrimp(d: Draft) -> None:
    x, y, z = d.size
    a = np.linspace(-0.35, 1.25 * np.pi, 9)
    path = np.column_stack([np.cos(a) * 0.34 * x, np.sin(a) * 0.34 * y, np.full(9, 0.5 * z)])
    radii = np.array([0.5, 0.5, 0.48, 0.44, 0.4, 0.34, 0.28, 0.2, 0.1]) * z
    paint = bands([d.colour, mix(d.colour, FAT, 0.6)] * 6, (np.arange(12) / 11).tolist(), 48)
    mesh = tube(path, radii, 8).flattened(0.08)
    d.add(mesh, paint, "gloss")
    for lo, hi in ((0, 4), (3, 6), (5, 9)):
        d.hull(mesh.vertices[np.concatenate([np.arange(k * 9, (k + 1) * 9) for k in range(lo, hi)])])
    tail = path[-1]
    for turn in (0.5, 0.0, -0.5):
        fan = sheet([(0, -0.02 * x), (0.2 * x, -0.07 * x), (0.2 * x, 0.07 * x), (0, 0.02 * x)], 0.12 * z)
        d.add(fan.turned("z", turn - 0.25).moved(tail[0], tail[1], 0.5 * z), shade(d.colour, 0.8))
    head = path[0]
    for side in (-0.02, 0.04):
        d.add(
            tube([tuple(head), (head[0] - 0.05 * x + side * x, head[1] - 0.2 * y, 0.7 * z)], 0.03 * z, 4),
            shade(d.colour, 0.8),
        )


@form
def lobster(d: Draft) -> None:
    x, y, z = d.size
    dark = shade(d.colour, 0.75)
    profile = [(0, 0), (0.12, 0.03), (0.2, 0.12), (0.24, 0.28), (0.2, 0.42), (0, 0.42)]
    d.add(
        lathe(profile, 10)
        .turned("y", np.pi / 2)
        .scaled(x, y * 0.9, z * 1.6)
        .moved(-0.25 * x, 0, 0.4 * z)
        .flattened(0.2),
        None,
        "gloss",
    )
    for k in range(5):
        w = (0.2 - 0.018 * k) * 2
        ring = ball(
            (0.11 * x, w * 0.9 * y, (0.62 - 0.05 * k) * z), ((0.19 + 0.07 * k) * x, 0, (0.36 - 0.02 * k) * z), 8, 5
        )
        d.add(ring, d.colour if k % 2 else dark, "gloss")
    for turn in (-0.6, -0.3, 0, 0.3, 0.6):
        fan = sheet(
            [(0, -0.02 * x), (0.15 * x, -0.045 * x), (0.17 * x, 0), (0.15 * x, 0.045 * x), (0, 0.02 * x)], 0.05 * z
        )
        d.add(fan.turned("z", turn).moved(0.5 * x, 0, 0.25 * z), dark)
    for side in (-1, 1):
        elbow, wrist = (-0.25 * x, side * 0.3 * y, 0.3 * z), (-0.42 * x, side * 0.32 * y, 0.3 * z)
        d.add(tube([(-0.1 * x, side * 0.14 * y, 0.3 * z), elbow, wrist], [0.022 * x, 0.025 * x, 0.03 * x], 6), dark)
        claw = ball((0.22 * x, 0.2 * y, 0.5 * z), (-0.53 * x, side * 0.32 * y, 0.3 * z), 8, 6)
        d.body(claw.flattened(0.1), None, "gloss")
        pincer = tube(
            [
                (-0.56 * x, side * 0.22 * y, 0.3 * z),
                (-0.66 * x, side * 0.19 * y, 0.3 * z),
                (-0.72 * x, side * 0.26 * y, 0.3 * z),
            ],
            [0.03 * x, 0.022 * x, 0.0],
            6,
        )
        d.add(pincer, dark, "gloss")
        d.add(
            tube(
                [
                    (-0.6 * x, side * 0.36 * y, 0.3 * z),
                    (-0.68 * x, side * 0.36 * y, 0.3 * z),
                    (-0.74 * x, side * 0.3 * y, 0.3 * z),
                ],
                [0.035 * x, 0.028 * x, 0.0],
                6,
            ),
            d.colour,
            "gloss",
        )
        for k in range(3):
            leg = [
                ((0.0 + 0.06 * k) * x, side * 0.15 * y, 0.3 * z),
                ((0.02 + 0.07 * k) * x, side * 0.34 * y, 0.35 * z),
                ((0.05 + 0.08 * k) * x, side * 0.42 * y, 0.02 * z),
            ]
            d.add(tube(leg, 0.009 * x, 4), dark)
        d.add(
            tube(
                [
                    (-0.22 * x, side * 0.05 * y, 0.5 * z),
                    (-0.5 * x, side * 0.1 * y, 0.95 * z),
                    (-0.65 * x, side * 0.06 * y, 1.0 * z),
                ],
                0.005 * x,
                4,
            ),
            dark,
        )
        d.add(ball(0.028 * x, (-0.2 * x, side * 0.07 * y, 0.62 * z), 6, 4), (0.05, 0.05, 0.05))
    d.box((0.62 * x, 0.34 * y, 0.6 * z), (0.16 * x, 0, 0.3 * z))
    d.box((0.18 * x, 0.06 * y, 0.3 * z), (-0.3 * x, 0.3 * y, 0.3 * z))
    d.box((0.18 * x, 0.06 * y, 0.3 * z), (-0.3 * x, -0.3 * y, 0.3 * z))
