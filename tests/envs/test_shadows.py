"""Shadows of the preset `quality`: everywhere in the room, of what is in it, and not of its own ceiling."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.layout import load_layout
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.scene.assembly import bare_kitchen

pytestmark = pytest.mark.render

_LAYOUT = 1  # one wall: the floor is free from its middle to its front
_PLACES = [(0.5, 0.6), (0.15, 0.85), (0.85, 0.85)]  # shares of the room's width and depth


def test_what_hangs_in_a_room_shades_its_floor_anywhere_and_the_ceiling_does_not() -> None:
    layout = load_layout(_LAYOUT, 3)
    spec, _ = bare_kitchen(layout, "quality")
    places = [(x * layout.room["x_max"], y * layout.room["y_min"]) for x, y in _PLACES]
    for number, (x, y) in enumerate(places):
        plate = spec.worldbody.add_geom(name=f"plate_{number}", type=mujoco.mjtGeom.mjGEOM_BOX)
        plate.pos, plate.size = [x, y, 1.5], [0.5, 0.5, 0.01]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 0.6, 90.0, -60.0  # below the plates
    seen = {}
    for name, shadows, group in (("plain", False, 0), ("lit", True, 0), ("shaded", True, 1)):
        for number in range(len(places)):
            model.geom(f"plate_{number}").group = group
        renderer = SceneRenderer(model, 48, 48, shadows=shadows)
        means = []
        for x, y in places:
            camera.lookat = [x, y, 0.0]
            means.append(renderer.render(data, camera)[16:32, 16:32].mean())
        renderer.close()
        seen[name] = np.array(means)
    np.testing.assert_allclose(seen["lit"], seen["plain"], atol=25)  # the floor shines a little
    assert (seen["lit"] - seen["shaded"] > 40).all(), seen
