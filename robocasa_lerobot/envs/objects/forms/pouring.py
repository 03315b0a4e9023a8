"""Jugs, pitchers, kettles and teapots."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft, form
from robocasa_lerobot.envs.objects.forms.vessel_parts import (
    BLACK,
    STEEL,
    glaze,
    hollow,
    loop,
    loop_solids,
)
from robocasa_lerobot.envs.objects.mesh import box, lathe, tube
from robocasa_lerobot.envs.objects.paint import (
    Pattern,
    Rgb,
    mix,
    shade,
)


@form
def pouring(d: Draft) -> None:
    """Jug, pitcher, measuring cup, blender jug: a spout in front (+x), a handle behind (-x)."""
    x, y, z = d.size
    r = y / 2
    wall = max(0.035 * y, 0.003)
    shape = d.args.get("body", "jug")
    outlines: dict[str, list[tuple[float, float]]] = {
        "jug": [(0, 0), (0.72, 0), (0.8, 0.04), (1.0, 0.34), (0.92, 0.55), (0.62, 0.78), (0.66, 0.9), (0.76, 1.0)],
        "wide": [(0, 0), (0.84, 0), (0.88, 0.04), (0.92, 0.5), (1.0, 1.0)],
        "pitcher": [(0, 0), (0.86, 0), (0.9, 0.04), (1.0, 0.3), (0.84, 0.75), (0.88, 1.0)],
        "measure": [(0, 0), (0.78, 0), (0.82, 0.05), (1.0, 1.0)],
        "blender": [(0, 0), (0.62, 0), (0.64, 0.1), (0.76, 0.14), (1.0, 0.95), (1.0, 1.0)],
    }
    profile = [(p * r, q * z) for p, q in outlines[shape]]
    finish = d.args.get("finish", "gloss")
    shift = (x - y) * 0.28
    rim = profile[-1][0]
    mesh = hollow(profile, wall, 16)

    def beak(v: np.ndarray) -> np.ndarray:
        height = np.clip((v[:, 2] / z - 0.75) / 0.25, 0, 1)
        toward = np.clip(v[:, 0] / np.maximum(np.hypot(v[:, 0], v[:, 1]), 1e-9), 0, 1) ** 8
        out = v.copy()
        out[:, 0] += 0.3 * r * toward * height**2
        return out

    clear = finish == "glass"
    d.add(
        mesh.mapped(beak).moved(shift),
        (0.88, 0.93, 0.95) if clear else (glaze(d) if d.args.get("glazed") else d.colour),
        finish,
    )
    if clear:
        for k in range(int(d.args.get("marks", 0))):
            height = (0.25 + 0.15 * k) * z
            at = np.interp(height, [q for _, q in profile], [p for p, _ in profile])
            mark = lathe([(at * 1.01, height), (at * 1.01, height + 0.012 * z)], 12, arc=2 * np.pi)
            d.add(mark.moved(shift), d.colour)
        if d.args.get("liquid"):
            inner = [(max(p - 1.6 * wall, 0), max(q, 0.04 * z)) for p, q in profile if q < 0.62 * z]
            edge = np.interp(0.62 * z, [q for _, q in profile], [p for p, _ in profile]) - 1.6 * wall
            d.add(lathe([*inner, (edge, 0.62 * z), (0, 0.62 * z)], 14).moved(shift), tuple(d.args["liquid"]), "tinted")
    if shape == "blender":
        d.add(lathe([(0.7 * r, 0), (0.72 * r, 0.1 * z), (0.66 * r, 0.14 * z)], 16).moved(shift), BLACK, "satin")
        for a in (0.0, np.pi / 2):
            d.add(
                box((0.7 * r, 0.12 * r, 0.01 * z), (0, 0, 0.14 * z))
                .turned("y", 0.25)
                .turned("z", a)
                .moved(shift, 0, 0.02 * z),
                STEEL,
                "metal",
            )
    start, stop = (0.3, 0.85) if shape != "jug" else (0.36, 0.88)
    grip_at = float(np.interp(stop * z, [q for _, q in profile], [p for p, _ in profile]))
    thick = max(0.045 * z, 0.006) if z < 0.2 else 0.03 * z
    reach = (x / 2 + shift) - grip_at
    handle_rgb = BLACK if shape == "blender" else (mix((0.8, 0.88, 0.92), d.colour, 0.5) if clear else d.colour)
    d.add(
        loop(grip_at * 0.97, start * z, stop * z, reach - thick, thick, flat=0.8).turned("z", np.pi).moved(shift),
        handle_rgb,
        "satin" if not clear else "tinted",
    )
    bottom = max(p for p, q in profile if q <= 0.1 * z)
    if shape == "jug":
        d.cup(bottom, r, 0, 0.4 * z, wall, 8)
        from robocasa_lerobot.envs.objects.solids import wall as ring_of

        d.solids.extend(ring_of(r, rim, 0.4 * z, z, wall, 8))
        d.holds((0, 0, 0.5 * z), (0.4 * r, 0.4 * r, 0.45 * z))
    else:
        d.cup(bottom, max(rim, r * 0.86), 0, z, wall, 8)
    loop_start = len(d.solids)
    loop_solids(d, grip_at * 0.97, start * z, stop * z, reach - thick, thick)
    turned = [s.scaled((1.0, 1.0, 1.0)) for s in d.solids[loop_start:]]
    d.solids[loop_start:] = [type(s)(s.kind, s.size, (-s.pos[0], s.pos[1], s.pos[2]), s.quat) for s in turned]
    d.solids = [s.moved((shift, 0, 0)) for s in d.solids]
    assert d.inside is not None
    d.inside = (d.inside[0] + [shift, 0, 0], d.inside[1])


@form
def kettle(d: Draft) -> None:
    """Kettle for the stove, or teapot: closed, a spout in front, a handle above (kettle) or behind (teapot)."""
    x, y, z = d.size
    r = y / 2
    tea = bool(d.args.get("teapot"))
    shift = 0.0 if not tea else (x - y) * 0.02
    body_z = 0.62 * z if not tea else 0.8 * z
    if tea:
        profile = [
            (0, 0),
            (0.6 * r, 0),
            (0.66 * r, 0.03 * z),
            (r, 0.36 * body_z),
            (0.94 * r, 0.62 * body_z),
            (0.5 * r, 0.93 * body_z),
            (0.46 * r, body_z),
            (0, body_z),
        ]
    else:
        profile = [
            (0, 0),
            (0.94 * r, 0),
            (r, 0.05 * z),
            (0.95 * r, 0.4 * body_z),
            (0.62 * r, 0.8 * body_z),
            (0.4 * r, 0.93 * body_z),
            (0, 0.95 * body_z),
        ]
    finish = "gloss" if tea or d.seed % 2 else "metal"
    rgb = STEEL if finish == "metal" else d.colour
    paint: Pattern | Rgb = rgb
    d.add(lathe(profile, 16).moved(shift), paint, finish)
    knob = body_z + (z - body_z) * (0.35 if not tea else 1.0)
    d.add(
        lathe(
            [
                (0.42 * r, 0.9 * body_z),
                (0.4 * r, 0.97 * body_z),
                (0.08 * r, body_z),
                (0.13 * r, body_z + 0.4 * (knob - body_z)),
                (0.1 * r, knob),
                (0, knob),
            ],
            12,
        ).moved(shift),
        BLACK if not tea else shade(rgb, 0.85),
        "satin",
    )
    tip = x / 2
    spout = [(0.7 * r + shift, 0, 0.3 * body_z), (0.5 * (0.75 * r + tip), 0, 0.55 * body_z), (tip, 0, 0.95 * body_z)]
    d.add(tube(spout, [0.26 * r, 0.2 * r, 0.11 * r], 8), rgb, finish)
    d.hull(lathe(profile, 10).moved(shift))
    d.hull(tube(spout, [0.24 * r, 0.18 * r, 0.11 * r], 6))
    if tea:
        back = -x / 2
        thick = 0.05 * z
        mesh = loop(0.9 * r, 0.2 * body_z, 0.85 * body_z, -back + shift - 0.9 * r - thick, thick, flat=0.8)
        d.add(mesh.turned("z", np.pi).moved(shift), rgb, finish)
        d.box((2 * thick, 2 * thick, 0.65 * body_z), (back + thick, 0, 0.52 * body_z))
        for h in (0.2, 0.85):
            d.box((shift - 0.8 * r - back, 2 * thick, 2 * thick), ((back + shift - 0.8 * r) / 2, 0, h * body_z))
        d.cylinder(0.14 * r, 0.95 * body_z, z, shift)
    else:
        t = np.linspace(0, np.pi, 9)
        path = np.column_stack(
            [np.cos(t) * 0.72 * r, np.zeros(9), 0.62 * body_z + np.sin(t) ** 0.8 * (z - 0.62 * body_z - 0.012)]
        )
        d.add(tube(path, 0.012, 7), BLACK, "satin")
        d.box((0.9 * r, 0.024, 0.024), (0, 0, z - 0.012))
        for side in (-1, 1):
            d.box((0.02, 0.02, z - 0.7 * body_z), (side * 0.6 * r, 0, (z + 0.7 * body_z) / 2 - 0.012))
