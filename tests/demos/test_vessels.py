"""Vessels are held where water falls onto what is in them, put onto burners that are free, and these are turned on."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from goal_states import put_object

from robocasa_lerobot.demos.skills import SkillError
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.hold import hold_poses
from robocasa_lerobot.demos.skills.pick_place.place_poses import over_burners
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.predicates import AllOf, GripperFar, OnBurner, StateIs, UnderWater
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
