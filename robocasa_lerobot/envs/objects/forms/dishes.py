"""Dishes made of meat, fish and dough."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.meat_parts import facing, upper_face
from robocasa_lerobot.envs.objects.forms.produce import ROUND
from robocasa_lerobot.envs.objects.mesh import (
    Array,
    Mesh,
    arc,
    ball,
    bent,
    box,
    lathe,
    lumpy,
    prism,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Rgb,
    gradient,
    mix,
    shade,
    speckled,
    stripes,
)


@form
def skewer(d: Draft) -> None:
    """Pieces on a stick: kebabs, skewers."""
    x, y, z = d.size
    stick: Rgb = (0.80, 0.66, 0.42) if d.args.get("stick", "wood") == "wood" else (0.75, 0.76, 0.78)
    d.add(tube([(-0.5 * x, 0, 0.5 * z), (0.5 * x, 0, 0.5 * z)], [0.06 * z, 0.03 * z], 6), stick, "satin")
    red: Rgb = (0.78, 0.14, 0.1)
    row = ((d.colour, "cube"), (red, "disc"), ((0.35, 0.55, 0.2), "disc"))
    count = int(d.args.get("pieces", 7))
    start, stop = -0.3 * x, 0.44 * x
    step = (stop - start) / count
    for k in range(count):
        rgb, kind = row[k % 3] if d.args.get("mixed", True) else (shade(d.colour, 0.9 + 0.1 * (k % 2)), "cube")
        middle = start + (k + 0.5) * step
        if kind == "cube":
            piece = lumpy(d.rng, ball((1.15 * step, 0.92 * y, 0.95 * z), (0, 0, 0), 8, 6), 0.15)
            d.add(piece.moved(middle, 0, 0.5 * z), speckled(rgb, shade(rgb, 0.65), 0.3, d.seed, blur=True), "satin")
        else:
            disc = (
                lathe([(0, 0), (0.5, 0.1), (0.5, 0.9), (0, 1)], 8)
                .turned("y", np.pi / 2)
                .scaled(0.55 * step, y, 0.95 * z)
            )
            d.add(disc.moved(middle - 0.27 * step, 0, 0.5 * z), rgb, "satin")
    d.box((stop - start, y * 0.9, z * 0.9), ((start + stop) / 2, 0, 0.5 * z))
    d.box((0.2 * x, 0.15 * y, 0.12 * z), (-0.4 * x, 0, 0.5 * z))


@form
def sushi(d: Draft) -> None:
    """Two rolls and a nigiri."""
    x, y, z = d.size
    rice: Rgb = (0.94, 0.93, 0.88)
    nori: Rgb = (0.08, 0.12, 0.09)
    for side in (-1, 1):
        r = 0.24 * y
        at = (-0.26 * x, side * 0.25 * y)
        d.add(lathe([(0, 0), (r, 0), (r, 0.8 * z), (0, 0.8 * z)], 12).moved(*at), nori)
        d.add(upper_face(0.85 * r, *at, 0.81 * z), speckled(rice, shade(rice, 0.85), 0.2, d.seed))
        d.add(upper_face(0.4 * r, *at, 0.83 * z, 8), d.colour, "satin")
        d.cylinder(r, 0, 0.8 * z, *at)
    block = lathe(ROUND, 10).turned("x", np.pi / 2).fitted((0.42 * x, 0.9 * y, 0.72 * z)).flattened(0.1).moved(0.25 * x)
    d.add(block, speckled(rice, shade(rice, 0.85), 0.2, d.seed))
    top = bent(
        lathe(ROUND, 10).turned("x", np.pi / 2).turned("z", np.pi / 2).fitted((0.95 * y, 0.4 * x, 0.34 * z)), 0.01
    ).turned("z", np.pi / 2)
    d.add(top.moved(0.25 * x, 0, 0.62 * z), stripes(d.colour, mix(d.colour, (1, 1, 1), 0.5), 1, duty=0.2), "gloss")
    d.box((0.4 * x, 0.88 * y, 0.9 * z), (0.25 * x, 0, 0.45 * z))


@form
def hamburger(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    bun: Rgb = d.colour
    d.add(lathe([(0, 0), (0.85 * r, 0), (0.95 * r, 0.1 * z), (0.93 * r, 0.26 * z), (0, 0.26 * z)], 14), bun)
    d.add(lathe([(0, 0.26 * z), (0.98 * r, 0.26 * z), (0.98 * r, 0.44 * z), (0, 0.44 * z)], 14), (0.33, 0.18, 0.1))
    cheese = prism(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * 0.76 * r, 0.44 * z, 0.49 * z)
    d.add(cheese, (0.97, 0.75, 0.18))
    frill = lathe([(0.5 * r, 0.5 * z), (1.0 * r, 0.5 * z), (0.98 * r, 0.56 * z), (0.5 * r, 0.56 * z)], 24)
    d.add(
        frill.mapped(
            lambda v: np.column_stack([v[:, :2], v[:, 2] + 0.04 * z * np.sin(7 * np.arctan2(v[:, 1], v[:, 0]))])
        ),
        (0.42, 0.65, 0.22),
    )
    d.add(lathe([(0, 0.56 * z), (0.86 * r, 0.56 * z), (0.86 * r, 0.62 * z), (0, 0.62 * z)], 12), (0.8, 0.16, 0.12))
    d.add(
        lathe(
            [(0, 0.6 * z), (0.97 * r, 0.6 * z), (0.99 * r, 0.7 * z), (0.8 * r, 0.9 * z), (0.4 * r, 0.99 * z), (0, z)],
            14,
        ),
        gradient([mix(bun, (0.95, 0.85, 0.6), 0.5), bun, shade(bun, 0.92)], None, 16),
        "satin",
    )
    for k in range(14):
        a, share = 2.4 * k, 0.15 + 0.55 * ((k * 0.37) % 1)
        height = (0.99 - 0.33 * share**2 * 0.8) * z
        d.add(
            ball((0.07 * x, 0.045 * x, 0.03 * x), (0, 0, 0), 5, 3)
            .turned("z", a)
            .moved(share * r * np.cos(a), share * r * np.sin(a), height),
            (0.96, 0.9, 0.72),
        )
    d.cylinder(0.97 * r, 0.0, 0.72 * z)
    d.hull(lathe([(0.97 * r, 0.7 * z), (0.8 * r, 0.9 * z), (0.4 * r, 0.99 * z)], 10))


@form
def hot_dog(d: Draft) -> None:
    """A sausage in a split bun; without the sausage a bun."""
    x, y, z = d.size
    filled = bool(d.args.get("sausage", True))
    bun_z = 0.78 * z if filled else z
    for side in (-1, 1):
        half = lathe(ROUND, 10).turned("y", np.pi / 2).fitted((0.94 * x, 0.56 * y, bun_z)).flattened(0.08)
        d.add(half.moved(0, side * 0.23 * y), gradient([d.colour, d.colour], None, 4), "satin")
    d.add(box((0.8 * x, 0.3 * y, 0.45 * bun_z), (0, 0, 0.24 * bun_z)), (0.96, 0.9, 0.74))
    d.hull(lathe(ROUND, 12).turned("y", np.pi / 2).fitted((0.94 * x, 1.0 * y, bun_z)).flattened(0.1))
    if filled:
        link = lathe([(0, 0), (0.4, 0.02), (0.5, 0.08), (0.5, 0.92), (0.4, 0.98), (0, 1)], 9).turned("y", np.pi / 2)
        d.add(link.fitted((x, 0.36 * y, 0.45 * z)).moved(z=0.48 * z), (0.66, 0.25, 0.15), "gloss")
        u = np.linspace(-0.42, 0.42, 15)
        zigzag = np.column_stack([u * x, 0.1 * y * np.where(np.arange(15) % 2, 1, -1), np.full(15, 0.95 * z)])
        d.add(tube(zigzag, 0.035 * z, 5), (0.95, 0.78, 0.12))
        d.box((x, 0.3 * y, 0.4 * z), (0, 0, 0.72 * z))


@form
def burrito(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.42, 0.0), (0.5, 0.06), (0.5, 0.9), (0.36, 0.97), (0, 1)]
    mesh = lathe(profile, 12).turned("y", np.pi / 2).scaled(x, y, z).moved(z=z / 2).flattened(0.08)
    d.rolls = True
    d.body(mesh, speckled(d.colour, (0.68, 0.48, 0.25), 0.1, d.seed, blur=True))
    d.add(facing(0.4 * y, 0.4 * z, -0.004 * x, z / 2), speckled((0.5, 0.28, 0.14), (0.35, 0.6, 0.2), 0.35, d.seed))
    d.add(facing(0.2 * y, 0.2 * z, -0.008 * x, z / 2, 8), speckled((0.8, 0.2, 0.12), (0.95, 0.9, 0.6), 0.4, d.seed))
    foil = lathe([(0.505, 0.55), (0.515, 0.6), (0.52, 0.9), (0.38, 0.985), (0, 1.01)], 12).turned("y", np.pi / 2)
    d.add(
        foil.scaled(x, y, z).moved(z=z / 2).flattened(0.09),
        speckled((0.78, 0.79, 0.81), (0.62, 0.63, 0.66), 0.4, d.seed),
        "metal",
    )
    d.half_turn()


@form
def taco(d: Draft) -> None:
    x, y, z = d.size
    t = np.linspace(0, np.pi, 11)
    outer = np.column_stack([np.cos(t) * x / 2, np.sin(t) * 0.95 * z])
    for side in (-1, 1):
        points = np.concatenate(
            [
                np.column_stack([outer[:, 0], np.full(11, side * 0.42 * y) * np.sin(t) ** 0.4, outer[:, 1] + 0.04 * z]),
                np.column_stack([outer[:, 0], np.full(11, 0.12 * side * y), np.full(11, 0.0)]),
            ]
        )
        faces = []
        for k in range(10):
            faces += [(k, k + 1, 11 + k + 1), (k, 11 + k + 1, 11 + k)]
        order = np.array(faces)
        uv = np.column_stack([np.tile(np.linspace(0, 1, 11), 2), np.repeat([1, 0], 11)])
        for turn in (1, -1):
            shell = Mesh(
                points + [0, 0.008 * turn * y, 0], order if turn == side else order[:, ::-1].copy(), uv, np.arange(22)
            )
            d.add(shell, speckled(d.colour, shade(d.colour, 0.78), 0.15, d.seed))
    d.add(
        prism(np.column_stack([outer[:, 0] * 0.9, outer[:, 1] * 0.8]), -0.2 * y, 0.2 * y)
        .turned("x", np.pi / 2)
        .moved(z=0.03 * z),
        (0.42, 0.24, 0.13),
    )
    rng = d.rng
    for k in range(14):
        a = np.pi * (0.12 + 0.76 * k / 13)
        rgb = ((0.42, 0.66, 0.22), (0.82, 0.18, 0.12), (0.97, 0.8, 0.25))[k % 3]
        where = (np.cos(a) * 0.42 * x, rng.uniform(-0.16, 0.16) * y, np.sin(a) * 0.82 * z)
        d.add(ball((0.16 * x, 0.3 * y, 0.14 * z), where, 5, 4), rgb)
    d.hull(
        np.array(
            [
                (px * x, py * y, pz * z)
                for px, pz in ((-0.48, 0.02), (0.48, 0.02), (-0.36, 0.7), (0.36, 0.7), (0, 0.97))
                for py in ((-0.4, 0.4) if pz > 0.1 else (-0.3, 0.3))
            ]
        )
    )


@form
def dumpling(d: Draft) -> None:
    """A half moon with a pleated seam along its top."""
    x, y, z = d.size
    body = lathe(ROUND, 12).turned("y", np.pi / 2).fitted((0.96 * x, 0.9 * y, 0.86 * z))
    d.body(body.flattened(0.14), gradient([shade(d.colour, 0.9), d.colour], None, 8), "satin")
    t = np.linspace(0.02, 0.98, 25) * np.pi
    wave = 0.05 * y * np.where(np.arange(25) % 2, 1.0, -1.0)
    for side in (-1, 1):
        foot = np.column_stack([-np.cos(t) * 0.46 * x, side * 0.1 * y + wave * 0.3, 0.36 * z + np.sin(t) * 0.42 * z])
        crest = np.column_stack([-np.cos(t) * 0.5 * x, side * 0.02 * y + wave, 0.4 * z + np.sin(t) ** 0.7 * 0.6 * z])
        corner = np.arange(24)
        faces = np.concatenate(
            [np.column_stack([corner, corner + 1, corner + 26]), np.column_stack([corner, corner + 26, corner + 25])]
        )
        faces = faces if side < 0 else faces[:, ::-1].copy()
        uv = np.column_stack([np.tile(np.linspace(0, 1, 25), 2), np.repeat([0.0, 1.0], 25)])
        pleats = Mesh(np.concatenate([foot, crest]), faces, uv, np.arange(50))
        d.add(pleats, stripes(d.colour, shade(d.colour, 0.84), 12, duty=0.4))


@form
def slice_flat(d: Draft) -> None:
    """A slice of cold meat, a little wavy."""
    x, y, z = d.size

    def wave(v: Array) -> Array:
        turn = np.arctan2(v[:, 1], v[:, 0])
        r = np.hypot(v[:, 0] / x, v[:, 1] / y) * 2
        return np.column_stack([v[:, 0], v[:, 1], v[:, 2] + 0.28 * z * r**2 * (1 + np.sin(5 * turn))])

    t = np.linspace(0, 1, 5)
    rows = [(0.5 * k, 0.0) for k in t] + [(0.5 * k, 0.4) for k in t[::-1]]
    rim = lathe(rows, 20).scaled(x, y, z).mapped(wave)
    d.add(rim, shade(d.colour, 0.8))
    face = lathe([(0.47 * k, 0.44) for k in t[::-1]], 20).scaled(x, y, z).mapped(wave)
    d.add(face, speckled(d.colour, shade(d.colour, 1.1), 0.3, d.seed, blur=True), "satin")
    circle = arc(0.5, 0, 2 * np.pi, 17)[:-1] * [x, y]
    d.hull(np.concatenate([np.column_stack([circle, np.full(16, height)]) for height in (0.0, 0.7 * z)]))
