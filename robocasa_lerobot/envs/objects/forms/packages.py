"""Cans, boxes, cartons, bags, tubs, and blocks of soap and wax."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.labels import (
    INK,
    STEEL,
    WHITE,
    around,
    name_on,
    printed_box,
)
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    ball,
    box,
    cushion,
    lathe,
    loft,
    polygon,
    prism,
    rounded,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    bytes_of,
    canvas,
    gradient,
    label,
    mix,
    pixels,
    shade,
    speckled,
    stripes,
    write,
)


@form
def can(d: Draft) -> None:
    """A drinks can, or canned food with a paper label."""
    x, _, z = d.size
    r = x / 2
    d.cylinder(r, 0, z)
    if d.args.get("food"):
        d.add(
            lathe(
                [
                    (0, 0),
                    (0.97 * r, 0),
                    (r, 0.02 * z),
                    (0.96 * r, 0.05 * z),
                    (0.96 * r, 0.95 * z),
                    (r, 0.98 * z),
                    (0.97 * r, z),
                    (0.9 * r, z),
                    (0.88 * r, 0.98 * z),
                    (0, 0.98 * z),
                ],
                16,
            ),
            STEEL,
            "metal",
        )
        d.add(
            around(0.975 * r, 0.06 * z, 0.94 * z, 16),
            label(d.colour, shade(d.colour, 0.35), name_on(d), d.seed, around=2),
            "satin",
        )
        d.add(
            lathe([(0.6 * r, 0.985 * z), (0.57 * r, 0.995 * z), (0.54 * r, 0.985 * z)], 14), shade(STEEL, 0.8), "metal"
        )
    else:
        d.add(lathe([(0, 0.02 * z), (0.6 * r, 0.02 * z), (0.72 * r, 0), (r, 0.07 * z)], 16), STEEL, "metal")
        d.add(
            around(r, 0.07 * z, 0.9 * z, 16),
            label(d.colour, shade(d.colour, 0.4), name_on(d), d.seed, around=2),
            "gloss",
        )
        d.add(
            lathe(
                [
                    (r, 0.9 * z),
                    (0.82 * r, 0.98 * z),
                    (0.8 * r, z),
                    (0.74 * r, z),
                    (0.72 * r, 0.975 * z),
                    (0, 0.975 * z),
                ],
                16,
            ),
            STEEL,
            "metal",
        )
        tab = prism(rounded(0.5 * r, 0.3 * r, 0.14 * r, 3), 0.977 * z, 0.99 * z)
        d.add(tab.moved(0.15 * r), shade(STEEL, 0.75), "metal")
        d.add(
            polygon(rounded(0.42 * r, 0.5 * r, 0.2 * r, 3)).moved(-0.38 * r, 0, 0.978 * z), shade(STEEL, 0.6), "metal"
        )


@form
def packet(d: Draft) -> None:
    """A printed box that stands: cereal, boxed food, spaghetti; lying if its record says so."""
    x, y, z = d.size
    printed_box(d, (x, y, z), name_on(d), picture=d.args.get("picture", ""))
    d.add(box((0.5 * x, 0.06 * y, 0.003), (0, 0, z)), shade(d.colour, 0.5))
    d.box((x, y, z), (0, 0, z / 2))


@form
def spaghetti_box(d: Draft) -> None:
    """A long flat box with a window, lying."""
    x, y, z = d.size
    d.add(box((x, y, z), (0, 0, z / 2)), d.colour, "satin")
    image, draw = canvas(d.colour, 64, 32)
    draw.rounded_rectangle((34, 5, 61, 27), 4, fill=(240, 210, 130))
    for k in range(7, 27, 3):
        draw.line((35, k, 60, k), fill=(200, 155, 70))
    write(image, name_on(d), (0.98, 0.96, 0.9), (0.03, 0.25, 0.5, 0.75))
    d.add(
        polygon([(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2)]).moved(z=1.002 * z),
        pixels(image),
        "satin",
    )
    d.box((x, y, z), (0, 0, z / 2))


@form
def carton(d: Draft) -> None:
    """A carton with a gable (milk), or flat with a straw or a cap (juice)."""
    x, y, z = d.size
    kind = d.args.get("top", "gable")
    body = {"gable": 0.78, "straw": 0.84, "cap": 0.95}[kind] * z
    printed_box(d, (x, y, body), name_on(d), picture=d.args.get("picture", "fruit"))
    d.box((x, y, body), (0, 0, body / 2))
    light = mix(d.colour, WHITE, 0.6)
    if kind == "gable":
        roof = np.array([(-y / 2, body), (y / 2, body), (0, 0.94 * z)])
        gable = prism(roof, -x / 2, x / 2).turned("x", np.pi / 2).turned("z", np.pi / 2)
        d.add(gable, light, "satin")
        d.hull(gable)
        d.add(box((x, 0.05 * y, 0.09 * z), (0, 0, 0.955 * z)), light, "satin")
        cap = lathe([(0.18 * y, 0), (0.18 * y, 0.05 * z), (0, 0.05 * z)], 10).turned("x", 0.85)
        d.add(cap.moved(0, -0.24 * y, 0.875 * z), shade(d.colour, 0.6), "satin")
    elif kind == "straw":
        path = [(0.3 * x, 0.1 * y, body), (0.3 * x, 0.1 * y, 0.95 * z), (0.12 * x, 0.1 * y, z)]
        d.add(tube(path, 0.05 * y, 6), stripes(WHITE, (0.85, 0.2, 0.2), 1, duty=0.5))
        d.add(box((x, 0.04 * y, 0.01 * z), (0, 0, body)), light)
        d.box((0.1 * x, 0.1 * y, z - body), (0.3 * x, 0.1 * y, (body + z) / 2))
    else:
        d.add(lathe([(0.24 * y, body), (0.24 * y, z), (0, z)], 10).moved(0.0, 0.0), shade(d.colour, 0.6), "satin")
        d.cylinder(0.24 * y, body, z)


@form
def bag(d: Draft) -> None:
    """A pillow bag: chips, bagged food (standing) or a wrapped bar (lying)."""
    x, y, z = d.size
    lying = bool(d.args.get("lying"))
    u = np.linspace(-1, 1, 7)
    w = np.linspace(-1, 1, 9)
    thick, tall = (z, y) if lying else (y, z)
    grid_u, grid_w = np.meshgrid(u, w)
    bulge = ((1 - grid_u**4) * (1 - grid_w**4)) ** 0.5 * thick / 2
    wrinkle = 1 + 0.1 * np.sin(7 * grid_u + d.seed % 7) * np.sin(5 * grid_w)
    crimp = 0.06 * thick * np.sin(20 * grid_u) * (np.abs(grid_w) > 0.9)
    pinch = 1 - 0.05 * (1 - grid_w**2)
    count = 63
    layers, faces = [], []
    for side in (-1, 1):
        points = np.stack([grid_u * x / 2 * pinch, side * bulge * wrinkle + crimp, grid_w * tall / 2], axis=-1)
        layers.append(points.reshape(-1, 3))
    for i in range(8):
        for j in range(6):
            a = i * 7 + j
            faces += [(a, a + 1, a + 8), (a, a + 8, a + 7)]
            b = a + count
            faces += [(b, b + 8, b + 1), (b, b + 7, b + 8)]
    uv = np.stack([(grid_u + 1) / 2, (grid_w + 1) / 2], axis=-1).reshape(-1, 2)
    mirrored = np.column_stack([1 - uv[:, 0], uv[:, 1]])
    mesh = Mesh(np.concatenate(layers), np.array(faces), np.concatenate([uv, mirrored]), np.arange(2 * count))
    if lying:
        mesh = mesh.turned("x", -np.pi / 2)
    image, draw = canvas(d.colour, 48, 64)
    draw.ellipse((4, 14, 44, 38), fill=bytes_of(mix(d.colour, WHITE, 0.8)))
    write(image, name_on(d), shade(d.colour, 0.45), (0.14, 0.28, 0.86, 0.52))
    draw.rectangle((0, 0, 48, 4), fill=bytes_of(shade(d.colour, 0.7)))
    draw.rectangle((0, 60, 48, 64), fill=bytes_of(shade(d.colour, 0.7)))
    for k in range(5):
        if d.args.get("picture") == "chips":
            draw.ellipse((4 + k * 8, 44 + (k % 2) * 4, 14 + k * 8, 56 + (k % 2) * 3), fill=(240, 200, 90))
        else:
            draw.rectangle((7 + k * 7, 46, 11 + k * 7, 56), fill=bytes_of(mix(d.colour, (0.9, 0.7, 0.4), 0.8)))
    picture = pixels(image)
    d.add(mesh, picture, "gloss")
    if lying:
        d.box((0.97 * x, 0.9 * y, 0.8 * z), (0, 0, 0))
        d.box((0.9 * x, 0.6 * y, z), (0, 0, 0))
    else:
        # A broad foot, so that it stands.
        d.box((0.95 * x, 0.62 * y, z), (0, 0, 0))
        d.box((0.8 * x, y, 0.6 * z), (0, 0, 0))


@form
def flour_bag(d: Draft) -> None:
    x, y, z = d.size
    d.add(
        loft(
            [
                rounded(0.96 * x, 0.96 * y, 0.01, 2),
                rounded(x, y, 0.012, 2),
                rounded(0.97 * x, y, 0.012, 2),
                rounded(0.9 * x, 0.6 * y, 0.01, 2),
            ],
            [0, 0.1 * z, 0.75 * z, 0.9 * z],
        ),
        d.colour,
    )
    d.add(box((0.92 * x, 0.3 * y, 0.12 * z), (0, 0, 0.92 * z)), shade(d.colour, 0.92))
    words = name_on(d)
    for side in (-1, 1):
        face = polygon([(-0.4 * x, 0), (0.4 * x, 0), (0.4 * x, 0.6 * z), (-0.4 * x, 0.6 * z)]).turned("x", np.pi / 2)
        if side > 0:
            face = face.turned("z", np.pi)
        d.add(
            face.moved(0, side * 0.505 * y, 0.12 * z),
            label(d.colour, (0.2, 0.3, 0.6), words, d.seed, accent=(0.85, 0.75, 0.45)),
        )
    d.box((0.96 * x, 0.96 * y, 0.85 * z), (0, 0, 0.425 * z))
    d.box((0.9 * x, 0.35 * y, 0.15 * z), (0, 0, 0.925 * z))


@form
def tub(d: Draft) -> None:
    """Yogurt: a tapered pot with a foil lid."""
    x, _, z = d.size
    r = x / 2
    d.add(
        lathe([(0, 0), (0.74 * r, 0), (0.76 * r, 0.03 * z), (0.94 * r, 0.94 * z)], 16),
        label(WHITE, shade(d.colour, 0.6), name_on(d), d.seed, around=2, accent=mix(d.colour, WHITE, 0.4)),
        "satin",
    )
    d.add(
        lathe([(0.94 * r, 0.93 * z), (r, 0.95 * z), (r, 0.99 * z), (0.96 * r, z), (0, z)], 16),
        mix(d.colour, STEEL, 0.4),
        "metal",
    )
    tab = prism([(0.9 * r, -0.2 * r), (1.16 * r, 0), (0.9 * r, 0.2 * r)], 0.975 * z, 0.99 * z)
    d.add(tab, mix(d.colour, STEEL, 0.4), "metal")
    d.hull(lathe([(0.74 * r, 0), (0.98 * r, 0.95 * z), (0.98 * r, z)], 10))


@form
def paper_cup(d: Draft) -> None:
    """Coffee to go: a tapered cup with sleeve and lid."""
    x, _, z = d.size
    r = x / 2
    d.add(lathe([(0, 0), (0.7 * r, 0), (0.93 * r, 0.88 * z)], 16), WHITE, "satin")
    sleeve = lathe([(0.79 * r, 0.25 * z), (0.9 * r, 0.66 * z)], 16)
    d.add(sleeve, label(d.colour, shade(d.colour, 0.4), name_on(d, "COFFEE"), d.seed, around=2))
    d.add(
        lathe(
            [
                (0.96 * r, 0.86 * z),
                (r, 0.88 * z),
                (0.98 * r, 0.92 * z),
                (0.86 * r, 0.94 * z),
                (0.84 * r, z),
                (0.7 * r, z),
                (0.68 * r, 0.96 * z),
                (0, 0.96 * z),
            ],
            16,
        ),
        tuple(d.args.get("lid", (0.15, 0.13, 0.12))),
        "satin",
    )
    d.hull(lathe([(0.7 * r, 0), (0.97 * r, 0.88 * z), (0.84 * r, z)], 10))


@form
def candle(d: Draft) -> None:
    """A pillar candle in a glass, or bare, with wick and flame."""
    x, _, z = d.size
    r = x / 2
    body = 0.82 * z
    d.add(
        lathe([(0, 0.0), (r, 0.0), (r, 0.97 * body), (0.9 * r, body), (0.6 * r, 0.96 * body), (0, 0.95 * body)], 14),
        gradient([shade(d.colour, 0.85), d.colour, d.colour], None, 8),
        "satin",
    )
    d.add(tube([(0, 0, 0.93 * body), (0, 0, 0.89 * z)], 0.03 * r, 5), INK)
    d.add(lathe([(0, 0.86 * z), (0.11 * r, 0.9 * z), (0.07 * r, 0.96 * z), (0, z)], 7), (1.0, 0.78, 0.2), "gloss")
    for k in range(3):
        a = 2.1 * k
        d.add(
            ball((0.14 * r, 0.14 * r, 0.25 * body), (r * np.cos(a), r * np.sin(a), (0.82 - 0.07 * k) * body), 6, 5),
            d.colour,
            "satin",
        )
    d.cylinder(r, 0, body)
    d.cylinder(0.1 * r, body, z)


@form
def block(d: Draft) -> None:
    """A plain block with soft edges: bar of soap, sponge with a scouring pad."""
    x, y, z = d.size
    kind = d.args.get("kind", "soap")
    if kind == "sponge":
        d.add(cushion((x, y, 0.8 * z), 0.12, 0.06, 2), speckled(d.colour, shade(d.colour, 0.75), 0.15, d.seed))
        d.add(box((x, y, 0.22 * z), (0, 0, 0.89 * z)), speckled((0.16, 0.42, 0.24), (0.1, 0.3, 0.18), 0.3, d.seed))
    else:
        d.add(cushion((x, y, z), 0.5, 0.3, 4), d.colour, "gloss")
        image, _ = canvas(d.colour, 48, 24)
        write(image, "SOAP", shade(d.colour, 0.78), (0.15, 0.15, 0.85, 0.85))
        d.add(polygon(rounded(0.6 * x, 0.5 * y, 0.2 * y, 3)).moved(z=1.004 * z), pixels(image), "gloss")
    d.box((x, y, z), (0, 0, z / 2))


@form
def foil_roll(d: Draft) -> None:
    """A long box of foil, the foil showing at its front."""
    x, y, z = d.size
    d.add(box((x, y, z), (0, 0, z / 2)), label(d.colour, shade(d.colour, 0.4), name_on(d, "FOIL"), d.seed), "satin")
    d.add(box((0.96 * x, 0.3 * y, 0.02 * z), (0, -0.4 * y, 1.0 * z)), (0.82, 0.83, 0.85), "metal")
    d.add(box((0.96 * x, 0.02 * y, 0.35 * z), (0, -0.505 * y, 0.83 * z)), (0.82, 0.83, 0.85), "metal")
    d.box((x, y, z), (0, 0, z / 2))


@form
def straw(d: Draft) -> None:
    """A drinking straw, or a bunch of two, lying; bent at its end."""
    x, y, z = d.size
    r = 0.5 * z
    path = [(-0.5 * x, 0, r), (0.26 * x, 0, r), (0.32 * x, 0.1 * y, r), (0.5 * x, y - 2 * r, r)]
    mesh = tube(path, r, 7)
    d.add(mesh, stripes(WHITE, d.colour, 3, duty=0.5), "satin")
    d.rolls = True
    d.box((0.78 * x, 2 * r, 2 * r), (-0.11 * x, 0, r))
    d.hull(mesh.vertices[8:32])
