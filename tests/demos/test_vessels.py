"""Vessels are held where water falls onto what is in them, put onto burners that are free, and these are turned on."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from goal_states import put_object

from robocasa_lerobot.demos.motion import DEAD_ZONE, UP, rotation_about
from robocasa_lerobot.demos.skills import SkillError
from robocasa_lerobot.demos.skills.navigation import SOFTLY, Pace
from robocasa_lerobot.demos.skills.pick_place.carrying.level import levelled
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.hold import hold_poses
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import on_object, over_burners
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.predicates import AllOf, GripperFar, OnBurner, StateIs, UnderWater
from robocasa_lerobot.envs.predicates.objects import RECEPTACLE_SHARE, radius
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.stage_text import stage_text
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import UserError


def made(name: str, split: str) -> Iterator[KitchenEnv]:
    env = KitchenEnv(name, split=split, cameras=())
    env.reset(seed=3)
    yield env
    env.close()


@pytest.fixture(params=["target", "pretrain"])
def lettuce(request: pytest.FixtureRequest) -> Iterator[KitchenEnv]:
    yield from made("WashLettuce", request.param)


@pytest.fixture(params=["target", "pretrain"])
def kettle(request: pytest.FixtureRequest) -> Iterator[KitchenEnv]:
    yield from made("KettleBoiling", request.param)


@pytest.fixture(params=["target", "pretrain"])
def leftovers(request: pytest.FixtureRequest) -> Iterator[KitchenEnv]:
    yield from made("StoreLeftoversInBowl", request.param)


def test_what_goes_into_a_vessel_goes_beside_what_lies_across_it(leftovers: KitchenEnv) -> None:
    env, data = leftovers, leftovers.data
    bowl = data.body("bowl").xpos.copy()
    poses = on_object(env, graspable(env, "vegetable"), "bowl")
    alone = min(poses(), key=lambda pose: pose.extra)
    assert np.linalg.norm((alone.point - bowl)[:2]) < 0.005
    for yaw in (0.4, 1.9):
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, UP, yaw)
        put_object(env.scene, data, "chicken_drumstick", bowl + 0.02 * UP)
        data.joint("chicken_drumstick_joint0").qpos[3:] = turn
        mujoco.mj_forward(env.model, data)
        assert graspable(env, "bowl").contents == ("chicken_drumstick",)
        best = min(poses(), key=lambda pose: pose.extra)
        along, across = np.abs(rotation_about(UP, -yaw) @ (best.point - data.body("chicken_drumstick").xpos))[:2]
        assert across > 0.012  # it is longer along its x axis
        assert np.linalg.norm((best.point - bowl)[:2]) < 0.06, along


def test_every_pose_on_a_tray_counts_as_on_it() -> None:
    """Also beside what lies there: the corners are farther from the middle than goals count."""
    env = KitchenEnv("PackDessert", split="pretrain", cameras=())
    env.reset(seed=100_403)
    holder = "cooked_food_container"
    assert graspable(env, holder).contents == ("cooked_food",)
    middle = env.data.body(holder).xpos
    found = [pose.point for pose in on_object(env, graspable(env, "dessert"), holder)()]
    away = np.linalg.norm(np.array(found)[:, :2] - middle[:2], axis=1)
    limit = RECEPTACLE_SHARE * radius(env.scene, holder)
    assert 0.5 * limit < away.max() < limit
    env.close()


def test_a_tilted_vessel_is_turned_upright_by_the_least_turn_and_one_that_lies_is_left() -> None:
    for tilt in (0.0, 0.2, 0.6):
        turn = rotation_about(np.array([0.6, 0.8, 0.0]), tilt) @ rotation_about(UP, 1.0)
        upright = levelled(turn)
        assert np.allclose(upright[:, 2], UP)
        assert np.allclose(upright, rotation_about(UP, 1.0))
    lying = rotation_about(np.array([1.0, 0.0, 0.0]), 1.2)
    assert np.array_equal(levelled(lying), lying)


def test_a_base_with_a_loaded_vessel_changes_its_speed_by_and_by() -> None:
    pace, free = Pace(changes=SOFTLY), Pace()
    wanted, before = np.array([1.0, -0.4, 0.3, 0.0]), np.zeros(4)
    assert np.array_equal(free.next(wanted), wanted)
    for step in range(20):
        now = pace.next(wanted)
        assert np.abs(now - before).max() <= SOFTLY[0] + (DEAD_ZONE if step == 0 else 0.0) + 1e-9
        before = now
    assert np.allclose(now, wanted)
    for _ in range(30):
        now = pace.next(-wanted)
    assert np.allclose(now, -wanted)


def test_at_every_hold_pose_the_contents_are_under_water(lettuce: KitchenEnv) -> None:
    env = lettuce
    stage, obj = env.declaration.stages[1], graspable(env, "lettuce_container")
    assert stage_text(stage, env.scene) == "hold the colander under the faucet of the sink"
    assert obj.contents == ("lettuce",)
    poses = hold_poses(env, stage, obj)
    assert len(poses) > 8
    sink, data = env.scene.fixture("sink", Sink), env.data
    sink.set_water(data, on=True)
    vessel, food = (data.joint(f"{name}_joint0") for name in ("lettuce_container", "lettuce"))
    tip = data.site(f"{sink.name}_water").xpos.copy()
    turn, before = data.body("lettuce_container").xmat.reshape(3, 3).copy(), vessel.qpos[:3].copy()
    inside = food.qpos[:3] - before
    for pose in poses:
        vessel.qpos[:3] = pose.point - turn @ pose.local
        food.qpos[:3] = vessel.qpos[:3] + inside
        mujoco.mj_forward(env.model, data)
        assert UnderWater("lettuce", "sink").holds(env.scene, data)
        for name in ("lettuce_container", "lettuce"):
            body = data.body(name)
            assert (graspable(env, name).cloud @ body.xmat.reshape(3, 3).T + body.xpos)[:, 2].max() < tip[2] - 0.02


def test_what_no_water_is_to_run_over_is_not_held_anywhere(lettuce: KitchenEnv) -> None:
    other = Stage("pick_place", "hold", "sink", object="lettuce_container", until=StateIs("sink", "water_on"))
    with pytest.raises(SkillError, match="belongs"):
        hold_poses(lettuce, other, graspable(lettuce, "lettuce_container"))


def test_burners_that_carry_something_are_not_free(kettle: KitchenEnv) -> None:
    env, hob = kettle, kettle.scene.fixture("stove", Hob)
    obj = graspable(env, "obj")
    free = over_burners(env, obj, hob, list(hob.burners))

    def burners() -> set[str]:
        return {hob.nearest_burner(env.data, pose.point)[0] for pose in free()}

    for burner in hob.burners:
        put_object(env.scene, env.data, "stove_distr", hob.regions[burner].world(env.data))
        mujoco.mj_forward(env.model, env.data)
        assert burner not in burners()
        assert burners()
    put_object(env.scene, env.data, "stove_distr", hob.regions[burner].world(env.data) + np.array([0.0, 0.0, 5.0]))
    mujoco.mj_forward(env.model, env.data)
    assert burners() == set(hob.burners)


def test_a_knob_may_be_named_by_what_stands_on_its_burner(kettle: KitchenEnv) -> None:
    task, (place, on) = kettle.declaration, kettle.declaration.stages
    away = GripperFar("obj")
    assert stage_condition(task, place) == AllOf(OnBurner("obj", "stove"), away)
    assert stage_condition(task, on) == AllOf(OnBurner("obj", "stove", lit=True), away)
    assert stage_text(on, kettle.scene) == "turn on the burner under the kettle"
    named = Stage("knobs", "off", "stove", part="knob_front_left")
    assert stage_condition(task, named) == StateIs("stove", "front_left_on", value=False)
    with pytest.raises(UserError, match="until"):
        stage_condition(task, Stage("knobs", "on", "stove", part="dial"))
