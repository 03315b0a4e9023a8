"""What an env shows of its cameras: pictures, and on request depth and the object or fixture of each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.surroundings import SURROUNDINGS
from robocasa_lerobot.envs.rendering import SceneRenderer

BACKGROUND = "background"
Pictures = dict[str, dict[str, Any]]


def picture_spaces(
    cameras: Sequence[str], size: int, *, depth: bool = False, segmentation: bool = False
) -> dict[str, gymnasium.spaces.Space[Any]]:
    """Spaces of what `take_pictures` returns, by observation key."""
    kinds: dict[str, gymnasium.spaces.Box] = {"pixels": gymnasium.spaces.Box(0, 255, (size, size, 3), np.uint8)}
    if depth:
        kinds["depth"] = gymnasium.spaces.Box(0.0, np.inf, (size, size, 1), np.float32)
    if segmentation:
        most = np.iinfo(np.int32).max
        kinds["segmentation"] = gymnasium.spaces.Box(-1, most, (size, size, 1), np.int32)
    return {key: gymnasium.spaces.Dict(dict.fromkeys(cameras, box)) for key, box in kinds.items()}


def take_pictures(
    renderer: SceneRenderer,
    data: mujoco.MjData,
    cameras: Sequence[str],
    *,
    depth: bool = False,
    segmentation: bool = False,
) -> Pictures:
    """Pictures of the present state by observation key and camera.

    `pixels` uint8 (S, S, 3); with `depth` also float32 (S, S, 1), metres along the optical axis; with `segmentation`
    also int32 (S, S, 1), ids of the model's geoms, -1 where nothing is seen. All upright.
    """
    taken: Pictures = {"pixels": dict(zip(cameras, renderer.pictures(data, cameras), strict=True))}
    if depth or segmentation:
        geometry = {camera: renderer.geometry(data, camera) for camera in cameras}
        if depth:
            taken["depth"] = {camera: metres[..., None] for camera, (metres, _) in geometry.items()}
        if segmentation:
            taken["segmentation"] = {camera: ids[..., None] for camera, (_, ids) in geometry.items()}
    return taken


def segmentation_names(model: mujoco.MjModel, robot_base: str) -> tuple[str, ...]:
    """What each geom id of a segmentation belongs to (ngeom + 1,): a fixture, an object, a body of the robot,
    or the surroundings of the room.

    The last entry is the background's, which id -1 finds: `numpy.array(names)[segmentation]` is right as it stands.
    """
    robot = model.body(robot_base).id
    owners = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        root = body
        while root != robot and int(model.body_parentid[root]) != 0:
            root = int(model.body_parentid[root])
        # The world's own geoms are the surroundings of the room.
        owners.append(SURROUNDINGS if root == 0 else model.body(body if root == robot else root).name)
    return (*owners, BACKGROUND)
