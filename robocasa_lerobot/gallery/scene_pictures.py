"""Pictures of a task's scene for people: what the policy sees, and the kitchen as a visitor sees it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.footprints import Footprint
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.scene.roles import footprint
from robocasa_lerobot.envs.scene.scene import Scene

_NEAREST_M, _FARTHEST_M, _MARGIN_M, _EYE_M = 1.4, 3.0, 0.2, 1.5


def render_task(
    task: str,
    seed: int,
    out: Path,
    split: str = "target",
    preset: str = "fast",
    image_size: int = 256,
    overview_size: tuple[int, int] = (720, 1280),
    file_format: str = "png",
) -> list[Path]:
    """Write `<task>_<seed>_cameras` and `<task>_<seed>_kitchen` to a folder; returns their paths.

    `overview_size` is (height, width) in pixels, `file_format` "png" or "jpg".

    Raises:
        UnknownNameError: no such task, split or preset.
    """
    env = KitchenEnv(task, split=split, render_preset=preset, image_size=image_size)
    out.mkdir(parents=True, exist_ok=True)
    try:
        observation, _ = env.reset(seed=seed)
        cameras = out / f"{task}_{seed}_cameras.{file_format}"
        Image.fromarray(np.hstack([observation["pixels"][camera] for camera in env.cameras])).save(cameras, quality=90)
        env.close()
        renderer = SceneRenderer(env.model, *overview_size, shadows=preset == "quality")
        kitchen = out / f"{task}_{seed}_kitchen.{file_format}"
        Image.fromarray(renderer.render(env.data, visitor_camera(env.scene, env.data))).save(kitchen, quality=90)
        renderer.close()
    finally:
        env.close()
    return [cameras, kitchen]


def visitor_camera(scene: Scene, data: mujoco.MjData) -> mujoco.MjvCamera:
    """A free camera at eye height behind and beside the robot, as far away as the room and its furniture allow."""
    camera = mujoco.MjvCamera()
    (x, y, _), yaw = base_pose(data)
    camera.lookat = [x + 0.25 * np.cos(yaw), y + 0.25 * np.sin(yaw), 0.95]
    camera.elevation = -14.0
    spots = [
        (_clear_distance(scene, camera, yaw + np.radians(side)), -abs(side), side)
        for side in (28.0, -28.0, 55.0, -55.0, 80.0, -80.0)
    ]
    camera.distance, _, side = max(spots)
    camera.azimuth = float(np.degrees(yaw)) + side
    return camera


def _clear_distance(scene: Scene, camera: mujoco.MjvCamera, azimuth: float) -> float:
    """How far back a camera can stand in a direction, up to 3 m, before a wall or a tall fixture blocks the view."""
    room = scene.layout.room
    low, high = np.array([0.0, room["y_min"]]) + _MARGIN_M, np.array([room["x_max"], 0.0]) - _MARGIN_M
    back = -np.array([np.cos(azimuth), np.sin(azimuth)]) * np.cos(np.radians(camera.elevation))
    tall = [f for f in scene.fixtures.values() if f.pos[2] - f.height / 2 < _EYE_M < f.pos[2] + f.height / 2]
    marks = [footprint(f) for f in tall if scene.layout.types[f.name] != "wall"]  # wall cabinets are no walls
    clear = _NEAREST_M
    for distance in np.arange(_NEAREST_M, _FARTHEST_M + 1e-6, 0.1):
        x, y = camera.lookat[:2] + distance * back
        eye = Footprint(float(x), float(y), 0.0, (0.1, 0.1))
        if not ((low <= (x, y)).all() and ((x, y) <= high).all()) or any(eye.overlaps(mark) for mark in marks):
            break
        clear = float(distance)
    return clear
