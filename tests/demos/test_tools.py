"""What is held is used: boards are wiped, pots stirred, pans poured out and stood in sinks; the spout is swept."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.motion import UP, HandTarget, rotation_about
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.skills.pick_place.by_handle import (
    PAN_BY_THE_HANDLE,
    TOOL_BY_THE_HANDLE,
    has_handle,
    working_end,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import DOWN, graspable
from robocasa_lerobot.demos.skills.pick_place.poses.basin_poses import below_spout, is_large, on_floor, room_in
from robocasa_lerobot.demos.skills.pick_place.tools.pour import Tilting
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.tasks.registry import get_task, task_names


def made(name: str) -> Iterator[KitchenEnv]:
    env = KitchenEnv(name, split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=100_000)
    yield env
    env.close()


@pytest.fixture(scope="module")
def soak() -> Iterator[KitchenEnv]:
    yield from made("PreSoakPan")


@pytest.fixture(scope="module")
def stir() -> Iterator[KitchenEnv]:
    yield from made("StirVegetables")


@pytest.fixture(scope="module")
def colander() -> Iterator[KitchenEnv]:
    yield from made("WashFruitColander")


def test_every_target_task_has_a_skill_for_each_stage() -> None:
    sets = published_task_sets()
    declared = set(task_names())
    lacking = [
        name
        for kind in ("composite_seen", "composite_unseen")
        for name in sets[kind]
        if name in declared and not can_demonstrate(get_task(name))
    ]
    assert not lacking


def test_a_tool_is_held_far_from_its_wider_end_and_a_pan_near_it(stir: KitchenEnv, soak: KitchenEnv) -> None:
    for env, name, strategy in ((stir, "spatula", TOOL_BY_THE_HANDLE), (soak, "obj1", PAN_BY_THE_HANDLE)):
        obj = graspable(env, name)
        end, body = working_end(obj), env.data.body(name)
        assert end.length == pytest.approx(max(obj.item.size) if obj.item else 0.0, abs=0.01)
        assert end.tip[0] > 0.1  # blades and pans are made towards x, handles away from it
        poses = strategy.poses(env, obj, DOWN)
        assert poses
        turn = body.xmat.reshape(3, 3)
        far = [float((turn.T @ (pose.position - body.xpos) - end.tip) @ end.axis) for pose in poses]
        assert min(far) > 0.47 * end.length
    assert has_handle(graspable(soak, "obj1"))
    assert not has_handle(graspable(stir, "pot"))


def test_a_pan_has_room_in_a_basin_along_it_and_not_across(soak: KitchenEnv) -> None:
    env, obj = soak, graspable(soak, "obj1")
    sink = env.scene.fixture("sink", Sink)
    assert is_large(obj)
    assert not is_large(graspable(env, "obj2"))
    cost = room_in(env, obj, sink.basin)
    along = env.data.body(sink.name).xmat.reshape(3, 3)
    middle = sink.basin.world(env.data)
    assert cost(middle, along) == 0.0
    assert cost(middle, rotation_about(UP, np.pi / 2) @ along) > 0.1
    floor = sink.basin.world(env.data, (0.0, 0.0, -sink.basin.half[2]))[2]
    poses = on_floor(env, sink.basin)()
    assert min(pose.point[2] for pose in poses) == pytest.approx(floor)
    assert all(sink.basin.contains(env.data, pose.point + 0.001 * UP) for pose in poses)


def test_a_colander_comes_to_stand_where_the_stream_falls_into_it(colander: KitchenEnv) -> None:
    env = colander
    sink = env.scene.fixture("sink", Sink)
    tip = env.data.site(f"{sink.name}_water").xpos
    obj = graspable(env, "colander")
    poses = below_spout(env, obj, sink)()
    best = min(poses, key=lambda pose: pose.extra)
    assert all(np.linalg.norm((pose.point - tip)[:2]) < 0.08 for pose in poses)
    assert best.point[2] < tip[2] - 0.15


def test_a_vessel_is_tilted_about_its_edge() -> None:
    tilting = Tilting(np.array([1.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.pi / 2)
    hand = HandTarget(np.array([0.8, 0.0, 1.0]), np.eye(3))
    assert np.allclose(tilting.after(hand, 0.0).position, hand.position)
    up = tilting.after(hand, 1.0)
    assert np.allclose(up.position, [1.0, 0.0, 1.2])
    assert np.allclose(up.rotation[:, 0], [0.0, 0.0, -1.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "task", ["RinseSinkBasin", "ScrubCuttingBoard", "PanTransfer", "PreSoakPan", "WashFruitColander", "GetToastedBread"]
)
@pytest.mark.parametrize("split", ["target", "pretrain"])
def test_tools_water_and_heat_are_demonstrated(task: str, split: str) -> None:
    env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
    outcomes = []
    for seed in (100_000, 100_001):
        recording = record_episode(env, seed, varied=True)
        outcomes.append(recording.reason)
        if recording.success:
            break
    env.close()
    assert recording.success, outcomes
