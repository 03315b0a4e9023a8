"""Fruit that is turned on a lathe."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.produce import (
    DARK_LEAF,
    DIMPLED,
    LEAF,
    ROUND,
    STEM,
    blush,
    leaf,
    lying,
    rosette,
    standing,
    stem,
)
from robocasa_lerobot.envs.objects.mesh import (
    arc,
    ball,
    lathe,
    lumpy,
    polygon,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Paint,
    bytes_of,
    canvas,
    gradient,
    mix,
    netted,
    pixels,
    shade,
    speckled,
    stripes,
)


@form
def apple(d: Draft) -> None:
    x, _, z = d.size
    standing(d, DIMPLED, blush(d, (0.93, 0.75, 0.35)), "gloss")
    d.add(stem(0.2 * z, 0.03 * x, 0.9 * z), STEM)
    d.add(leaf(0.38 * x, 0.2 * x).moved(z=0.96 * z), LEAF)


@form
def stone_fruit(d: Draft) -> None:
    """Peach, apricot: a crease from pole to pole, a blush."""
    x, _, z = d.size
    body = lathe(ROUND, 16).fitted(d.size)
    creased = body.mapped(
        lambda v: v * (1 - 0.07 * np.exp(-((np.arctan2(v[:, 1], v[:, 0]) / 0.28) ** 2))[:, None] * [1, 1, 0])
    )
    d.rolls = True
    d.body(
        creased.flattened(0.04), gradient([d.colour, mix(d.colour, (0.8, 0.2, 0.2), 0.45), d.colour], None, 24), "matte"
    )
    d.add(stem(0.07 * z, 0.035 * x, 0.97 * z), STEM)
    if d.args.get("leaf"):
        d.add(leaf(0.5 * x, 0.22 * x, lift=0.1).moved(z=1.0 * z), LEAF)


@form
def citrus(d: Draft) -> None:
    """Orange, tangerine: pores, a navel; tangerine with a leaf."""
    x, _, z = d.size
    standing(d, ROUND, speckled(d.colour, shade(d.colour, 0.9), 0.2, d.seed), "satin")
    d.add(lathe([(0.07 * x, 0.97 * z), (0.06 * x, 1.0 * z), (0, 1.0 * z)], 8), (0.35, 0.45, 0.15))
    if d.args.get("leaf"):
        d.add(leaf(0.55 * x, 0.26 * x, lift=0.05).moved(z=0.99 * z), LEAF)
        d.add(leaf(0.45 * x, 0.22 * x, lift=0.05).turned("z", 2.4).moved(z=0.99 * z), LEAF)


@form
def kiwi(d: Draft) -> None:
    lying(d, ROUND, speckled(d.colour, shade(d.colour, 0.7), 0.35, d.seed), "matte")
    x, y, z = d.size
    d.add(ball((0.05 * x, 0.25 * y, 0.25 * z), (x / 2 - 0.01 * x, 0, z / 2), 6, 4), shade(d.colour, 0.45))


@form
def mango(d: Draft) -> None:
    profile = [(0, 0), (0.22, 0.03), (0.42, 0.2), (0.5, 0.42), (0.46, 0.65), (0.3, 0.9), (0.13, 0.98), (0, 1)]
    lying(d, profile, gradient([(0.85, 0.25, 0.12), d.colour, (0.55, 0.62, 0.2)], None, 24), bend=0.35)
    x, y, z = d.size
    d.add(tube([(-0.5 * x, 0.01, 0.5 * z), (-0.54 * x, 0.012, 0.52 * z)], 0.05 * y, 6), STEM)


@form
def avocado(d: Draft) -> None:
    profile = [
        (0, 0),
        (0.25, 0.02),
        (0.45, 0.18),
        (0.5, 0.36),
        (0.43, 0.58),
        (0.27, 0.8),
        (0.2, 0.93),
        (0.1, 0.99),
        (0, 1),
    ]
    lying(d, profile, speckled(d.colour, shade(d.colour, 1.5), 0.3, d.seed), "satin", flat=0.13)
    x, y, z = d.size
    d.add(ball((0.06 * x, 0.14 * y, 0.14 * z), (x / 2, 0, z / 2), 6, 4), STEM)


@form
def pear(d: Draft) -> None:
    profile = [
        (0, 0.03),
        (0.2, 0),
        (0.4, 0.08),
        (0.5, 0.27),
        (0.46, 0.46),
        (0.3, 0.68),
        (0.22, 0.84),
        (0.14, 0.96),
        (0, 0.98),
    ]
    x, y, z = d.size
    standing(d, profile, speckled(d.colour, shade(d.colour, 0.8), 0.15, d.seed))
    d.add(stem(0.17 * z, 0.03 * x, 0.96 * z, lean=0.4), STEM)


@form
def pomegranate(d: Draft) -> None:
    x, y, z = d.size
    standing(d, [*ROUND[:-1], (0.12, 1.0), (0, 1.0)], blush(d, (0.9, 0.5, 0.3)), "satin")
    crown = lathe(
        [(0.1 * x, 0.97 * z), (0.09 * x, 1.05 * z), (0.15 * x, 1.16 * z), (0.09 * x, 1.08 * z), (0.0, 1.03 * z)], 6
    )
    d.add(crown, shade(d.colour, 0.75))


@form
def melon(d: Draft) -> None:
    """Watermelon (stripes), cantaloupe (net), coconut (fibres and three eyes)."""
    kind = d.args["skin"]
    x, _, z = d.size
    if kind == "stripes":
        paint: Paint = stripes(d.colour, shade(d.colour, 0.42), 9, duty=0.45, wobble=0.22, seed=d.seed)
    elif kind == "net":
        paint = np.tile(netted(d.colour, mix(d.colour, (1, 1, 0.9), 0.55), 3, size=32, width=0.22), (1, 2, 1))
    else:
        paint = stripes(d.colour, shade(d.colour, 0.72), 22, duty=0.4, wobble=0.03, seed=d.seed)
    standing(d, ROUND, paint, "matte" if kind != "stripes" else "satin", n=18)
    if kind == "fibre":
        for k in range(3):
            a = 2 * np.pi * k / 3
            d.add(ball(0.11 * x, (0.13 * x * np.cos(a), 0.13 * x * np.sin(a), 0.965 * z), 6, 4), shade(d.colour, 0.3))
    else:
        d.add(stem(0.06 * z, 0.025 * x, 0.98 * z), (0.45, 0.42, 0.2))


@form
def strawberry(d: Draft) -> None:
    x, _, z = d.size
    profile = [(0, 0.02), (0.12, 0.0), (0.3, 0.25), (0.46, 0.6), (0.5, 0.8), (0.4, 0.95), (0, 0.98)]
    # It lies on its side, as strawberries do.
    mesh = lathe(profile, 12).turned("y", np.pi / 2).fitted((0.86 * x, d.size[1], z)).flattened(0.06)
    d.rolls = True
    d.body(mesh, speckled(d.colour, (0.95, 0.85, 0.4), 0.07, d.seed), "gloss")
    calyx = rosette(6, 0.42 * z, 0.2 * z, lift=0.25).turned("y", np.pi / 2)
    d.add(calyx.moved(0.42 * x, 0, z / 2), LEAF)
    d.add(tube([(0.4 * x, 0, z / 2), (0.52 * x, 0, 0.55 * z)], 0.04 * z, 5), LEAF)


@form
def pineapple(d: Draft) -> None:
    x, _, z = d.size
    height = 0.62 * z
    profile = [(0, 0), (0.36, 0.01), (0.46, 0.15), (0.5, 0.45), (0.46, 0.8), (0.33, 0.98), (0, 1)]
    mesh = lathe(profile, 14).fitted((0.96 * x, 0.96 * x, height)).flattened(0.03)
    d.body(mesh, netted(d.colour, shade(d.colour, 0.5), 5, size=64, width=0.18))
    for ring, (count, reach, lift) in enumerate(((7, 0.34, 0.9), (6, 0.36, 1.6), (5, 0.38, 3.0))):
        for k in range(count):
            length = 0.38 * z
            a = 2 * np.pi * k / count + 0.4 * ring
            out = np.linspace(0, 1, 4)
            path = np.column_stack([0.04 * x + reach * x * out ** (lift), 0 * out, height * 0.97 + length * out])
            d.add(
                tube(path, [0.09 * x, 0.1 * x, 0.06 * x, 0.0], 4, flat=0.35).turned("z", a),
                LEAF if k % 2 else DARK_LEAF,
            )
    d.cylinder(0.16 * x, height, 0.85 * z)


@form
def walnut(d: Draft) -> None:
    mesh = lumpy(d.rng, lathe(ROUND, 16).turned("y", np.pi / 2), 0.1, 4).fitted(d.size).flattened(0.06)
    d.rolls = True
    d.body(mesh, speckled(d.colour, shade(d.colour, 0.6), 0.4, d.seed, blur=True))
    x, y, z = d.size
    seam = lathe([(0.485, -0.03), (0.52, 0), (0.485, 0.03)], 16).scaled(x, y, z).turned("x", 0.0).moved(z=z / 2)
    d.add(seam, shade(d.colour, 0.7))


@form
def date(d: Draft) -> None:
    """Three dates side by side."""
    x, y, z = d.size
    d.rolls = True
    for k in range(3):
        one = (
            lumpy(d.rng, lathe(ROUND, 8).turned("y", np.pi / 2), 0.2, 4).fitted((0.72 * x, 0.36 * y, z)).flattened(0.1)
        )
        one = one.turned("z", float(d.rng.uniform(-0.25, 0.25))).moved((k % 2) * 0.22 * x - 0.1 * x, (k - 1) * 0.32 * y)
        d.body(one, shade(d.colour, (1.0, 0.8, 1.15)[k]), "gloss")


@form
def half(d: Draft) -> None:
    """Half of an orange or a kiwi, its cut face up."""
    x, _, z = d.size
    r = x / 2
    skin = lathe([(0, 0), (0.45 * r, 0.02 * z), (0.8 * r, 0.3 * z), (0.97 * r, 0.7 * z), (r, z), (0.9 * r, z)], 16)
    d.body(skin.flattened(0.06), speckled(d.colour, shade(d.colour, 0.88), 0.2, d.seed))
    image, draw = canvas((0.97, 0.94, 0.82) if not d.args.get("kiwi") else (0.52, 0.70, 0.22), 48, 48)
    if d.args.get("kiwi"):
        draw.ellipse((17, 17, 31, 31), fill=(225, 232, 190))
        for k in range(20):
            a = 2 * np.pi * k / 20
            draw.ellipse(
                (23 + 11 * np.cos(a), 23 + 11 * np.sin(a), 25 + 11 * np.cos(a), 25 + 11 * np.sin(a)), fill=(30, 28, 20)
            )
    else:
        for k in range(9):
            draw.pieslice((4, 4, 44, 44), 40 * k + 4, 40 * k + 36, fill=bytes_of(mix(d.colour, (1, 0.8, 0.3), 0.3)))
    d.add(polygon(arc(0.95 * r, 0, 2 * np.pi, 17)[:-1]).moved(z=1.003 * z), pixels(image), "gloss")
