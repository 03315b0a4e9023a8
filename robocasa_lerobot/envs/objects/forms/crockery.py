"""Cups, glasses, bowls and plates."""

from __future__ import annotations

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.vessel_parts import (
    glaze,
    hollow,
    loop,
    loop_solids,
)
from robocasa_lerobot.envs.objects.mesh import lathe
from robocasa_lerobot.envs.objects.paint import (
    bands,
    mix,
)


@form
def mug(d: Draft) -> None:
    x, y, z = d.size
    r = y / 2
    wall = 0.05 * y
    shift = -(x - y) / 2
    waist = d.args.get("waist", 0.95)
    body = hollow([(0, 0), (0.82 * r, 0), (waist * r, 0.08 * z), (waist * r, 0.5 * z), (r, 0.98 * z), (r, z)], wall)
    d.add(body.moved(shift), glaze(d), "gloss")
    reach = x - y + 0.05 * y
    start = shift + 0.93 * r
    thick = 0.055 * z + 0.001
    d.add(loop(start, 0.22 * z, 0.8 * z, reach - thick, thick, flat=0.8), d.colour, "gloss")
    d.cup(0.9 * r, r, 0, z, wall * 1.1)
    d.solids = [s.moved((shift, 0, 0)) for s in d.solids]
    assert d.inside is not None
    d.inside = (d.inside[0] + [shift, 0, 0], d.inside[1])
    loop_solids(d, start, 0.22 * z, 0.8 * z, reach - thick, thick)


@form
def cup(d: Draft) -> None:
    """A cup without a handle; of glass where its record says so."""
    x, _, z = d.size
    r = x / 2
    bottom = d.args.get("bottom", 0.74)
    wall = max(0.045 * x, 0.002)
    profile = [(0, 0), (bottom * r, 0), ((bottom + 0.06) * r, 0.06 * z), (0.99 * r, 0.97 * z), (r, z)]
    glass = bool(d.args.get("glass"))
    if glass:
        d.add(hollow(profile, wall, 14), (0.88, 0.93, 0.95), "glass")
        d.add(
            lathe([(0, 0.0), (bottom * r, 0), ((bottom + 0.04) * r, 0.07 * z), (0, 0.07 * z)], 14),
            mix((0.8, 0.88, 0.92), d.colour, 0.4),
            "tinted",
        )
    else:
        d.add(hollow(profile, wall, 16), glaze(d), "gloss")
    d.cup(bottom * r, r, 0, z, wall * 1.2)


@form
def wine_glass(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    profile = [
        (0, 0),
        (0.84 * r, 0),
        (0.8 * r, 0.015 * z),
        (0.1 * r, 0.04 * z),
        (0.08 * r, 0.42 * z),
        (0.5 * r, 0.5 * z),
        (0.95 * r, 0.64 * z),
        (r, 0.76 * z),
        (0.8 * r, z),
    ]
    inner = [(0.76 * r, z), (0.95 * r, 0.76 * z), (0.9 * r, 0.65 * z), (0.45 * r, 0.52 * z), (0, 0.47 * z)]
    d.add(lathe(profile + inner, 14), mix((0.88, 0.93, 0.95), d.colour, 0.25), "glass")
    d.add(lathe([(0.84 * r, 0.0), (0.86 * r, 0.008 * z), (0.78 * r, 0.018 * z)], 14), (0.7, 0.78, 0.82), "tinted")
    d.cylinder(0.84 * r, 0, 0.035 * z)
    d.cylinder(0.11 * r, 0.035 * z, 0.47 * z)
    d.cylinder(0.5 * r, 0.46 * z, 0.52 * z)
    from robocasa_lerobot.envs.objects.solids import wall

    d.solids.extend(wall(0.56 * r, r, 0.5 * z, 0.72 * z, 0.08 * r, 8))
    d.solids.extend(wall(r, 0.82 * r, 0.72 * z, z, 0.08 * r, 8))
    d.holds((0, 0, 0.76 * z), (0.5 * r, 0.5 * r, 0.23 * z))


@form
def bowl(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    wall = 0.028 * x
    d.add(
        hollow(
            [(0, 0), (0.42 * r, 0), (0.44 * r, 0.07 * z), (0.78 * r, 0.36 * z), (0.95 * r, 0.7 * z), (r, z)], wall, 18
        ),
        glaze(d),
        "gloss",
    )
    d.cup(0.6 * r, r, 0, z, wall * 1.1, 12)
    d.holds((0, 0, 0.55 * z), (0.62 * r, 0.62 * r, 0.42 * z))


@form
def plate(d: Draft) -> None:
    x, _, z = d.size
    r = x / 2
    profile = [
        (0, 0),
        (0.6 * r, 0),
        (0.64 * r, 0.15 * z),
        (0.98 * r, 0.88 * z),
        (r, z),
        (0.96 * r, z),
        (0.64 * r, 0.42 * z),
        (0.58 * r, 0.25 * z),
        (0, 0.25 * z),
    ]
    rim = mix(d.colour, (0.2, 0.3, 0.5) if sum(d.colour) > 2 else (1, 1, 1), 0.5)
    styles = (
        bands([d.colour, rim, d.colour], [0.44, 0.5, 1.0], 64),
        bands([d.colour, rim, d.colour, rim, d.colour], [0.42, 0.46, 0.62, 0.66, 1.0], 64),
        bands([d.colour], [1.0]),
    )
    d.add(lathe(profile, 22), styles[d.seed % 3], "gloss")
    d.cylinder(0.64 * r, 0, 0.25 * z)
    from robocasa_lerobot.envs.objects.solids import wall

    d.solids.extend(wall(0.66 * r, r, 0.1 * z, z, 0.22 * z, 10))
    d.holds((0, 0, 0.25 * z + 0.03), (0.58 * r, 0.58 * r, 0.03))
