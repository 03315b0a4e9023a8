"""Fruit and vegetables made of several pieces, and slices of them."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.produce import DARK_LEAF, LEAF, STEM, leaf
from robocasa_lerobot.envs.objects.mesh import Mesh, arc, ball, lathe, lumpy, prism, tube
from robocasa_lerobot.envs.objects.paint import Rgb, canvas, gradient, mix, pixels, shade, speckled, stripes


@form
def banana(d: Draft) -> None:
    x, y, z = d.size
    t = np.linspace(-1, 1, 8)
    bend = 0.8
    path = np.column_stack([np.sin(bend * t), 1 - np.cos(bend * t), np.zeros(8)])
    path = path / [np.ptp(path[:, 0]), np.ptp(path[:, 1]), 1] * [x, max(y - z, 0.01), 1] + [0, 0, z / 2]
    radii = np.array([0.16, 0.36, 0.48, 0.5, 0.5, 0.47, 0.34, 0.14]) * z
    mesh = tube(path, radii, 7).flattened(0.08)
    tip: Rgb = (0.30, 0.22, 0.10)
    paint = gradient([tip, d.colour, d.colour, mix(d.colour, (0.5, 0.6, 0.2), 0.4), tip], [0, 0.12, 0.7, 0.93, 1], 32)
    for a, b in ((0, 3), (2, 6), (5, 8)):
        rows = np.concatenate([np.arange(k * 8, (k + 1) * 8) for k in range(a, b)])
        d.hull(mesh.vertices[rows])
    d.add(mesh, paint, "satin")
    end = path[-1]
    d.add(tube([tuple(end), tuple(end + [0.09 * x, 0.05 * x, 0.0])], [0.15 * z, 0.13 * z], 6), tip)


@form
def grapes(d: Draft) -> None:
    x, y, z = d.size
    r = 0.17 * y
    dark = shade(d.colour, 0.78)
    points = []
    for row, count in enumerate((1, 2, 3, 4, 4, 3)):
        for k in range(count):
            points.append((-0.44 * x + row * 1.45 * r, (k - (count - 1) / 2) * 1.6 * r, r))
    for row, count in enumerate((1, 2, 3, 3)):
        for k in range(count):
            points.append((-0.36 * x + row * 1.5 * r, (k - (count - 1) / 2) * 1.6 * r, 2.4 * r))
    for k, p in enumerate(points):
        jitter = d.rng.uniform(-0.12, 0.12, 3) * r
        d.add(ball(2 * r, np.array(p) + jitter, 6, 4), d.colour if k % 3 else dark, "satin")
    last = points[19][0] if len(points) > 19 else 0.4 * x
    end = max(p[0] for p in points)
    d.add(tube([(end - r, 0, 2 * r), (end + r, 0, 2.6 * r), (end + 2.6 * r, 0.6 * r, 2.6 * r)], 0.16 * r, 5), STEM)
    del last
    low = np.array([[p[0], p[1], p[2]] for p in points])
    cloud = np.concatenate(
        [
            low + r * np.array(o)
            for o in (
                (1, 0, 0),
                (-1, 0, 0),
                (0, 1, 0),
                (0, -1, 0),
                (0, 0, 1),
                (0, 0, -1),
                (0.6, 0.6, -0.5),
                (-0.6, 0.6, -0.5),
                (0.6, -0.6, -0.5),
                (-0.6, -0.6, -0.5),
            )
        ]
    )
    d.hull(np.column_stack([cloud[:, 0], cloud[:, 1], np.maximum(cloud[:, 2], 0.12 * r)]))


@form
def cherry(d: Draft) -> None:
    """Two cherries with their stalks."""
    x, y, z = d.size
    r = 0.25 * x
    top = np.array([0.05 * x, 0.7 * y, 3.4 * r])
    d.rolls = True
    for side in (-1, 1):
        one = lathe([(0, 0), (0.3, 0.05), (0.5, 0.45), (0.42, 0.85), (0.2, 1), (0, 0.9)], 10).fitted(
            (2 * r, 2 * r, 1.9 * r)
        )
        d.body(one.flattened(0.08).moved(side * 1.02 * r), None, "gloss")
        start = np.array([side * 1.0 * r, 0, 1.7 * r])
        middle = (start + top) / 2 + [0, 0, 0.5 * r]
        d.add(tube([tuple(start), tuple(middle), tuple(top)], 0.07 * r, 5), (0.35, 0.42, 0.14))
    d.add(leaf(0.5 * y, 0.25 * y, lift=0.1).turned("z", 0.5).moved(*top), LEAF)


@form
def raspberry(d: Draft) -> None:
    x, y, z = d.size
    d.rolls = True
    d.hull(lathe([(0, 0), (0.34, 0.04), (0.5, 0.4), (0.42, 0.75), (0.2, 1), (0, 1)], 10).fitted(d.size))
    d.add(
        lathe([(0, 0), (0.34, 0.04), (0.44, 0.4), (0.36, 0.75), (0, 0.95)], 8).fitted((0.8 * x, 0.8 * y, 0.95 * z)),
        shade(d.colour, 0.6),
    )
    for row, (count, radius) in enumerate(((8, 0.36), (8, 0.4), (7, 0.33), (5, 0.22), (1, 0.0))):
        for k in range(count):
            a = 2 * np.pi * (k + 0.5 * (row % 2)) / count
            where = (radius * x * np.cos(a), radius * x * np.sin(a), (0.14 + 0.19 * row) * z)
            d.add(ball(0.27 * x, where, 6, 4), d.colour if (k + row) % 2 else shade(d.colour, 0.85), "satin")


def florets(d: Draft, count: int, radius: float, low: float, high: float, paint: object, bump: float) -> None:
    """A crown of lumpy balls on a dome between heights `low` and `high`."""
    golden = 2.399963
    for k in range(count):
        share = (k + 0.5) / count
        r = radius * np.sqrt(share)
        z = high - (high - low) * share**1.5
        size = bump * (1.1 - 0.25 * share)
        one = lumpy(d.rng, ball(size, (0, 0, 0), 7, 5), 0.25, 4)
        d.add(one.moved(r * np.cos(golden * k), r * np.sin(golden * k), z - size * 0.5), paint)  # type: ignore[arg-type]


@form
def broccoli(d: Draft) -> None:
    x, y, z = d.size
    trunk: Rgb = (0.55, 0.68, 0.33)
    d.add(lathe([(0, 0), (0.17 * x, 0), (0.14 * x, 0.3 * z), (0.2 * x, 0.5 * z), (0, 0.52 * z)], 8), trunk)
    for k in range(4):
        a = np.pi / 4 + k * np.pi / 2
        tip = (0.3 * x * np.cos(a), 0.3 * x * np.sin(a), 0.62 * z)
        d.add(tube([(0, 0, 0.25 * z), tip], [0.09 * x, 0.08 * x], 6), trunk)
    paint = speckled(d.colour, shade(d.colour, 0.65), 0.4, d.seed)
    florets(d, 12, 0.34 * x, 0.66 * z, z, paint, 0.36 * x)
    d.cylinder(0.16 * x, 0.0, 0.5 * z)
    d.hull(lathe([(0, 0.42), (0.4, 0.5), (0.5, 0.68), (0.36, 0.9), (0.15, 1), (0, 1)], 10).scaled(x, y, z))


@form
def cauliflower(d: Draft) -> None:
    x, _, z = d.size
    paint = speckled(d.colour, shade(d.colour, 0.86), 0.35, d.seed)
    florets(d, 16, 0.36 * x, 0.55 * z, z, paint, 0.3 * x)
    d.hull(lathe([(0, 0), (0.3, 0), (0.48, 0.4), (0.48, 0.7), (0.3, 0.95), (0, 1)], 12).scaled(x, x, z))
    d.add(lathe([(0, 0), (0.2 * x, 0), (0.42 * x, 0.5 * z), (0, 0.7 * z)], 10), shade(d.colour, 0.9))
    for k in range(7):
        a = 2 * np.pi * k / 7
        one = leaf(0.85 * z, 0.5 * x, lift=-0.12).turned("y", -1.15).moved(0.32 * x, 0, 0.0).turned("z", a)
        d.add(one, LEAF if k % 2 else mix(LEAF, (0.6, 0.75, 0.35), 0.5))


@form
def celery(d: Draft) -> None:
    x, y, z = d.size
    pale = mix(d.colour, (0.9, 0.95, 0.75), 0.5)
    for k in range(5):
        side = (k - 2) / 2
        rise = 0.32 * z if k % 2 else 0.22 * z
        path = [
            (-0.5 * x, 0.5 * side * 0.5 * y, rise),
            (0.0, side * 0.32 * y, rise),
            (0.28 * x, side * 0.38 * y, rise * 1.3),
        ]
        d.add(tube(path, [0.2 * z, 0.17 * z, 0.1 * z], 7), gradient([pale, d.colour, d.colour], None, 16), "satin")
        for side2 in (-0.6, 0.0, 0.6):
            blade = leaf(0.17 * x, 0.25 * y, lift=0.5).turned("z", side2 + side * 0.3)
            d.add(blade.moved(0.27 * x, side * 0.38 * y, rise * 1.3), LEAF if side2 else DARK_LEAF)
    d.hull(
        np.array(
            [
                (sx, sy * w, sz)
                for sx, w in ((-0.5 * x, 0.4 * y), (0.3 * x, 0.5 * y))
                for sy in (-1, 1)
                for sz in (0.03 * z, 0.5 * z)
            ]
        )
    )
    d.box((0.17 * x, 0.7 * y, 0.4 * z), (0.38 * x, 0, 0.35 * z))


@form
def asparagus(d: Draft) -> None:
    x, y, z = d.size
    for k in range(4):
        r = 0.26 * min(y / 2, z)
        side, up = ((-1.5, 1), (0, 1), (1.5, 1), (0.1, 2.7))[k]
        cy, cz = side * 1.25 * r, up * r
        path = [(-0.5 * x, cy, cz), (0.2 * x, cy, cz), (0.36 * x, cy, cz), (0.44 * x, cy, cz), (0.5 * x, cy, cz)]
        pale = mix(d.colour, (0.85, 0.85, 0.7), 0.5)
        paint = gradient([pale, d.colour, d.colour, (0.33, 0.32, 0.3)], [0, 0.3, 0.7, 1], 24)
        d.add(tube(path, [r, r * 0.9, r * 1.05, r * 0.8, 0.0], 7), paint)
        for j in range(3):
            d.add(
                leaf(0.05 * x, 1.1 * r, lift=0.0).turned("y", -0.3).moved(0.28 * x - 0.12 * x * j, cy, cz + 0.75 * r),
                shade(d.colour, 0.7),
            )
    for end in (-0.3, 0.3):
        d.add(
            tube([(end * 0.5 * x, 0, 1.45 * r), (end * 0.5 * x + 0.015 * x, 0, 1.45 * r)], 3.05 * r, 10, flat=0.78),
            (0.55, 0.25, 0.5),
        )
    d.hull(
        np.array(
            [(sx * x / 2, sy * 2.8 * r, 0.1 * r) for sx in (-1, 1) for sy in (-1, 1)]
            + [(sx * x / 2, sy * 1.3 * r, 3.4 * r) for sx in (-1, 1) for sy in (-1, 1)]
        )
    )


@form
def ginger(d: Draft) -> None:
    x, y, z = d.size
    paint = stripes(d.colour, shade(d.colour, 0.82), 1, duty=0.0)
    rings = speckled(d.colour, shade(d.colour, 0.75), 0.2, d.seed)
    del paint
    main = tube(
        [(-0.45 * x, 0, 0.4 * z), (0, 0.03 * y, 0.45 * z), (0.45 * x, -0.02 * y, 0.4 * z)],
        [0.3 * z, 0.4 * z, 0.32 * z],
        8,
    )
    root = d.body(lumpy(d.rng, main, 0.15).flattened(0.2), rings)
    floor = float(root.vertices[:, 2].min())
    for k, (where, side, up) in enumerate(((-0.22, 1, 0.05), (0.05, -1, 0.05), (0.25, 1, 0.15))):
        end = (where * x + 0.12 * x, side * 0.4 * y, (0.42 + up) * z)
        knob = tube(
            [(where * x, 0, 0.42 * z), (where * x + 0.04 * x, side * 0.25 * y, 0.45 * z), end],
            [0.3 * z, 0.32 * z, 0.2 * z],
            7,
        )
        piece = lumpy(d.rng, knob, 0.15).above(floor + 0.0005)
        if k < 2:
            d.hull(piece)
        d.add(piece, rings)
        d.add(ball(0.3 * z, end, 6, 4), mix(d.colour, (0.95, 0.9, 0.6), 0.5))


@form
def slice_round(d: Draft) -> None:
    """A slice of something round, its cut face up: tomato, pickle."""
    x, _, z = d.size
    rim = shade(d.colour, 0.8)
    image, draw = canvas(rim, 40, 40)

    def colour(rgb: Rgb) -> tuple[int, int, int]:
        return tuple(int(255 * c) for c in rgb)  # type: ignore[return-value]

    draw.ellipse((2, 2, 37, 37), fill=colour(mix(d.colour, (1.0, 0.9, 0.7), 0.25)))
    cells = int(d.args.get("cells", 5))
    for k in range(cells):
        a = 2 * np.pi * k / cells
        cx, cy = 20 + 9.5 * np.cos(a), 20 + 9.5 * np.sin(a)
        draw.ellipse((cx - 5, cy - 5, cx + 5, cy + 5), fill=colour(shade(d.colour, 0.86)))
        for j in (-2, 0, 2):
            draw.point((cx + j, cy + j / 2), fill=(245, 230, 160))
            draw.point((cx + j, cy - j), fill=(245, 230, 160))
    face = pixels(image)
    outline = arc(x / 2, 0, 2 * np.pi, 15)[:-1]
    d.cylinder(x / 2, 0, z)
    d.add(prism(outline, 0, z * 0.98, smooth=True), rim, "gloss")
    d.add(_disc(x / 2 * 0.99, z), face, "gloss")


def _disc(radius: float, z: float, n: int = 14) -> Mesh:
    from robocasa_lerobot.envs.objects.mesh import polygon

    return polygon(arc(radius, 0, 2 * np.pi, n + 1)[:-1]).moved(z=z)


@form
def wedge(d: Draft) -> None:
    """A wedge of lemon: two cut faces with segments, the peel below."""
    x, y, z = d.size
    image, draw = canvas((0.99, 0.98, 0.93), 40, 40)
    fill = tuple(int(255 * c) for c in mix(d.colour, (0.95, 0.75, 0.1), 0.35))
    for k in range(5):
        a = np.pi * (k + 0.5) / 5
        draw.pieslice((3, -17, 37, 17), 180 * k / 5 + 5, 180 * (k + 1) / 5 - 5, fill=fill)
        del a
    cut = pixels(image)
    t = np.linspace(0, np.pi, 9)
    half, drop = x / 2, z
    rim = np.column_stack([-np.cos(t) * half, np.zeros(9), -np.sin(t) * drop])
    left = rim + np.column_stack([np.zeros(9), 0.0 * t, np.zeros(9)])
    # Two half discs that share the edge at the top and spread downwards.
    for side in (-1, 1):
        spread = left.copy()
        spread[:, 1] = side * np.sin(t) * y / 2
        points = np.concatenate([[[0.0, 0.0, 0.0]], spread])
        faces = [(0, k, k + 1) if side < 0 else (0, k + 1, k) for k in range(1, 9)]
        uv = np.column_stack([0.5 - 0.46 * points[:, 0] / half, 1 + 0.9 * points[:, 2] / drop * 0.5 - 0.02])
        d.add(Mesh(points + [0, 0, z], np.array(faces), uv, np.zeros(10, int)), cut, "gloss")
    peel, faces = [], []
    for k in range(9):
        for side in np.linspace(-1, 1, 4):
            bulge = 1 + 0.12 * (1 - side**2)
            peel.append((rim[k, 0], side * np.sin(t[k]) * y / 2, rim[k, 2] * bulge + z))
    for k in range(8):
        for j in range(3):
            a = k * 4 + j
            faces += [(a, a + 4, a + 5), (a, a + 5, a + 1)]
    mesh = Mesh(np.array(peel), np.array(faces)[:, ::-1].copy(), np.zeros((36, 2)), np.arange(36)).flattened(0.12)
    d.add(mesh, speckled(d.colour, shade(d.colour, 0.9), 0.2, d.seed), "satin")
    d.hull(np.concatenate([mesh.vertices, [[half * 0.95, 0, z], [-half * 0.95, 0, z]]]))


@form
def tofu(d: Draft) -> None:
    x, y, z = d.size
    from robocasa_lerobot.envs.objects.mesh import cushion

    d.add(cushion(d.size, 0.06, 0.06, 2), speckled(d.colour, shade(d.colour, 0.93), 0.08, d.seed), "satin")
    d.box(d.size, (0, 0, z / 2))
