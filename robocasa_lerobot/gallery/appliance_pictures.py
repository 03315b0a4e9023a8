"""Pictures of appliances by themselves, in several states."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.catalogue import build_appliance
from robocasa_lerobot.envs.kitchens.appliances.parts import HIDDEN_M
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.rendering.canvas import COLLISION_GROUP

_AZIMUTH, _ELEVATION = 116.0, -24.0  # degrees
_FILLED = 0.92  # of the picture, by the appliance in all its states


def appliance_pictures(
    model_id: str, states: Mapping[str, Mapping[str, float]] | None = None, size: int = 256
) -> dict[str, NDArray[np.uint8]]:
    """Pictures (size, size, 3) of a model by the name of the state.

    Args:
        model_id: see `catalogue.models_of`.
        states: for each picture the shares of range that parts are put at; the states of its category if None.
        size: height and width, pixels.

    Raises:
        UnknownNameError: no such model.
    """
    appliance, model = stand_alone(model_id)
    data = mujoco.MjData(model)
    renderer = SceneRenderer(model, size, size)
    pictures = {}
    shown = appliance.looks if states is None else states
    try:
        corners = [_corners(_put(appliance, model, data, shares)) for shares in shown.values()]
        camera = _camera(np.concatenate(corners), np.radians(model.vis.global_.fovy))
        for name, shares in shown.items():
            pictures[name] = renderer.render(_put(appliance, model, data, shares), camera)
    finally:
        renderer.close()
    return pictures


def stand_alone(model_id: str) -> tuple[Appliance, mujoco.MjModel]:
    """An appliance alone in a light room, its box's centre at the origin, and the compiled model."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.visual.headlight.ambient = [0.42, 0.42, 0.42]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 10, 6
    light = spec.worldbody.add_light(
        pos=[0, 0, 3], dir=[0.35, 0.45, -1.0], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    )
    light.diffuse = [0.45, 0.45, 0.44]
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.84, 0.86, 0.88],
        rgb2=[0.62, 0.64, 0.66],
        width=64,
        height=384,
    )
    appliance = build_appliance(model_id, model_id, (0.0, 0.0, 0.0))
    appliance.build(spec, MaterialPalette(spec, load_style(1)))
    return appliance, spec.compile()


def _put(
    appliance: Appliance, model: mujoco.MjModel, data: mujoco.MjData, shares: Mapping[str, float]
) -> mujoco.MjData:
    """The state in which parts are at these shares of their range."""
    mujoco.mj_resetData(model, data)
    for part, share in shares.items():
        appliance.set_share(data, part, share)
    mujoco.mj_forward(model, data)
    return data


def _corners(data: mujoco.MjData) -> NDArray[np.float64]:
    """The corners (N, 3) of the boxes around all geoms that can be seen, m, world."""
    model = data.model
    seen = (model.geom_group != COLLISION_GROUP) & (model.geom_rgba[:, 3] > 0)
    seen &= data.geom_xpos[:, 2] > -HIDDEN_M / 2  # but for water that does not run
    center, half = np.split(model.geom_aabb[seen].reshape(-1, 1, 6), 2, axis=-1)
    own = center + half * np.array(list(itertools.product((-1, 1), repeat=3)))
    turned = own @ data.geom_xmat[seen].reshape(-1, 3, 3).transpose(0, 2, 1)
    corners: NDArray[np.float64] = (turned + data.geom_xpos[seen][:, None]).reshape(-1, 3)
    return corners


def _camera(points: NDArray[np.float64], fovy: float) -> mujoco.MjvCamera:
    """As near as lets all points be seen: the same for all states, with doors and lids where they open to; radians."""
    azimuth, elevation = np.radians(_AZIMUTH), np.radians(_ELEVATION)
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    ahead = np.cos(elevation) * level + np.array([0.0, 0.0, np.sin(elevation)])
    right = np.array([level[1], -level[0], 0.0])
    axes = np.array([right, np.cross(right, ahead), ahead])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    sideways, deep = np.abs(seen - middle)[:, :2].max(axis=1), (seen - middle)[:, 2]
    camera = mujoco.MjvCamera()
    camera.lookat = middle @ axes
    camera.distance = float((sideways / (_FILLED * np.tan(fovy / 2)) - deep).max())
    camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
    return camera
