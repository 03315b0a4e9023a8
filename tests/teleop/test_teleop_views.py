"""The camera that flies along sees the robot, also where walls and cupboards are close."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ROBOT_BASE
from robocasa_lerobot.teleop.views import FreeCamera, _in_the_open

# With an island in front and cupboards behind; and one with room behind.
KITCHENS = [("CloseDrawer", "target", 100_002), ("OpenDrawer", "pretrain", 100_003)]


@pytest.mark.parametrize(("task", "split", "seed"), KITCHENS)
def test_nothing_stands_between_the_free_camera_and_the_robot(task: str, split: str, seed: int) -> None:
    env = KitchenEnv(task, split=split, cameras=())
    env.reset(seed=seed)
    model, data = env.model, env.data
    robot = model.body_rootid[model.body(ROBOT_BASE).id]
    hit = np.full(1, -1, dtype=np.int32)
    for azimuth in np.linspace(0, 2 * np.pi, 9):
        camera = FreeCamera(azimuth=float(azimuth)).camera(data)
        turn, tip = np.radians(camera.azimuth), np.radians(camera.elevation)
        ahead = np.array([np.cos(tip) * np.cos(turn), np.cos(tip) * np.sin(turn), np.sin(tip)])
        eye = np.array(camera.lookat) - camera.distance * ahead
        free = mujoco.mj_ray(model, data, eye, ahead, None, 1, -1, hit)
        seen = model.body_rootid[model.geom_bodyid[hit[0]]] == robot
        assert seen or not 0 <= free < camera.distance - 0.05, (azimuth, model.geom(hit[0]).name)
    env.close()


def test_where_there_is_room_it_stays_where_it_was_asked_for() -> None:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body name='{ROBOT_BASE}'><geom size='.2'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert _in_the_open(data, np.zeros(3), 0.3, -0.5, 2.0) == (-0.5, 2.0)
