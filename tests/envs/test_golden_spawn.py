"""Where the robot starts, against RoboCasa's rules: facing the counter, a little off, touching nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from task_selection import every_task

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout, load_layout
from robocasa_lerobot.envs.kitchens.splits import scene_ids
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.build import arrange, build_scene
from robocasa_lerobot.envs.scene.robot_poses import Obstacles, RobotPose, robot_pose
from robocasa_lerobot.envs.scene.roles import candidates, counter_of
from robocasa_lerobot.envs.scene.spec import RobotStart
from robocasa_lerobot.envs.tasks.registry import get_task

STANDOFF_M = 0.20  # of the base centre from the counter's front edge
DEVIATION_M = (0.15, 0.05)  # half ranges along the counter and towards it
LAYOUTS = sorted({layout for layout, _ in scene_ids("target")})


def _in_counter(counter: Counter, pose: RobotPose) -> tuple[float, float]:
    """Along the counter from its middle, and from its front edge into the room, metres."""
    offset = np.array([pose.x - counter.pos[0], pose.y - counter.pos[1]])
    along = np.array([np.cos(counter.yaw), np.sin(counter.yaw)])
    inwards = np.array([-np.sin(counter.yaw), np.cos(counter.yaw)])
    return float(along @ offset), float(-inwards @ offset - counter.depth / 2)


def _sinks() -> list[tuple[Layout, Fixture]]:
    layouts = [load_layout(layout_id) for layout_id in LAYOUTS]
    return [(layout, sink) for layout in layouts for sink in candidates(layout, "sink")]


def test_the_standard_deviation_is_robocasas() -> None:
    assert RobotStart("sink").deviation == DEVIATION_M
    assert PANDA_OMRON.shape.standoff == STANDOFF_M


def test_poses_spread_uniformly_about_the_place_in_front_of_the_fixture() -> None:
    rng = np.random.default_rng(0)
    layout, sink = _sinks()[0]
    counter = counter_of(layout, sink)
    centre = _in_counter(counter, RobotPose(sink.pos[0], sink.pos[1], 0.0))[0]
    rows = []
    for _ in range(500):
        pose = robot_pose(rng, layout, RobotStart("sink"), sink, PANDA_OMRON.shape)
        assert pose.yaw == pytest.approx(counter.yaw + np.pi / 2)  # facing it, without noise
        along, away = _in_counter(counter, pose)
        rows.append((along - centre, away - STANDOFF_M))
    spread = np.array(rows)
    assert (np.abs(spread) <= DEVIATION_M).all()
    # To both sides and both nearer and farther; the standard deviation of a uniform number is its half range / sqrt 3.
    np.testing.assert_allclose(spread.mean(axis=0), 0.0, atol=0.02)
    np.testing.assert_allclose(spread.std(axis=0), np.array(DEVIATION_M) / np.sqrt(3), rtol=0.1)


def test_in_front_of_an_object_is_in_front_of_the_region_where_it_was_drawn() -> None:
    """Of a wide one, so that the object itself may be far aside; and of what lies in a bowl, the bowl's region."""
    aside, off = [], []
    for name in ("BreadSetupSlicing", "AddIceCubes"):
        task = get_task(name)
        task = replace(task, robot_start=replace(task.robot_start, deviation=(0.0, 0.0)))
        for seed, layout_id in enumerate((11, 21, 31, 41, 51)):
            try:
                found = arrange(np.random.default_rng(seed), task, "pretrain", load_layout(layout_id, layout_id))
            except PlacementError:
                continue
            placed, pose = found.objects[task.robot_start.at_object], found.robot_pose
            side = np.array([-np.sin(pose.yaw), np.cos(pose.yaw)])
            aside.append(abs(float(side @ (np.array(placed.region_middle) - (pose.x, pose.y)))))
            off.append(abs(float(side @ (np.array(placed.pos[:2]) - placed.region_middle))))
            inside = {one.region_middle for key, one in found.objects.items() if key.startswith("ice_cube")}
            assert inside == ({placed.region_middle} if name == "AddIceCubes" else set())
    assert len(aside) >= 7
    assert sorted(aside)[len(aside) // 2] == pytest.approx(0, abs=1e-9)  # where there was room
    assert max(off) > 0.3


def test_blocked_poses_are_drawn_again_and_the_deviation_widens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fifty tries, then 0.10 m and 0.05 m more on each side."""
    layout, sink = _sinks()[0]
    counter = counter_of(layout, sink)
    tried: list[tuple[float, float]] = []

    def free(_: Obstacles, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
        tried.extend(_in_counter(counter, pose) for pose in poses)
        return np.arange(len(tried) - len(poses), len(tried)) >= 120

    monkeypatch.setattr(Obstacles, "leave_free", free)
    found = robot_pose(np.random.default_rng(1), layout, RobotStart("sink"), sink, PANDA_OMRON.shape)
    assert _in_counter(counter, found) == tried[120]  # the first that is free
    centre = _in_counter(counter, RobotPose(sink.pos[0], sink.pos[1], 0.0))[0]
    off = np.abs(np.array(tried) - (centre, STANDOFF_M))
    for group, extra in ((slice(0, 50), 0), (slice(50, 100), 1), (slice(100, 150), 2)):
        limits = np.array(DEVIATION_M) + extra * np.array((0.10, 0.05))
        assert (off[group] <= limits).all()
        assert (off[group].max(axis=0) > 0.8 * limits).all()


def test_a_layout_without_a_free_place_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    layout, sink = _sinks()[0]
    monkeypatch.setattr(Obstacles, "leave_free", lambda _, poses: np.zeros(len(poses), dtype=bool))
    with pytest.raises(PlacementError, match="no free place"):
        robot_pose(np.random.default_rng(0), layout, RobotStart("sink"), sink, PANDA_OMRON.shape)


@pytest.mark.parametrize("task", every_task())
def test_the_robot_starts_free_of_everything(task: str) -> None:
    for seed in range(3):
        scene = build_scene(get_task(task), "target", seed)
        data, _ = scene.initial_data(np.random.default_rng(seed))
        _assert_free(scene.model, data)


@pytest.mark.parametrize(
    ("task", "layout", "style"), [("CloseMicrowave", 60, 45), ("PickPlaceCabinetToCounter", 33, 60)]
)
def test_it_does_not_stand_in_an_open_door(task: str, layout: int, style: int) -> None:
    """Its elbow was in the door, which that pushed open."""
    scene = build_scene(get_task(task), "pretrain", 100 * layout + style, kitchens=[(layout, style)])
    data, _ = scene.initial_data(np.random.default_rng(100 * layout + style))
    _assert_free(scene.model, data)


def test_it_stands_free_even_at_the_nearest_pose() -> None:
    scene = build_scene(get_task("PickPlaceCounterToSink"), "target", 0)
    layout = load_layout(scene.layout_id)
    counter = counter_of(layout, layout.fixtures[scene.roles["sink"]])
    robot, (_, away) = scene.robot_pose, _in_counter(counter, scene.robot_pose)
    nearer = away - (STANDOFF_M - DEVIATION_M[1])
    assert nearer > 0.0
    scene.robot_pose = replace(robot, x=robot.x + nearer * np.cos(robot.yaw), y=robot.y + nearer * np.sin(robot.yaw))
    assert _in_counter(counter, scene.robot_pose)[1] == pytest.approx(0.15)
    data, _ = scene.initial_data(np.random.default_rng(0))
    _assert_free(scene.model, data)


def _assert_free(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    robot = model.body("robot0_base").id
    for contact in data.contact:
        bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
        of_robot = [model.body_rootid[body] == robot for body in bodies]
        touching = [model.geom(int(geom)).name for geom in contact.geom]
        assert sum(of_robot) != 1 or "floor" in touching, touching
