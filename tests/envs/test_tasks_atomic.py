"""The 65 atomic tasks: made in both splits, not done at reset, and done when the state of their goal is there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import mujoco
import numpy as np
import pytest
from task_selection import every_task

from robocasa_lerobot.envs.kitchens.appliances.base import take_effect
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    BurnerLevel,
    DoorsClosed,
    DoorsOpen,
    DrawerClosed,
    DrawerOpen,
    ForEach,
    Goal,
    GripperFar,
    GripperFarFromPart,
    Not,
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
    PartTurned,
    PartWithin,
    StandsBefore,
    StateIs,
    When,
)
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.scene import Scene, set_openness
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import goal_of


def test_there_are_sixty_five() -> None:
    atomic = [name for name in task_names() if get_task(name).facts.kind == "atomic"]
    assert len(atomic) == 65


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
        assert not task.bound(scene).goal.evaluate(scene, data, terms)
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


# What `write` can write; what holds as long as the robot has not left its start; and what moves objects or the robot,
# which the demonstrators' tests do.
WRITTEN = (DoorsOpen, DoorsClosed, DrawerOpen, DrawerClosed, PartWithin, PartTurned, BurnerLevel, StateIs)
AT_START = (GripperFar, GripperFarFromPart)
MOVED = (
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
    StandsBefore,
)


def leaves(goal: Goal) -> Iterator[Goal]:
    """The single conditions of a goal."""
    if isinstance(goal, AllOf | AnyOf):
        parts: Iterable[Goal] = goal.parts
    elif isinstance(goal, When):
        parts = goal.goals.values()
    elif isinstance(goal, Not):
        parts = (goal.part,)
    elif isinstance(goal, ForEach):
        parts = (goal.pattern,)
    else:
        yield goal
        return
    for part in parts:
        yield from leaves(part)


def can_be_written(task: Task) -> bool:
    return all(isinstance(leaf, WRITTEN + AT_START) for leaf in leaves(goal_of(task)))


def write(goal: Goal, scene: Scene, data: mujoco.MjData) -> None:
    """Write the state that a goal asks for."""
    if isinstance(goal, AllOf):
        for part in goal.parts:
            write(part, scene, data)
    elif isinstance(goal, AnyOf):
        write(goal.parts[0], scene, data)
    elif isinstance(goal, When):
        write(goal.goals[scene.choices[goal.choice]], scene, data)
    elif isinstance(goal, DoorsOpen | DoorsClosed | DrawerOpen | DrawerClosed):
        set_openness(scene.fixture(goal.fixture), data, float(isinstance(goal, DoorsOpen | DrawerOpen)))
    elif isinstance(goal, PartWithin):
        low, high = max(goal.low, 0.0), min(goal.high, 1.0)
        scene.appliance(goal.fixture).set_share(data, scene.fill(goal.part), (low + high) / 2)
    elif isinstance(goal, PartTurned):
        share = scene.initial_share(goal.fixture, goal.part) + 1.2 * goal.by
        scene.appliance(goal.fixture).set_share(data, goal.part, share)
    elif isinstance(goal, BurnerLevel):
        scene.hob(goal.fixture).set_burner(data, scene.fill(goal.location), goal.level)
    elif isinstance(goal, StateIs):
        write_state(goal, scene, data)


def write_state(goal: StateIs, scene: Scene, data: mujoco.MjData) -> None:
    fixture, key = scene.fixture(goal.fixture), scene.fill(goal.key)
    if key == "water_on":
        scene.sink(goal.fixture).set_water(data, goal.value)
    elif key.endswith("_on"):
        scene.hob(goal.fixture).set_burner(data, key.removesuffix("_on"), "on" if goal.value else "off")
    elif key in ("left", "right"):
        scene.appliance(goal.fixture).set_position(data, "spout", 1.0 if key == "right" else -1.0)
    elif key == "lid":
        assert isinstance(fixture, Blender)
        assert goal.value
        fixture.set_lid(data)
    else:
        assert key == "on", (fixture.name, key)
        scene.appliance(goal.fixture).set_share(data, "power", float(goal.value))


@pytest.mark.parametrize("name", every_task(can_be_written))
def test_the_state_that_the_goal_asks_for_is_success(name: str) -> None:
    task = get_task(name)
    scene = build_scene(task, "target", 1)
    data, _ = scene.initial_data(np.random.default_rng(1))
    goal = task.bound(scene).goal
    write(goal, scene, data)
    take_effect(scene.model, data)
    terms: dict[str, bool] = {}
    assert goal.evaluate(scene, data, terms), terms


def test_every_condition_is_written_or_moved() -> None:
    for name in task_names():
        assert all(isinstance(leaf, WRITTEN + AT_START + MOVED) for leaf in leaves(goal_of(get_task(name)))), name


def test_sleeping_things_that_lie_on_each_other_touch() -> None:
    """MuJoCo lists no contacts between what sleeps; the predicates measure distances then."""
    scene = build_scene(get_task("PickPlaceSinkToCounter"), "target", 0)
    data, _ = scene.initial_data(np.random.default_rng(0))
    plate, counter, food = (scene.subtree(name) for name in ("container", scene.roles["counter"], "obj"))
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
