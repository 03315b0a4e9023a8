"""Composite tasks are declared as their blueprints ask for, and no easier: fixtures, objects, starts, goals, stages.

To add a task: what its blueprint says of its goal and of its initial states, each sentence with the words of ours.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robocasa_lerobot.envs.predicates import Goal, GripperFar, OnBurner, StepsWhile, UnderWater
from robocasa_lerobot.envs.predicates.logic import AllOf
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.scene_spec import InitialState
from robocasa_lerobot.envs.scene.spec import ObjectWanted, Placement
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of

LIT = OnBurner("obj", "stove", lit=True, within=0.15)  # it also asks that the object touches the stove


@dataclass(frozen=True)
class Ours:
    """What stands for the sentences of a blueprint.

    Attributes:
        goal: part of our goal by sentence.
        initial: initial state by sentence; None where fixtures start so anyway, or the name of an object.
        order: what stands for `order_or_memory`, if it says anything.
    """

    goal: dict[str, Goal]
    initial: dict[str, InitialState | str | None]
    order: Goal | None = None


WASHED = StepsWhile(UnderWater("lettuce", "sink"), 25)
OURS = {
    "KettleBoiling": Ours(
        goal={
            "obj in contact with stove": LIT,
            "obj within 0.15 m (xy) of a burner centre": LIT,
            "knob of that same burner in [0.35, 2pi-0.35]": LIT,
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"all stove knobs off": None, "pan or pot on a burner chosen at random": "stove_distr"},
    ),
    "WashLettuce": Ours(
        goal={"washed >= 25 steps in total under running water": WASHED},
        initial={"faucet off": Water("sink", on=False)},
        order=WASHED,
    ),
}


@pytest.fixture(scope="module")
def blueprints(shared: Path) -> dict[str, Any]:
    lines = (shared / "facts" / "task_blueprints.jsonl").read_text(encoding="utf-8").splitlines()
    return {row["task"]: row for row in map(json.loads, lines) if row["task"] in OURS}


@pytest.mark.parametrize("name", OURS)
def test_numbers_fixtures_and_stages(name: str, blueprints: dict[str, Any]) -> None:
    task, row = get_task(name), blueprints[name]
    assert (task.horizon, task.facts.activity) == (row["horizon"], row["activity"])
    stages = stages_of(task)
    assert len(stages) == row["subtasks"]
    for stage, said in zip(stages, row["stages"], strict=True):
        assert said.split()[0] in {stage.skill, f"turn_{stage.skill.removesuffix('s')}"}
    assert {fixture.role for fixture in task.fixtures} == set(row["fixtures"])
    for fixture in task.fixtures:
        said = row["fixtures"][fixture.role]
        assert said.startswith(fixture.kind)
        assert (f"near {fixture.near}" in said) == bool(fixture.near)
        assert list(fixture.size) == (_lengths(said) or [0.0, 0.0])
    assert task.robot_start.fixture == row["robot_start"]
    assert len(task.paraphrases) >= 4
    assert row["instruction"] not in (task.instruction, *task.paraphrases)


@pytest.mark.parametrize("name", OURS)
def test_objects_and_where_they_start(name: str, blueprints: dict[str, Any]) -> None:
    task, row = get_task(name), blueprints[name]
    ours = {wanted.name: wanted for wanted in task.objects}
    assert set(ours) == {said["name"] for said in row["objects"]}
    for said in row["objects"]:
        wanted = ours[said["name"]]
        assert wanted.groups == tuple(said["category"].split(", "))
        assert wanted.count == (said["count"], said["count"])
        # A demonstrator's object that cannot be grasped goes with what it lies in.
        handled = {stage.object for stage in stages_of(task)}
        assert wanted.graspable >= (said["graspable"] and said["name"] in handled)
        _check_start(task, wanted, said)


def _check_start(task: Task, wanted: ObjectWanted, said: dict[str, Any]) -> None:
    start, at = wanted.start, said["at"]
    assert isinstance(start, Placement)
    if start.object:
        assert at.startswith(f"in {start.object}")
        return
    placed = said["size_or_offset"]
    size = placed["size"] if isinstance(placed, dict) else _lengths(placed)
    assert list(start.size or ()) == size
    if "counter" in at:
        assert start.region.loc == "left_right"
        assert "left or right" in at
        assert start.region.ref in at
        assert start.pos == ("ref", -1.0)
        assert "front edge" in at
    else:
        assert start.fixture in task.robot_start.fixture
        assert start.region.name == "any"
        assert "random" in at


def _lengths(text: str) -> list[float]:
    """The first two lengths of a text such as "counter, >= 0.2x0.3 m"; none if it has none."""
    found = re.search(r"([\d.]+)x([\d.]+) m", text)
    return [float(number) for number in found.groups()] if found else []


@pytest.mark.parametrize("name", OURS)
def test_goal_and_initial_states(name: str, blueprints: dict[str, Any]) -> None:
    task, row, ours = get_task(name), blueprints[name], OURS[name]
    goal = goal_of(task)
    parts = goal.parts if isinstance(goal, AllOf) else (goal,)
    assert list(ours.goal) == row["goal"]
    assert set(ours.goal.values()) == set(parts)
    assert bool(row["order_or_memory"]) == (ours.order is not None)
    assert ours.order is None or ours.order in parts
    assert list(ours.initial) == row["initial"]
    states = {state for state in ours.initial.values() if state is not None and not isinstance(state, str)}
    assert set(task.initial) == states
    assert {state for state in ours.initial.values() if isinstance(state, str)} <= {o.name for o in task.objects}


@pytest.mark.parametrize("seed", [300_000, 300_006, 300_008])
def test_objects_on_several_shelves_do_not_lie_in_each_other(seed: int) -> None:
    scene = build_scene(get_task("BuildAppetizerPlate"), "target", seed)
    data, _ = scene.initial_data(np.random.default_rng(seed))
    moved = {name: np.linalg.norm(data.body(name).xpos - placed.pos) for name, placed in scene.objects.items()}
    assert max(moved.values()) < 0.05, moved
