"""The surroundings of a room: a closed shell, only to look at.

A robot may stand so near to a wall that a camera beside or behind it is in the wall or beyond it. MuJoCo draws those
faces of a box that look at the camera: from there the wall is not seen, but the room, and beside it nothing.
The shell closes that view with more of the same walls, floor and ceiling; from within the room nothing of it is seen.
"""

from __future__ import annotations

import mujoco

from robocasa_lerobot.envs.kitchens.fixtures.base import add_box
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette
from robocasa_lerobot.envs.rendering.canvas import BACKDROP_GROUP

SURROUNDINGS = "surroundings"  # what it is called in segmentations
# From the room's walls to those of the shell; and how much lower its floor is, and higher its ceiling: what does not
# touch the room's own boxes cannot hide their faces. Metres.
AROUND_M = 1.0
APART_M = 0.15
_THICK_M = 0.05


def add_surroundings(spec: mujoco.MjSpec, palette: MaterialPalette, layout: Layout) -> None:
    """Add the shell to the world body, so that the number of bodies and with it the size of states stay the same.

    Its materials are its own: the look-alike merges shapes of one material, which would move the room's own vertices by
    a rounding error and pictures by a level.
    """
    room = layout.room
    width, depth, height = room["x_max"], -room["y_min"], room["height"]
    low, high = -APART_M, height + APART_M
    x0, y0 = width / 2, -depth / 2
    across, along = width + 2 * (AROUND_M + _THICK_M), depth + 2 * (AROUND_M + _THICK_M)
    boxes = [
        ("floor", (x0, y0, low - _THICK_M / 2), (across, along, _THICK_M)),
        ("ceiling", (x0, y0, high + _THICK_M / 2), (across, along, _THICK_M)),
    ]
    for side in (-1, 1):
        x, y = x0 + side * (across - _THICK_M) / 2, y0 + side * (along - _THICK_M) / 2
        boxes.append(("wall", (x, y0, (low + high) / 2), (_THICK_M, along, high - low)))
        boxes.append(("wall", (x0, y, (low + high) / 2), (across, _THICK_M, high - low)))
    for role, position, size in boxes:
        material = palette.add(f"surroundings_{role}", palette.style.surface(role))
        add_box(spec.worldbody, position, size, material, collide=False).group = BACKDROP_GROUP
