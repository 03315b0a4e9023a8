"""What a robot's cameras see from where tasks may start it in a kitchen: whether they see past the room's walls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import load_layout
from robocasa_lerobot.envs.kitchens.materials import split_of
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.robots.robot import Robot
from robocasa_lerobot.envs.scene.assembly import bare_kitchen
from robocasa_lerobot.envs.scene.build import arrange
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec

TRIES = 20  # arrangements of a task in a kitchen until it counts as one that the kitchen does not admit


@dataclass(frozen=True)
class View:
    """What one camera sees at the start of a task.

    Attributes:
        layout_id: of the kitchen.
        task, camera: names.
        background: share of the pixels that show nothing at all.
        beyond_m: how far the camera is outside of the room, 0 inside, metres.
        pose: of the robot: x, y and yaw.
    """

    layout_id: int
    task: str
    camera: str
    background: float
    beyond_m: float
    pose: tuple[float, float, float]


def views(
    layout_id: int,
    tasks: Sequence[SceneSpec],
    seed: int,
    *,
    starts: int = 1,
    size: int = 48,
    camera_set: str = "default",
    robot: Robot = PANDA_OMRON,
) -> Iterator[View]:
    """What every camera of a set sees in a bare kitchen, from `starts` starts of each task that the kitchen admits.

    Objects are left out: they can only hide what lies behind them. Doors are closed.

    Args:
        layout_id: of the kitchen; its style is that of the same number.
        tasks: whose starts are tried.
        seed: of the starts.
        starts: of each task.
        size: of the pictures, pixels.
        camera_set: name.
        robot: that starts.
    """
    layout = load_layout(layout_id)
    spec, _ = bare_kitchen(layout)
    robot.add_to(spec, "fast", camera_set)
    model = spec.compile()
    data = mujoco.MjData(model)
    robot.set_home(model, data)
    room = layout.room
    low = np.array([room["x_min"], room["y_min"], 0.0])
    high = np.array([room["x_max"], 0.0, room["height"]])
    renderer = SceneRenderer(model, size, size)
    try:
        for task in tasks:
            rng = np.random.default_rng([seed, layout_id, *task.name.encode()])
            for _ in range(starts):
                pose = _start(rng, task, layout_id, robot)
                if pose is None:
                    break
                robot.place_base(model, data, *pose)
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_camlight(model, data)
                for camera in robot.cameras(camera_set):
                    _, geoms = renderer.geometry(data, camera.name)
                    at = data.camera(camera.name).xpos
                    beyond = float(np.maximum(np.maximum(low - at, at - high), 0.0).max())
                    yield View(layout_id, task.name, camera.name, float((geoms == -1).mean()), beyond, pose)
    finally:
        renderer.close()


def _start(
    rng: np.random.Generator, task: SceneSpec, layout_id: int, robot: Robot
) -> tuple[float, float, float] | None:
    """Where a start of the task puts the robot; None where the kitchen does not admit it."""
    for _ in range(TRIES):
        try:
            start = arrange(rng, task, split_of(layout_id), load_layout(layout_id), robot).robot_pose
        except PlacementError:
            continue
        return start.x, start.y, start.yaw
    return None
