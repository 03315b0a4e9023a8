"""Pictures of appliances by themselves, in several states."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.catalogue import build_appliance
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.rendering import SceneRenderer

_AZIMUTH, _ELEVATION = 116.0, -24.0  # degrees


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
    try:
        for name, shares in (appliance.looks if states is None else states).items():
            mujoco.mj_resetData(model, data)
            for part, share in shares.items():
                appliance.set_share(data, part, share)
            mujoco.mj_forward(model, data)
            pictures[name] = renderer.render(data, _camera(appliance))
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


def _camera(appliance: Appliance) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    extent = float(np.linalg.norm(appliance.size))
    camera.lookat = [0.0, -0.1 * extent, 0.0]
    camera.distance = 1.6 * extent
    camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
    return camera
