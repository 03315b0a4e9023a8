"""Cutlery and long tools; they lie along x, their handle towards -x."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.tool_parts import BLACK, STEEL, flat_bar, grip
from robocasa_lerobot.envs.objects.mesh import (
    box,
    lathe,
    loft,
    polygon,
    prism,
    rounded,
    tube,
)
from robocasa_lerobot.envs.objects.paint import shade, stripes


@form
def spoon(d: Draft) -> None:
    x, y, z = d.size
    steel = d.colour
    finish = "metal" if not d.args.get("wood") else "matte"
    arm = [
        (-0.5 * x, 0.2 * y, 0.35 * z),
        (-0.42 * x, 0.26 * y, 0.35 * z),
        (-0.1 * x, 0.12 * y, 0.45 * z),
        (0.2 * x, 0.12 * y, 0.3 * z),
    ]
    d.add(flat_bar(arm, 0.25 * z if finish == "metal" else 0.45 * z), steel, finish)
    t = np.linspace(0, 2 * np.pi, 15)[:-1]
    rim = np.column_stack([np.cos(t) * 0.165 * x, np.sin(t) * 0.5 * y * (1 - 0.12 * np.cos(t))])
    rings = [rim * 0.35, rim * 0.8, rim, rim * 0.86, rim * 0.3]
    d.add(loft(rings, [0, 0.28 * z, 0.75 * z, 0.75 * z, 0.2 * z]).moved(0.335 * x), steel, finish)
    d.box((0.7 * x, 0.3 * y, 0.45 * z), (-0.15 * x, 0, 0.5 * z))
    d.box((0.3 * x, 0.75 * y, 0.7 * z), (0.335 * x, 0, 0.35 * z))
    d.box((0.08 * x, 0.3 * y, 0.5 * z), (-0.45 * x, 0, 0.25 * z))


@form
def fork(d: Draft) -> None:
    x, y, z = d.size
    arm = [
        (-0.5 * x, 0.22 * y, 0.1 * z),
        (-0.42 * x, 0.3 * y, 0.1 * z),
        (-0.1 * x, 0.15 * y, 0.5 * z),
        (0.14 * x, 0.16 * y, 0.55 * z),
        (0.2 * x, 0.46 * y, 0.3 * z),
        (0.27 * x, 0.5 * y, 0.15 * z),
    ]
    d.add(flat_bar(arm, 0.3 * z), d.colour, "metal")
    for k in range(4):
        at = (k - 1.5) / 1.5 * 0.42 * y
        path = [(0.26 * x, at, 0.28 * z), (0.36 * x, at, 0.2 * z), (0.46 * x, at, 0.45 * z), (0.5 * x, at, 0.75 * z)]
        d.add(tube(path, [0.075 * y, 0.07 * y, 0.06 * y, 0.03 * y], 5), d.colour, "metal")
    d.box((0.68 * x, 0.34 * y, 0.6 * z), (-0.16 * x, 0, 0.45 * z))
    d.box((0.33 * x, y, 0.5 * z), (0.335 * x, 0, 0.25 * z))
    d.box((0.08 * x, 0.5 * y, 0.4 * z), (-0.45 * x, 0, 0.2 * z))


@form
def knife(d: Draft) -> None:
    """Lies on its side: a pointed blade and a riveted handle."""
    x, y, z = d.size
    split = -0.14 * x
    outline = np.array(
        [
            (split, -0.32 * y),
            (0.2 * x, -0.42 * y),
            (0.4 * x, -0.2 * y),
            (0.5 * x, 0.36 * y),
            (0.2 * x, 0.46 * y),
            (split, 0.46 * y),
        ]
    )
    d.add(prism(outline, 0.3 * z, 0.5 * z), STEEL, "metal")
    edge = np.array(
        [
            (split, -0.34 * y),
            (0.2 * x, -0.44 * y),
            (0.4 * x, -0.22 * y),
            (0.5 * x, 0.34 * y),
            (0.39 * x, 0.0),
            (0.2 * x, -0.22 * y),
            (split, -0.14 * y),
        ]
    )
    d.add(polygon(edge).moved(z=0.51 * z), (0.93, 0.94, 0.95), "metal")
    handle = np.array(
        [
            (-0.5 * x, -0.3 * y),
            (-0.47 * x, -0.42 * y),
            (-0.3 * x, -0.25 * y),
            (-0.16 * x, -0.3 * y),
            (-0.12 * x, 0.0),
            (-0.14 * x, 0.46 * y),
            (-0.42 * x, 0.5 * y),
            (-0.5 * x, 0.3 * y),
        ]
    )
    d.add(prism(handle, 0, 0.95 * z), d.colour, "satin")
    for k in range(3):
        d.add(
            lathe([(0.07 * y, 0.9 * z), (0.07 * y, z), (0, z)], 7).moved((-0.43 + 0.11 * k) * x, 0.1 * y),
            STEEL,
            "metal",
        )
    d.box((0.62 * x, 0.8 * y, 0.22 * z), (0.18 * x, 0.02 * y, 0.4 * z))
    d.box((0.37 * x, 0.85 * y, z), (-0.315 * x, 0.04 * y, 0.5 * z))


@form
def spatula(d: Draft) -> None:
    """A turner: a slotted blade that is bent down."""
    x, y, z = d.size
    wood = d.colour
    grip(d, -0.5 * x, -0.12 * x, 0.3 * y, 0.55 * z, wood, 0.4 * z)
    d.add(
        flat_bar(
            [(-0.14 * x, 0.08 * y, 0.6 * z), (0.08 * x, 0.08 * y, 0.5 * z), (0.2 * x, 0.1 * y, 0.1 * z)], 0.16 * z
        ),
        STEEL,
        "metal",
    )
    outline = rounded(0.34 * x, y, 0.12 * y, 3)
    blade = prism(outline, 0.0, 0.16 * z).moved(0.33 * x)
    d.add(blade, BLACK if d.seed % 2 else STEEL, "metal")
    for k in range(3):
        d.add(
            polygon(rounded(0.2 * x, 0.1 * y, 0.04 * y, 3)).moved(0.34 * x, (k - 1) * 0.26 * y, 0.17 * z),
            (0.3, 0.3, 0.32),
        )
    d.box((0.34 * x, y, 0.2 * z), (0.33 * x, 0, 0.1 * z))
    d.box((0.32 * x, 0.14 * y, 0.2 * z), (0.03 * x, 0, 0.6 * z))
    d.box((0.03 * x, 0.25 * y, 0.6 * z), (-0.48 * x, 0, 0.3 * z))


@form
def ladle(d: Draft) -> None:
    x, y, z = d.size
    r = y / 2
    bowl = lathe(
        [
            (0, 0),
            (0.55 * r, 0.02 * z),
            (0.92 * r, 0.3 * z),
            (r, 0.52 * z),
            (0.92 * r, 0.52 * z),
            (0.8 * r, 0.3 * z),
            (0.45 * r, 0.08 * z),
            (0, 0.06 * z),
        ],
        14,
    )
    d.add(bowl.moved(x / 2 - r), STEEL if d.seed % 2 else d.colour, "metal")
    path = [
        (x / 2 - 1.95 * r, 0, 0.5 * z),
        (x / 2 - 2.15 * r, 0, 0.8 * z),
        (0.0, 0, 0.86 * z),
        (-0.42 * x, 0, 0.9 * z),
        (-0.5 * x, 0, 0.82 * z),
    ]
    d.add(tube(path, 0.006, 7, flat=0.7), STEEL, "metal")
    d.add(tube([(-0.14 * x, 0, 0.88 * z), (-0.5 * x, 0, 0.86 * z)], [0.009, 0.011], 8), d.colour, "satin")
    d.cup(0.62 * r, r, 0, 0.52 * z, 0.006, 8)
    d.solids = [s.moved((x / 2 - r, 0, 0)) for s in d.solids]
    assert d.inside is not None
    d.inside = (d.inside[0] + [x / 2 - r, 0, 0], d.inside[1])
    length = x - 2.0 * r
    d.box((length, 0.02, 0.016), (-0.5 * x + length / 2, 0, 0.86 * z))
    d.box((0.012, 0.02, 0.4 * z), (x / 2 - 2.02 * r, 0, 0.7 * z))
    # A prop under the handle's end, so that it lies as it is drawn.
    d.box((0.012, 0.05, 0.86 * z), (-0.49 * x, 0, 0.43 * z))


@form
def whisk(d: Draft) -> None:
    x, y, z = d.size
    grip(d, -0.5 * x, -0.08 * x, min(0.024, 0.45 * y), min(0.024, 0.45 * z), d.colour, 0.5 * z - min(0.012, 0.225 * z))
    t = np.linspace(0, 1, 9)
    for k in range(4):
        a = np.pi * k / 4
        for side in (-1, 1):
            reach = np.sin(np.pi * np.clip(t * 0.93 + 0.03, 0, 1) ** 1.5) ** 0.8 * 0.5
            path = np.column_stack(
                [-0.09 * x + 0.59 * x * t, side * np.cos(a) * reach * y, 0.5 * z + side * np.sin(a) * reach * z]
            )
            path[-1, 1:] = (0, 0.5 * z)
            d.add(tube(path, 0.0015, 4), STEEL, "metal")
    profile = [(0.05, -0.09), (0.32, 0.12), (0.5, 0.3), (0.42, 0.44), (0.2, 0.5)]
    hull = lathe(profile, 8).turned("y", np.pi / 2).scaled(x, y, z).moved(z=0.5 * z).flattened(0.06)
    d.hull(hull)
    # A prop under the handle's end, so that it lies as it is drawn.
    d.box((0.012, 0.04, 0.5 * z), (-0.48 * x, 0, 0.03 * z + 0.25 * z))
    d.rolls = True


@form
def rolling_pin(d: Draft) -> None:
    x, y, z = d.size
    r = z / 2
    a, b = 0.33 * x, 0.37 * x
    profile = [
        (0, -x / 2),
        (0.3 * r, -0.49 * x),
        (0.4 * r, -0.44 * x),
        (0.3 * r, -b),
        (0.98 * r, -b),
        (r, -a),
        (r, a),
        (0.98 * r, b),
        (0.3 * r, b),
        (0.4 * r, 0.44 * x),
        (0.3 * r, 0.49 * x),
        (0, x / 2),
    ]
    mesh = lathe(profile, 12).turned("y", np.pi / 2).moved(z=r)
    d.add(mesh, stripes(d.colour, shade(d.colour, 0.88), 8, duty=0.35, wobble=0.06, seed=d.seed), "satin")
    d.rolls = True
    barrel = lathe([(r, -b), (r, b)], 12).turned("y", np.pi / 2).moved(z=r).flattened(0.05)
    d.hull(barrel)
    d.box((x, 0.7 * r, 0.7 * r), (0, 0, r))


@form
def scissors(d: Draft) -> None:
    x, y, z = d.size
    for side in (-1, 1):
        blade = np.array([(-0.1 * x, -0.08 * y), (0.5 * x, 0.0), (0.46 * x, 0.06 * y), (-0.1 * x, 0.12 * y)])
        mesh = prism(blade, 0.2 * z, 0.5 * z).turned("z", side * 0.12)
        d.add(mesh.moved(0, 0, 0.2 * z if side > 0 else 0), STEEL, "metal")
        t = np.linspace(0, 2 * np.pi, 13)
        ring = np.column_stack(
            [-0.34 * x + np.cos(t) * 0.15 * x, side * 0.26 * y + np.sin(t) * 0.2 * y, np.full(13, 0.5 * z)]
        )
        d.add(tube(ring, 0.42 * z, 6), d.colour, "satin")
        d.add(
            tube([(-0.22 * x, side * 0.14 * y, 0.5 * z), (-0.05 * x, -side * 0.02 * y, 0.5 * z)], 0.4 * z, 6),
            d.colour,
            "satin",
        )
        d.box((0.3 * x, 0.36 * y, 0.85 * z), (-0.34 * x, side * 0.27 * y, 0.42 * z))
    d.add(lathe([(0.05 * y, 0.6 * z), (0.05 * y, 1.0 * z), (0, z)], 8), (0.5, 0.5, 0.52), "metal")
    d.box((0.68 * x, 0.16 * y, 0.5 * z), (0.16 * x, 0, 0.4 * z))


@form
def tongs(d: Draft) -> None:
    x, y, z = d.size
    for side in (-1, 1):
        t = np.linspace(0, 1, 6)
        spread = side * (0.06 + 0.34 * np.sin(np.pi * (0.1 + 0.62 * t))) * y
        path = np.column_stack([-0.5 * x + 0.86 * x * t, spread, np.full(6, 0.5 * z)])
        d.add(tube(path, 0.3 * z, 6, flat=1.4), STEEL, "metal")
        end = path[-1]
        head = lathe([(0, 0), (0.5, 0.2), (0.5, 0.8), (0, 1)], 8).scaled(0.16 * x, 0.26 * y, 0.9 * z)
        d.add(head.moved(0.42 * x, end[1], 0.05 * z), d.colour, "satin")
        d.hull(
            np.array(
                [
                    (p[0], p[1] + e * 0.14 * y, h)
                    for p in path[[1, 3, 5]]
                    for e in (-0.6, 0.6)
                    for h in (0.04 * z, 0.95 * z)
                ]
            )
        )
        d.box((0.14 * x, 0.24 * y, 0.85 * z), (0.43 * x, end[1], 0.43 * z))
    d.add(box((0.05 * x, 0.3 * y, 0.8 * z), (-0.48 * x, 0, 0.5 * z)), d.colour, "satin")
    d.box((0.05 * x, 0.3 * y, 0.85 * z), (-0.475 * x, 0, 0.45 * z))
