"""Pictures of kitchens without a task: as a photographer sees them, and from above."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.layout import Layout, load_layout
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.rendering.canvas import BACKDROP_GROUP
from robocasa_lerobot.envs.scene.assembly import bare_kitchen

Picture = NDArray[np.uint8]
_EYE_M = 1.60
_WIDE_DEG = 62.0  # vertical field of view of the photographer's lens
_CROWDED_M = 1.9
_HIDDEN_GROUP = 5  # drawn by no camera
_CUT_M = 2.25  # geoms above it are left out of views from above


def kitchen_photo(
    layout_id: int, style_id: int, size: tuple[int, int] = (720, 1280), preset: str = "fast", corner: str = ""
) -> Picture:
    """A view (height, width, 3) from a front corner of the room, the one that shows more; "left" or "right" chooses.

    Raises:
        UnknownNameError: no such layout or style.
    """
    layout = load_layout(layout_id, style_id)
    spec, _ = bare_kitchen(layout, preset)
    spec.visual.global_.fovy = _WIDE_DEG
    model = spec.compile()
    return _render(model, _photographer(layout, corner), size, preset)


def kitchen_plan(layout_id: int, style_id: int, size: tuple[int, int] = (480, 480)) -> Picture:
    """A view (height, width, 3) from straight above without ceiling and wall cabinets' tops, the back wall at the top.

    Raises:
        UnknownNameError: no such layout or style.
    """
    layout = load_layout(layout_id, style_id)
    spec, _ = bare_kitchen(layout)
    room = layout.room
    width, depth = room["x_max"] + 0.3, -room["y_min"] + 0.3
    spec.visual.global_.orthographic = 1
    spec.visual.global_.fovy = max(depth, width * size[0] / size[1])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    low = data.geom_xpos[:, 2] - model.geom_rbound
    hidden = {name for name, f in layout.fixtures.items() if f.pos[2] - f.height / 2 > 1.3}
    for geom in range(model.ngeom):
        root = model.body(int(model.body_rootid[model.geom_bodyid[geom]])).name
        # The shell around the room has a ceiling, too.
        if low[geom] > _CUT_M or root in hidden or model.geom_group[geom] == BACKDROP_GROUP:
            model.geom_group[geom] = _HIDDEN_GROUP
    camera = mujoco.MjvCamera()
    camera.lookat = [room["x_max"] / 2, room["y_min"] / 2, 0.0]
    camera.distance, camera.azimuth, camera.elevation = 6.0, 90.0, -90.0
    camera.orthographic = 1
    return _render(model, camera, size, "fast")


def _render(model: mujoco.MjModel, camera: mujoco.MjvCamera, size: tuple[int, int], preset: str) -> Picture:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = SceneRenderer(model, *size, shadows=preset == "quality")
    try:
        return renderer.render(data, camera)
    finally:
        renderer.close()


def _photographer(layout: Layout, corner: str) -> mujoco.MjvCamera:
    """In the front corner away from the side wall that has more fixtures, looking across the room."""
    room = layout.room
    width, depth = room["x_max"], -room["y_min"]
    if not corner:
        sides = {
            side: sum(f.width for f in layout.of_type("counter") if abs(np.sin(f.yaw) - sign) < 0.1)
            for side, sign in (("left", 1.0), ("right", -1.0))
        }
        fridge = next(f for name, f in layout.fixtures.items() if layout.types[name].startswith("fridge"))
        corner = "left" if sides["right"] > sides["left"] else "right"
        if sides["left"] == sides["right"]:
            corner = "left" if fridge.pos[0] > width / 2 else "right"
        # Not close behind a fridge or a tall housing.
        tall = [f for f in layout.fixtures.values() if f.height > _EYE_M and layout.types[f.name] != "wall"]
        eyes = {side: (0.22 if side == "left" else width - 0.22, 0.22 - depth) for side in sides}
        near = {side: min(np.hypot(f.pos[0] - x, f.pos[1] - y) for f in tall) for side, (x, y) in eyes.items()}
        if near[corner] < _CROWDED_M < max(near.values()):
            corner = "left" if corner == "right" else "right"
    x = 0.22 if corner == "left" else width - 0.22
    eye = np.array([x, -depth + 0.22, _EYE_M])
    if layout.plan == "galley":
        eye[1] = -depth / 2 + 0.1
    target = np.array([width * (0.60 if corner == "left" else 0.40), -depth * 0.12, 1.02])
    return _look(eye, target)


def _look(eye: NDArray[np.float64], target: NDArray[np.float64]) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    view = target - eye
    camera.lookat = target
    camera.distance = float(np.linalg.norm(view))
    camera.azimuth = float(np.degrees(np.arctan2(view[1], view[0])))
    camera.elevation = float(np.degrees(np.arcsin(view[2] / camera.distance)))
    return camera
