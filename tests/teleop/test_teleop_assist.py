"""Clicks: the base drives to a place on the map, the hand reaches above what is seen; ordinary actions, tagged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from teleop_desk import Desk, desk
from teleop_support import SPLIT

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose, grip_position
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.projection import camera_matrix, project
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.teleop.driving.assist import ABOVE_M
from robocasa_lerobot.teleop.telling import header

pytestmark = pytest.mark.render

TASK, CAMERA = "PickPlaceCounterToSink", "robot0_agentview_left"


@pytest.fixture(scope="module")
def env() -> Iterator[KitchenEnv]:
    made = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    yield made
    made.close()


@pytest.fixture
def table(tmp_path: Path, env: KitchenEnv) -> Iterator[Desk]:
    with desk(tmp_path, env, task=TASK) as made:
        yield made


def run(table: Desk, most: int) -> int:
    """Tick until the planned motion has ended; how many steps it took."""
    for step in range(most):
        table.tick()
        if table.session.driver.assistance is None:
            return step
    raise AssertionError(f"it still runs after {most} steps")


def to_the_right(env: KitchenEnv) -> tuple[NDArray[np.float64], float]:
    """A place along the counter, and the heading."""
    start, yaw = base_pose(env.data)
    return start[:2] + np.array([np.sin(yaw), -np.cos(yaw)]) * 0.6, yaw


def test_the_base_drives_to_a_click_on_the_map(table: Desk, env: KitchenEnv) -> None:
    goal, yaw = to_the_right(env)
    table.say("drive_to", x=float(goal[0]), y=float(goal[1]))
    table.tick()
    assert header(table.session, 1, table.now)["assisted"] == {"kind": "drive_to", "planning": True}
    run(table, 200)
    position, heading = base_pose(env.data)
    assert np.linalg.norm(position[:2] - goal) < 0.06
    assert abs(heading - yaw) < 0.1
    origins, actions = table.session.driven.origins, table.session.driven.actions()
    planned = np.array([origin.assisted for origin in origins])
    assert planned.sum() > 10
    mode, arm = contract.ACTION_SLICES["control_mode"], contract.ACTION_SLICES["end_effector_position"]
    assert (actions[planned][:, mode] == 1).all()
    assert not actions[planned][:, arm].any()
    recording = table.session.driven.recording({}, with_policy=False)
    assert np.array_equal(recording.per_step["assisted"][:, 0] == 1, planned)


def test_an_input_ends_a_planned_motion(table: Desk, env: KitchenEnv) -> None:
    goal, _ = to_the_right(env)
    table.say("drive_to", x=float(goal[0]), y=float(goal[1]))
    table.tick(6)
    assert table.session.driver.assistance is not None
    table.hold(1)  # zeros: a key that is let go
    assert table.session.driver.assistance is not None
    table.hold(1, arm=[0, 0, 1, 0, 0, 0])
    assert table.session.driver.assistance is None
    assert not table.session.driven.origins[-1].assisted


def test_the_hand_reaches_above_an_object_in_a_picture(table: Desk, env: KitchenEnv) -> None:
    name = "obj"
    center = env.data.body(name).xpos + np.array([0, 0, env.scene.objects[name].item.size[2] / 2])
    seen, depth = project(center[None], *camera_matrix(env.model, env.data, CAMERA, 1))
    u, v = (seen[0] + 0.5).tolist()
    assert depth[0] > 0
    assert 0 < u < 1
    assert 0 < v < 1
    table.say("reach", camera=CAMERA, u=u, v=v)
    assert table.notes()[-1] == f"reaching above {name}"
    run(table, 250)
    assert "no path" not in table.notes()[-1]
    away = grip_position(env.data) - env.data.body(name).xpos
    assert np.linalg.norm(away[:2]) < 0.05
    assert ABOVE_M[0] - 0.03 < away[2] < ABOVE_M[-1] + 0.15
    assert table.session.driven.origins[-2].assisted  # the last one was zeros again


def test_a_click_is_about_the_picture_that_was_clicked(table: Desk, env: KitchenEnv) -> None:
    renderer = SceneRenderer(env.model, 256, 256)
    try:
        _, geoms = renderer.geometry(env.data, CAMERA)
    finally:
        renderer.close()
    rows, columns = np.nonzero((geoms >= 0) & env.scene.subtree("obj")[env.model.geom_bodyid[geoms]])
    middle = len(rows) // 2
    u, v = (float(columns[middle]) + 0.5) / 256, (float(rows[middle]) + 0.5) / 256
    number, _ = table.session.draw(table.now)
    free = table.session.pictures.shown(number, env, table.session.free)[1]
    table.say("set", mode="base")
    table.say("view", azimuth=2.0)
    table.hold(25, base=[0, 0, 1])
    table.say("reach", camera=CAMERA, u=u, v=v)
    assert "above obj" not in table.notes()[-1]
    table.say("reach", camera=CAMERA, u=u, v=v, frame=10_000)  # none that is known
    assert "above obj" not in table.notes()[-1]
    table.say("reach", camera=CAMERA, u=u, v=v, frame=number)
    assert table.notes()[-1] == "reaching above obj"
    assert free == table.session.pictures.shown(number, env, table.session.free)[1] != table.session.free
    later, _ = table.session.draw(table.now)
    data, _ = table.session.pictures.shown(later, env, table.session.free)
    assert data is not env.data
    assert np.array_equal(data.qpos, env.data.qpos)


def test_what_cannot_be_reached_is_said_and_nothing_moves(table: Desk, env: KitchenEnv) -> None:
    table.say("drive_to", x=500.0, y=500.0)
    table.tick(3)
    assert table.notes()
    assert table.session.driver.assistance is None
    table.say("reach", camera="robot0_agentview", u=0.5, v=0.5)
    assert "no camera" in table.notes()[-1]
    hand = env.data.body(env.robot.names.hand).xpos
    seen, _ = project(hand[None], *camera_matrix(env.model, env.data, CAMERA, 1))
    u, v = np.clip(seen[0] + 0.5, 0, 1).tolist()
    table.say("reach", camera=CAMERA, u=u, v=v)
    assert table.notes()[-1] == "that is the robot itself"
