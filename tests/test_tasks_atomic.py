"""The 65 atomic tasks: made in both splits, not done at reset, and done when the state of their goal is there."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from task_selection import every_task

from robocasa_lerobot.envs.initial import PartAt
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    BurnerLevel,
    DoorsClosed,
    DoorsOpen,
    Goal,
    GripperFar,
    GripperFarFromPart,
    PartTurned,
    PartWithin,
    StateIs,
    When,
)
from robocasa_lerobot.envs.predicates.contacts import subtree, touching
from robocasa_lerobot.envs.registry import get_task, task_names
from robocasa_lerobot.envs.scene.appliances.base import take_effect
from robocasa_lerobot.envs.scene.builder import build_scene
from robocasa_lerobot.envs.scene.scene import Scene, set_openness
from robocasa_lerobot.envs.wording.atomic import WORDING


def test_there_are_sixty_five() -> None:
    atomic = [name for name in task_names() if get_task(name).kind == "atomic"]
    assert len(atomic) == 65
    assert set(WORDING) <= set(atomic)


def test_no_wording_is_said_twice() -> None:
    said = [wording for name in task_names() for wording in (get_task(name).instruction, *get_task(name).paraphrases)]
    assert len(said) == len(set(said))


@pytest.mark.parametrize("name", every_task())
@pytest.mark.parametrize("split", ["target", "pretrain"])
def test_it_can_be_made_and_is_not_done_at_reset(name: str, split: str) -> None:
    task = get_task(name)
    for seed in range(3):
        scene = build_scene(task, split, seed)
        data, _ = scene.initial_data(np.random.default_rng(seed))
        terms: dict[str, bool] = {}
        assert not task.goal.evaluate(scene, data, terms)
        assert terms
        for said in (scene.instruction, *scene.paraphrases):
            assert "{" not in said
            assert "  " not in said
            assert "_" not in said
        for entry in task.initial:
            if isinstance(entry, PartAt):
                part = scene.fill(entry.part)
                # A timer or a snapping door may have moved while the scene settled.
                assert scene.appliance(entry.fixture).share(data, part) == pytest.approx(
                    scene.initial_share(entry.fixture, entry.part), abs=0.06
                )


def reach(goal: Goal, scene: Scene, data: mujoco.MjData) -> bool:
    """Write the state that a goal asks for; False where it is about objects or the robot alone."""
    if isinstance(goal, AllOf):
        return all(reach(part, scene, data) for part in goal.parts)
    if isinstance(goal, AnyOf):
        return reach(goal.parts[0], scene, data)
    if isinstance(goal, When):
        return reach(goal.goals[scene.choices[goal.choice]], scene, data)
    if isinstance(goal, DoorsOpen | DoorsClosed):
        set_openness(scene.fixture(goal.fixture), data, float(isinstance(goal, DoorsOpen)))
    elif isinstance(goal, PartWithin):
        low, high = max(goal.low, 0.0), min(goal.high, 1.0)
        scene.appliance(goal.fixture).set_share(data, scene.fill(goal.part), (low + high) / 2)
    elif isinstance(goal, PartTurned):
        share = scene.initial_share(goal.fixture, goal.part) + 1.2 * goal.by
        scene.appliance(goal.fixture).set_share(data, goal.part, share)
    elif isinstance(goal, BurnerLevel):
        scene.hob(goal.fixture).set_burner(data, scene.fill(goal.location), goal.level)
    elif isinstance(goal, StateIs):
        fixture, key = scene.fixture(goal.fixture), scene.fill(goal.key)
        if key.endswith("_on") and key != "water_on":
            scene.hob(goal.fixture).set_burner(data, key.removesuffix("_on"), "on" if goal.value else "off")
        elif key == "water_on":
            scene.sink(goal.fixture).set_water(data, goal.value)
        elif key in ("left", "right"):
            scene.appliance(goal.fixture).set_position(data, "spout", 1.0 if key == "right" else -1.0)
        elif key == "on":
            scene.appliance(goal.fixture).set_share(data, "power", float(goal.value))
        else:
            assert key == "lid", (fixture.name, key)
            return False
    else:
        return isinstance(goal, GripperFar | GripperFarFromPart)
    return True


@pytest.mark.parametrize("name", every_task())
def test_the_state_that_the_goal_asks_for_is_success(name: str) -> None:
    task = get_task(name)
    scene = build_scene(task, "target", 1)
    data, _ = scene.initial_data(np.random.default_rng(1))
    if not reach(task.goal, scene, data):
        pytest.skip("its goal is about objects or the robot, which the demonstrators' tests move")
    take_effect(scene.model, data)
    terms: dict[str, bool] = {}
    assert task.goal.evaluate(scene, data, terms), terms


def test_sleeping_things_that_lie_on_each_other_touch() -> None:
    """MuJoCo lists no contacts between what sleeps; the predicates measure distances then."""
    scene = build_scene(get_task("PickPlaceSinkToCounter"), "target", 0)
    data, _ = scene.initial_data(np.random.default_rng(0))
    plate = subtree(scene.model, ["container"])
    counter = subtree(scene.model, [scene.roles["counter"]])
    food = subtree(scene.model, ["obj"])
    for _ in range(2500):
        mujoco.mj_step(scene.model, data)
    tree = scene.model.body_treeid[scene.model.body("container").id]
    assert data.tree_asleep[tree] >= 0
    bodies = scene.model.geom_bodyid[data.contact.geom[: data.ncon]]
    assert not (plate[bodies].any(axis=1) & counter[bodies].any(axis=1)).any()
    assert touching(scene.model, data, plate, counter)
    assert not touching(scene.model, data, food, plate)
    data.qpos[scene.model.joint("container_joint0").qposadr[0] + 2] += 0.005
    mujoco.mj_kinematics(scene.model, data)
    assert not touching(scene.model, data, plate, counter)
