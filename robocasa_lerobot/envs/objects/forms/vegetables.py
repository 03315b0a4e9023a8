"""Vegetables, lemons and eggs, turned or made of leaves."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.produce import (
    DARK_LEAF,
    DIMPLED,
    LEAF,
    ROUND,
    leaf,
    leaf_cap,
    leaf_veins,
    lying,
    ribbed,
    rosette,
    standing,
    stem,
)
from robocasa_lerobot.envs.objects.mesh import (
    bent,
    lathe,
    lumpy,
    tube,
)
from robocasa_lerobot.envs.objects.paint import (
    Paint,
    Rgb,
    gradient,
    gridded,
    mix,
    shade,
    speckled,
    stripes,
)


@form
def lemon(d: Draft) -> None:
    profile = [
        (0, 0),
        (0.09, 0.02),
        (0.12, 0.08),
        (0.34, 0.2),
        (0.48, 0.38),
        (0.5, 0.54),
        (0.42, 0.74),
        (0.2, 0.9),
        (0.1, 0.97),
        (0, 1),
    ]
    lying(d, profile, speckled(d.colour, shade(d.colour, 0.9), 0.2, d.seed))


@form
def tomato(d: Draft) -> None:
    x, _, z = d.size
    standing(d, DIMPLED, None, "gloss")
    d.add(rosette(5, 0.3 * x, 0.12 * x, lift=-0.1).moved(z=0.985 * z), LEAF)
    d.add(stem(0.1 * z, 0.03 * x, 0.92 * z), LEAF)


@form
def onion(d: Draft) -> None:
    x, y, z = d.size
    profile = [
        (0, 0.02),
        (0.1, 0),
        (0.35, 0.06),
        (0.5, 0.3),
        (0.46, 0.52),
        (0.26, 0.72),
        (0.1, 0.82),
        (0.06, 0.95),
        (0.09, 1.0),
        (0, 0.97),
    ]
    standing(d, profile, stripes(d.colour, shade(d.colour, 0.84), 14, duty=0.3, seed=d.seed), "satin", flat=0.05)
    d.add(rosette(6, 0.1 * x, 0.04 * x, lift=0.0).moved(z=0.008 * z), (0.8, 0.7, 0.5))


@form
def garlic(d: Draft) -> None:
    x, y, z = d.size
    profile = [
        (0, 0.0),
        (0.28, 0.01),
        (0.45, 0.14),
        (0.5, 0.3),
        (0.42, 0.5),
        (0.22, 0.66),
        (0.1, 0.76),
        (0.07, 0.97),
        (0, 1.0),
    ]
    mesh = ribbed(lathe(profile, 24), 8, 0.07).fitted((x, y, z)).flattened(0.04)
    d.rolls = True
    d.body(mesh, stripes(d.colour, (0.72, 0.6, 0.68), 16, duty=0.18, seed=d.seed))


@form
def root(d: Draft) -> None:
    """Beet, radish: a ball with a root tip and a bunch of stalks; lies on its side."""
    x, y, z = d.size
    share = d.args.get("body", 0.5)
    length = x * share
    body = lathe([(0, 0.0), (0.05, 0.06), (0.2, 0.2), (0.45, 0.42), (0.5, 0.68), (0.38, 0.92), (0.15, 1), (0, 1)], 12)
    mesh = body.turned("y", np.pi / 2).scaled(length, y, z).moved(z=z / 2)
    d.rolls = True
    d.body(
        mesh.flattened(0.12),
        gradient([shade(d.colour, 1.5) if d.args.get("white_tip") else d.colour, d.colour, d.colour], None, 16),
        "satin",
    )
    d.add(
        tube([(0.02 * length, 0, z / 2), (-0.25 * length, 0.02 * y, z * 0.42)], [0.05 * y, 0.006 * y], 6),
        shade(d.colour, 1.2),
    )
    room = x - 1.25 * length
    stalk: Rgb = d.args.get("stalk", (0.62, 0.15, 0.3))
    for k in range(4):
        side = (k - 1.5) / 1.5
        end = np.array([length + room * (0.55 + 0.1 * (k % 2)), side * 0.28 * y, z * (0.5 + 0.1 * (k % 2))])
        d.add(tube([(length * 0.96, side * 0.06 * y, z / 2), tuple(end)], 0.05 * y, 5), stalk)
        blade = leaf(room * 0.5, 0.4 * y, lift=0.15).turned("z", side * 0.4).moved(*(end - [0.06 * room, 0, 0]))
        d.add(blade, LEAF)
    # The stalks droop to the worktop and keep it from rolling.
    d.box((room * 0.85, 0.45 * y, 0.5 * z), (length + room * 0.45, 0, 0.12 * z + 0.25 * z))


@form
def carrot(d: Draft) -> None:
    x, y, z = d.size
    length = 0.74 * x
    profile = [(0, 0), (0.12, 0.02), (0.22, 0.25), (0.36, 0.6), (0.48, 0.88), (0.46, 0.97), (0.2, 1), (0, 1)]
    mesh = lathe(profile, 10).turned("y", np.pi / 2).scaled(length, y, z).moved(z=z / 2)
    d.rolls = True
    d.body(mesh.flattened(0.08), stripes(d.colour, shade(d.colour, 0.85), 1, duty=0.0), "satin")
    for k, share in enumerate((0.22, 0.42, 0.58, 0.74, 0.86)):  # growth rings
        r = np.interp(share, [p[1] for p in profile], [p[0] for p in profile])
        ring = lathe([(r * 0.99, share - 0.006), (r * 1.035, share), (r * 0.99, share + 0.006)], 10)
        d.add(ring.turned("y", np.pi / 2).scaled(length, y, z).moved(z=z / 2).flattened(0.09), shade(d.colour, 0.72))
        del k
    for k in range(5):
        side = (k - 2) / 2
        end = (length + (x - length) * (1 - 0.15 * abs(side)), side * 0.42 * y, z * (0.55 + 0.2 * ((k + 1) % 2)))
        d.add(
            tube([(length * 0.97, side * 0.08 * y, z / 2), end], [0.07 * y, 0.09 * y], 5), LEAF if k % 2 else DARK_LEAF
        )


@form
def eggplant(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.28, 0.03), (0.46, 0.15), (0.5, 0.32), (0.4, 0.6), (0.27, 0.85), (0.2, 0.96), (0, 1)]
    length = 0.88 * x
    mesh = bent(lathe(profile, 12).turned("y", np.pi / 2).fitted((length, y, z)), 0.3).flattened(0.13)
    d.rolls = True
    d.body(mesh, None, "gloss")
    calyx = rosette(5, 0.2 * y, 0.3 * y, lift=-0.2).turned("y", np.pi / 2).scaled(1.6, 1.5, 1.5)
    d.add(calyx.moved(length / 2 - 0.015 * x, 0.02 * x, z / 2), LEAF)
    d.add(
        tube([(length / 2 - 0.02 * x, 0.02 * x, z / 2), (length / 2 + 0.12 * x, 0.03 * x, z * 0.55)], 0.1 * y, 6), LEAF
    )


@form
def gourd(d: Draft) -> None:
    """Butternut squash: a bulb with a long neck."""
    x, y, z = d.size
    profile = [
        (0, 0),
        (0.22, 0.02),
        (0.45, 0.14),
        (0.5, 0.28),
        (0.4, 0.46),
        (0.29, 0.58),
        (0.28, 0.8),
        (0.25, 0.92),
        (0.1, 0.95),
        (0, 0.95),
    ]
    lying(d, profile, stripes(d.colour, shade(d.colour, 0.93), 10, duty=0.4, seed=d.seed), "satin", flat=0.15)
    d.add(tube([(0.49 * x, 0, z / 2), (0.54 * x, 0, z * 0.52)], 0.09 * y, 5), (0.45, 0.38, 0.2))


@form
def cucumber(d: Draft) -> None:
    """Cucumber, zucchini, pickle."""
    x, y, z = d.size
    profile = [(0, 0), (0.25, 0.01), (0.42, 0.06), (0.5, 0.2), (0.5, 0.75), (0.42, 0.93), (0.2, 0.99), (0, 1)]
    kind = d.args.get("skin", "striped")
    paint: Paint
    if kind == "striped":
        paint = stripes(d.colour, mix(d.colour, (0.75, 0.85, 0.45), 0.35), 8, duty=0.25, seed=d.seed)
    elif kind == "bumpy":
        paint = speckled(d.colour, shade(d.colour, 0.62), 0.25, d.seed)
    else:
        paint = speckled(d.colour, mix(d.colour, (0.8, 0.9, 0.5), 0.5), 0.1, d.seed)
    lying(d, profile, paint, "satin", bend=d.args.get("bend", 0.15), lumps=0.05 if kind == "bumpy" else 0.0)
    if kind == "dotted":
        d.add(
            tube([(0.48 * x, 0, z / 2), (0.54 * x, 0, z / 2)], [0.3 * y, 0.2 * y], 6),
            mix(d.colour, (0.7, 0.75, 0.4), 0.6),
        )


@form
def potato(d: Draft) -> None:
    profile = (
        ROUND
        if not d.args.get("tapered")
        else [(0, 0), (0.12, 0.03), (0.36, 0.22), (0.5, 0.5), (0.42, 0.75), (0.14, 0.96), (0, 1)]
    )
    lying(d, profile, speckled(d.colour, shade(d.colour, 0.6), 0.06, d.seed), "matte", flat=0.14, lumps=0.1, n=12)


@form
def egg(d: Draft) -> None:
    profile = [(0, 0), (0.27, 0.04), (0.43, 0.18), (0.5, 0.4), (0.45, 0.65), (0.3, 0.88), (0.14, 0.98), (0, 1)]
    lying(d, profile, None, "satin", n=14)


@form
def bell_pepper(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0.06), (0.2, 0.0), (0.38, 0.06), (0.44, 0.3), (0.5, 0.7), (0.44, 0.93), (0.24, 1.0), (0, 0.9)]
    d.rolls = True
    d.body(ribbed(lathe(profile, 24), 4, 0.06).fitted((x, y, z)).flattened(0.03), None, "gloss")
    d.add(rosette(5, 0.2 * x, 0.14 * x, lift=0.0).moved(z=0.945 * z), LEAF)
    d.add(stem(0.22 * z, 0.05 * x, 0.93 * z, lean=0.5), LEAF)


@form
def chili(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.1, 0.03), (0.3, 0.3), (0.45, 0.65), (0.5, 0.86), (0.4, 0.97), (0, 1)]
    mesh = bent(lathe(profile, 9).turned("y", np.pi / 2).fitted((0.82 * x, 0.62 * y, z)), 0.7)
    middle = mesh.vertices[:, 0] > 0.05 * x
    d.rolls = True
    mesh = mesh.flattened(0.08)
    d.hull(mesh.vertices[middle])
    d.hull(mesh.vertices[mesh.vertices[:, 0] < 0.1 * x])
    d.add(mesh, None, "gloss")
    tip = mesh.vertices[np.argmax(mesh.vertices[:, 0])]
    d.add(
        tube(
            [
                tuple(tip - [0.02 * x, 0, 0]),
                tuple(tip + [0.06 * x, 0.05 * x, 0]),
                tuple(tip + [0.14 * x, 0.1 * x, 0.1 * z]),
            ],
            [0.3 * z, 0.14 * z, 0.1 * z],
            6,
        ),
        LEAF,
    )


@form
def corn(d: Draft) -> None:
    x, y, z = d.size
    profile = [(0, 0), (0.3, 0.02), (0.46, 0.15), (0.5, 0.35), (0.42, 0.75), (0.22, 0.97), (0, 1)]
    length = 0.92 * x
    mesh = (
        lathe(profile, 12).turned("y", np.pi / 2).scaled(length, 0.86 * y, 0.86 * z).moved(z=0.45 * z).flattened(0.06)
    )
    d.rolls = True
    d.body(mesh, gridded(d.colour, shade(d.colour, 0.72), (12, 12), width=0.22), "satin")
    husk: Rgb = (0.60, 0.70, 0.32)
    for k in range(5):
        a = 2 * np.pi * k / 5 + 0.3
        strip = leaf(0.55 * length, 0.62 * y, lift=0.12).moved(z=0.43 * z).turned("x", a)
        d.add(strip.moved(-0.01 * x, 0, 0.45 * z), husk if k % 2 else shade(husk, 0.85))
    d.add(tube([(0.02 * x, 0, 0.45 * z), (-0.08 * x, 0, 0.45 * z)], [0.16 * y, 0.12 * y], 7), husk)


@form
def mushroom(d: Draft) -> None:
    x, _, z = d.size
    profile = [
        (0, 0),
        (0.2, 0),
        (0.17, 0.2),
        (0.17, 0.42),
        (0.4, 0.42),
        (0.5, 0.52),
        (0.44, 0.78),
        (0.25, 0.95),
        (0, 1),
    ]
    mesh = lathe(profile, 14).fitted(d.size)
    cut = mesh.vertices[:, 2] > 0.41 * z
    d.hull(mesh.vertices[cut])
    d.cylinder(0.2 * x, 0.0, 0.45 * z)
    gill = shade(d.colour, 0.62)
    d.add(
        mesh,
        gradient(
            [shade(d.colour, 0.95), shade(d.colour, 0.95), gill, gill, d.colour, d.colour],
            [0, 0.3, 0.33, 0.46, 0.5, 1],
            48,
        ),
        "matte",
    )
    d.rolls = True


@form
def leafy_head(d: Draft) -> None:
    """Cabbage, lettuce, Brussels sprout: a ball of leaves, the outer ones standing off."""
    x, _, z = d.size
    loose = float(d.args.get("loose", 0.15))
    pale = mix(d.colour, (0.93, 0.96, 0.75), 0.45)
    core = lathe(ROUND, 12).fitted((0.84 * x, 0.84 * x, z * (0.97 - 0.1 * loose)))
    d.rolls = True
    d.hull(lathe(ROUND, 12).fitted((0.95 * x, 0.95 * x, z)).flattened(0.06))
    d.add(lumpy(d.rng, core, 0.08), pale, "matte")
    # From the heart outwards: leaves that close over the top, then wider ones whose rims stand off.
    rings = ((3, 0.43, 1.16, 1.3, 0.2), (4, 0.455, 0.95, 1.05, 0.6), (4, 0.48, 0.62, 1.15, 1.0))
    for ring, (count, radius, span, width, lift) in enumerate(rings):
        for k in range(count):
            wrap = leaf_cap(radius * x, z, span, width, ruffle=loose * lift, phase=k + ring)
            tone = mix(shade(d.colour, (1.08, 0.95, 0.8)[ring]), pale, 0.2 * (k % 2))
            d.add(wrap.turned("z", 2 * np.pi * (k + 0.37 * ring) / count), leaf_veins(tone, pale), "matte")


@form
def artichoke(d: Draft) -> None:
    x, _, z = d.size
    core = lathe([(0, 0.0), (0.25, 0.02), (0.42, 0.2), (0.46, 0.42), (0.36, 0.72), (0.16, 0.95), (0, 1)], 12).fitted(
        (0.9 * x, 0.9 * x, z)
    )
    d.rolls = True
    d.body(core.flattened(0.03), shade(d.colour, 0.7))
    for row, (count, low, radius) in enumerate(((8, 0.05, 0.38), (8, 0.26, 0.43), (7, 0.46, 0.38), (5, 0.64, 0.25))):
        for k in range(count):
            a = 2 * np.pi * (k + 0.5 * (row % 2)) / count
            scale = leaf(0.36 * z, 0.3 * x, lift=0.0).turned("y", -1.25 - 0.12 * row).moved(radius * x, 0, low * z)
            d.add(scale.turned("z", a), d.colour if (k + row) % 2 else shade(d.colour, 0.85))


@form
def pumpkin(d: Draft) -> None:
    x, y, z = d.size
    body = ribbed(
        lathe([(0, 0.06), (0.2, 0), (0.42, 0.14), (0.5, 0.48), (0.42, 0.84), (0.2, 0.98), (0, 0.9)], 30), 10, 0.06
    )
    d.body(
        body.fitted((x, y, 0.88 * z)).flattened(0.04), stripes(d.colour, shade(d.colour, 0.85), 10, duty=0.2), "satin"
    )
    d.add(
        tube([(0, 0, 0.8 * z), (0.02 * x, 0, 0.92 * z), (0.08 * x, 0, z)], [0.07 * x, 0.04 * x, 0.045 * x], 7),
        (0.42, 0.45, 0.18),
    )
