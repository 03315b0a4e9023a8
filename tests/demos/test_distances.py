"""Objects go beside what they belong to, out of fridges altogether, and drawers open from beside."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.motion import UP, Array, base_pose, grip_position
from robocasa_lerobot.demos.planning.base_path import RobotPose
from robocasa_lerobot.demos.planning.base_room import between
from robocasa_lerobot.demos.skills.drawers import open_drawer
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.heaps import uppermost
from robocasa_lerobot.demos.skills.pick_place.pick import HOPELESS, best_grasp
from robocasa_lerobot.demos.skills.pick_place.poses.distance_poses import distance_terms, near_to
from robocasa_lerobot.demos.skills.pick_place.strategies import (
    FOR_A_TIGHT_SHELF,
    MOST_OUT_M,
    grasp_strategy,
    place_strategy,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.tasks.task import Stage


def made(name: str, seed: int = 100_000, split: str = "target") -> Iterator[KitchenEnv]:
    env = KitchenEnv(name, split=split, cameras=(), terminate_on_success=False)
    env.reset(seed=seed)
    yield env
    env.close()


@pytest.fixture(
    scope="module",
    params=["RecycleBottlesByType", "CategorizeCondiments", "GatherTableware", "ArrangeSinkSanitization"],
)
def sorting(request: pytest.FixtureRequest) -> Iterator[KitchenEnv]:
    yield from made(request.param)


def test_at_the_best_place_all_that_a_stage_asks_of_distances_holds(sorting: KitchenEnv) -> None:
    env = sorting
    for stage in env.declaration.stages:
        if (stage.skill, stage.verb) != ("pick_place", "place"):
            continue
        terms, obj = distance_terms(env, stage), graspable(env, stage.object)
        assert terms
        assert near_to(env, stage)
        best = min(place_strategy(env, stage, obj).poses(), key=lambda pose: pose.extra)
        before = env.data.joint(f"{obj.name}_joint0").qpos.copy()
        assert not all(term.holds(env.scene, env.data) for term in terms)
        env.data.joint(f"{obj.name}_joint0").qpos[:3] = best.point + obj.below(np.eye(3)) * UP
        mujoco.mj_kinematics(env.model, env.data)
        assert all(term.holds(env.scene, env.data) for term in terms)
        env.data.joint(f"{obj.name}_joint0").qpos[:] = before
        mujoco.mj_kinematics(env.model, env.data)


def test_a_stage_that_asks_of_no_distance_keeps_all_its_places() -> None:
    for env in made("WeighIngredients"):
        assert distance_terms(env, env.declaration.stages[0]) == ()
        assert near_to(env, env.declaration.stages[0]) == []


def test_a_stage_is_not_led_to_what_it_asks_to_keep_away_from() -> None:
    for env in made("ClearSinkArea"):
        away = next(stage for stage in env.declaration.stages if stage.verb == "place")
        assert distance_terms(env, away) == ()
        assert near_to(env, away) == []


def _stand_before(env: KitchenEnv, point: Array) -> None:
    """Put the robot in line with a point of the room, aside from where it starts."""
    pose = env.scene.robot_pose
    aside = np.array([-np.sin(pose.yaw), np.cos(pose.yaw)])
    x, y = np.array([pose.x, pose.y]) + aside * (aside @ (point - (pose.x, pose.y)))
    env.scene.robot.place_base(env.model, env.data, float(x), float(y), pose.yaw)
    mujoco.mj_forward(env.model, env.data)


def test_what_comes_first_of_a_heap_is_grasped_more_easily_than_what_the_stage_names() -> None:
    """Standing before it, in those scenes in which either can be grasped from there."""
    costs = []
    for seed in range(100_000, 100_005):
        for env in made("PortionHotDogs", seed):
            stages = env.declaration.stages
            first = uppermost(env, stages, 0)
            assert first > 0, "the named one lies below others"
            costs.append([_cost_before(env, stages[number]) for number in (first, 0)])
    reached = [pair for pair in costs if min(pair) < HOPELESS]
    assert len(reached) >= 3
    assert all(first < named for first, named in reached)


def _cost_before(env: KitchenEnv, stage: Stage) -> float:
    """Of the best grasp for a stage that puts an object down, in line with the object."""
    obj = graspable(env, stage.object)
    _stand_before(env, env.data.body(obj.name).xpos[:2])
    return best_grasp(env, obj, grasp_strategy(env, obj, place_strategy(env, stage, obj).grasp)).cost


@pytest.mark.parametrize("name", ["GarnishPancake", "PackIdenticalLunches"])
def test_the_way_out_of_a_fridge_ends_before_its_front(name: str) -> None:
    for env in made(name):
        stage = next(stage for stage in env.declaration.stages if stage.verb == "pick")
        obj, fridge = graspable(env, stage.object), env.scene.fixture("fridge")
        free = place_strategy(env, env.declaration.stages[-1], obj).grasp
        strategy = grasp_strategy(env, obj, free, kept=True)
        _, y = fridge.to_local(env.data.body(obj.name).xpos)
        assert strategy.out_m > y + fridge.depth / 2 - 0.1


def test_the_way_out_of_a_wall_cabinet_ends_before_its_front() -> None:
    for env in made("PickPlaceCabinetToCounter"):
        stage = env.declaration.stages[0]
        obj = graspable(env, stage.object)
        cabinet = env.scene.fixture("cab")
        _, y = cabinet.to_local(env.data.body(obj.name).xpos)
        strategy = grasp_strategy(env, obj, place_strategy(env, stage, obj).grasp)
        assert strategy.out_m >= min(y + cabinet.depth / 2, MOST_OUT_M)


def test_what_fills_the_room_between_shelves_is_not_grasped_from_above_it() -> None:
    for env in made("RearrangeFridgeItems"):
        stage = next(stage for stage in env.declaration.stages if stage.object == "pitcher")
        pitcher = graspable(env, "pitcher")
        assert place_strategy(env, stage, pitcher).grasp is FOR_A_TIGHT_SHELF


def test_what_goes_behind_others_on_a_shelf_is_not_grasped_from_above_it() -> None:
    for env in made("LoadFridgeFifo"):
        stage = next(stage for stage in env.declaration.stages if stage.verb == "place")
        assert place_strategy(env, stage, graspable(env, stage.object)).grasp is FOR_A_TIGHT_SHELF


def test_a_drawer_is_opened_from_beside_by_a_robot_that_stood_before_it() -> None:
    for env in made("DeliverStraw"):
        drawer = env.scene.fixture("drawer", Drawer)
        across = np.array([np.cos(drawer.yaw), np.sin(drawer.yaw), 0.0])

        def aside(across: Array = across, drawer: Drawer = drawer, env: KitchenEnv = env) -> float:
            return abs(float((base_pose(env.data)[0] - np.asarray(drawer.pos)) @ across)) - drawer.width / 2

        assert aside() < 0.0
        for step in itertools.islice(open_drawer(env, env.declaration.stages[0]), 400):
            env.step(step.astype(np.float32))
            if np.linalg.norm(grip_position(env.data) - np.asarray(drawer.pos)) < 0.3:
                break
        assert aside() > 0.0


def test_a_move_is_divided_so_that_place_and_heading_change_alike() -> None:
    poses = between(RobotPose(0.0, 0.0, 0.0), RobotPose(1.0, 0.5, 1.0), 0.15, 0.25)
    assert len(poses) == 7
    for pose in poses:
        assert pose.y == pytest.approx(pose.x / 2)
        assert pose.yaw == pytest.approx(pose.x)
