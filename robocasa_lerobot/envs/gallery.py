"""Pictures of a task's scene for people: what the policy sees, and the kitchen as a visitor sees it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.rendering import SceneRenderer


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
        Image.fromarray(renderer.render(env.data, visitor_camera(env.scene))).save(kitchen, quality=90)
        renderer.close()
    finally:
        env.close()
    return [cameras, kitchen]


def visitor_camera(scene: Scene) -> mujoco.MjvCamera:
    """A free camera at eye height behind and beside the robot."""
    camera = mujoco.MjvCamera()
    towards = np.array([np.cos(scene.robot.yaw), np.sin(scene.robot.yaw)])
    camera.lookat = [scene.robot.x + 0.25 * towards[0], scene.robot.y + 0.25 * towards[1], 0.95]
    camera.distance = 3.0
    camera.azimuth = float(np.degrees(scene.robot.yaw)) + 28.0
    camera.elevation = -14.0
    return camera
