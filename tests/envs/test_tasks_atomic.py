"""The 65 atomic tasks: made in both splits, not done at reset, and done when the state of their goal is there."""

from __future__ import annotations

import inspect

import mujoco
import numpy as np
import pytest
from goal_states import AT_START, MOVED, can_be_written, hold, leaves, write
from task_selection import every_task

from robocasa_lerobot.envs import predicates
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.predicates import Goal
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.initial_states import PartAt
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
                assert scene.fixture(entry.fixture, Appliance).share(data, part) == pytest.approx(
                    scene.initial_share(entry.fixture, entry.part), abs=0.06
                )


def reachable(task: Task) -> bool:
    return all(can_be_written(type(leaf)) or isinstance(leaf, AT_START) for leaf in leaves(goal_of(task)))


@pytest.mark.parametrize("name", every_task(reachable))
def test_the_state_that_the_goal_asks_for_is_success(name: str) -> None:
    task = get_task(name)
    scene = build_scene(task, "target", 1)
    data, _ = scene.initial_data(np.random.default_rng(1))
    goal = task.bound(scene).goal
    write(goal, scene, data)
    assert hold(goal, scene, data) is None


def test_every_predicate_is_written_or_holds_at_the_start_or_is_moved() -> None:
    kinds = [kind for kind in vars(predicates).values() if isinstance(kind, type) and issubclass(kind, Goal)]
    found = {kind for kind in kinds if not inspect.isabstract(kind)}
    assert len(found) > 20
    assert not [kind for kind in found if not can_be_written(kind) and not issubclass(kind, AT_START + MOVED)]


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
