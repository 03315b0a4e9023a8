"""A kitchen as an MjSpec: its fixtures, light and options, before robot and objects come in."""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.kitchens.surroundings import add_surroundings
from robocasa_lerobot.envs.physics.options import apply_simulation_options

_BELOW_CEILING_M = 0.1  # of the light that casts shadows: below the lamps


def bare_kitchen(layout: Layout, render_preset: str = "fast") -> tuple[mujoco.MjSpec, MaterialPalette]:
    """The spec of a layout's fixtures, and the palette that has added its style's materials."""
    spec = mujoco.MjSpec()
    spec.modelname = f"kitchen_{layout.layout_id}_{layout.style_id}"
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    apply_simulation_options(spec)
    # Bodies at rest sleep: a kitchen of a hundred joints then costs little more than its robot.
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    _light(spec, layout, render_preset)
    palette = MaterialPalette(spec, load_style(layout.style_id))
    for fixture in layout.fixtures.values():
        fixture.build(spec, palette)
    add_surroundings(spec, palette, layout)
    return spec, palette


def _light(spec: mujoco.MjSpec, layout: Layout, render_preset: str) -> None:
    visual = spec.visual
    visual.headlight.ambient = [0.42, 0.42, 0.42]
    visual.headlight.diffuse = [0.20, 0.20, 0.20]
    visual.headlight.specular = [0.05, 0.05, 0.05]
    visual.quality.shadowsize = 4096
    visual.quality.offsamples = 0 if render_preset == "fast" else 8
    if render_preset == "fast":
        # Fewer facets on round shapes: half the time of a software-rendered picture, hardly visible at 256 pixels.
        visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads = 10, 6, 1
    visual.map.zfar = 14.0
    # Distances of the map are in units of the model's extent.
    room = layout.room
    spec.stat.extent = 1.0
    spec.stat.center = [(room["x_min"] + room["x_max"]) / 2, room["y_min"] / 2, 1.0]
    shadows = render_preset == "quality"
    if shadows:  # all of the room; MuJoCo's own is a metre around the light
        visual.map.shadowclip = float(np.hypot(room["x_max"] - room["x_min"], room["y_min"])) / 2
    for name, position, direction, strength, casts in _lights(layout, shadows):
        light = spec.worldbody.add_light(name=name, pos=position, dir=direction)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.diffuse = [strength, strength, strength * 0.97]
        # Of a light that grazes a face a rounding error decides whether it shines.
        light.specular = [0.0 if 0.0 in direction else 0.25] * 3
        light.castshadow = casts


def _lights(layout: Layout, shadows: bool) -> list[tuple[str, list[float], list[float], float, bool]]:
    """Name, position, direction, strength, and whether it casts shadows, of each light.

    Only what is in front of a light's plane casts shadows: of one that leans, ceiling and walls would shade half the
    room. So where there are shadows the ceiling's light comes in two, straight down from below the ceiling and level:
    upright and level faces look as they do in the light of the one.
    """
    room = layout.room
    middle, deep, high = (room["x_min"] + room["x_max"]) / 2, room["y_min"], room["height"]
    across, along, strength = 0.14, 0.40, 0.43
    window = ("window_light", [middle, -0.2, 2.2], [-0.55, -0.35, -0.8], 0.17, False)
    if not shadows:
        return [("ceiling_light", [middle, deep * 0.7, high], [across, along, -1.0], strength, False), window]
    level = float(np.hypot(across, along))
    down = strength / float(np.hypot(level, 1.0))
    return [
        ("ceiling_light", [middle, deep / 2, high - _BELOW_CEILING_M], [0.0, 0.0, -1.0], down, True),
        ("level_light", [middle, deep, high / 2], [across, along, 0.0], down * level, False),
        window,
    ]
