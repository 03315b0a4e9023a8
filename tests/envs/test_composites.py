"""Composite tasks are declared as their blueprints ask for, and no easier: fixtures, objects, starts, goals, stages.

To add a task: a module in `tests/support/blueprint_words`, named as its activity: what its blueprint
says of its goal and of its initial states, each sentence with the words of ours.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blueprint_words import all_words

from robocasa_lerobot.envs.predicates.logic import AllOf
from robocasa_lerobot.envs.predicates.objects import RECEPTACLE_SHARE
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.spec import ObjectSpec, Placement
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of

OURS = all_words()
# First words of the blueprints' stages, with our skills and verbs; a verb of objects is found from the rest.
VERBS = {
    "open_door": {("doors", "open")},
    "close_door": {("doors", "close"), ("doors", "lift_shut")},
    "press_button": {("buttons", "press")},
    "turn_knob": {("knobs", "on"), ("knobs", "raise")},
    "turn_lever": {("levers", "on"), ("levers", "press"), ("levers", "sweep")},
    "slide_rack": {("racks", "pull"), ("racks", "push")},
    "navigate": {("navigation", "drive")},
    "wipe": {("pick_place", "wipe")},
    "pour": {("pick_place", "pour")},
    "stir": {("pick_place", "stir")},
}
# What the benchmark's tables call activities of the blueprints.
RENAMED = {
    "sanitizing_cutting_board": "sanitizing_cutting_boards",
    "washing_fruits_and_vegetables": "washing_produce",
}


@pytest.fixture(scope="module")
def blueprints(shared: Path) -> dict[str, Any]:
    lines = (shared / "facts" / "task_blueprints.jsonl").read_text(encoding="utf-8").splitlines()
    return {row["task"]: row for row in map(json.loads, lines) if row["task"] in OURS}


def test_every_composite_task_is_compared() -> None:
    assert set(OURS) == {name for name in task_names() if get_task(name).facts.kind == "composite"}


@pytest.mark.parametrize("name", OURS)
def test_numbers_fixtures_and_stages(name: str, blueprints: dict[str, Any]) -> None:
    task, row, ours = get_task(name), blueprints[name], OURS[name]
    facts = task.facts
    activity = RENAMED.get(row["activity"], row["activity"])
    assert (task.horizon, facts.activity, facts.mobile) == (row["horizon"], activity, row["mobile"])
    stages = stages_of(task)
    # Of several objects of which a number is drawn, our stages are those of any of them.
    said_stages = [said for said in row["stages"] if "repeat per" not in said]
    assert (len(stages), len(row["stages"])) == (len(said_stages), row["subtasks"])
    for stage, said in zip(stages, said_stages, strict=True):
        _check_stage(task, stage, said)
    assert {fixture.role for fixture in task.fixtures} == set(row["fixtures"]) - set(ours.same)
    for fixture in task.fixtures:
        said = row["fixtures"][fixture.role]
        # Which of a kitchen's stools are the first and the second is drawn: blueprints have the order of the layout.
        assert said.replace("reachable ", "").replace(" ", "_").startswith(fixture.kind)
        near = re.search(r"(?:near|nearest|serving) (\w+)", said)
        assert fixture.near == (near.group(1) if near else "")
        assert list(fixture.size) == (_lengths(said) or [0.0, 0.0])
        assert ("layouts with dining counter" not in said) or "dining_counter" in task.needs
        assert ("reachable freezer" not in said) or "freezer" in task.needs
    for role, other in ours.same.items():
        assert row["fixtures"][role] == row["fixtures"][other]
    facing, *_ = row["robot_start"].split()
    before = re.search(r"in front of (\w+)|base centred on (\w+)", " ".join([row["robot_start"], *row["initial"]]))
    assert task.robot_start.fixture == facing
    before_it = [said["name"] for said in row["objects"] if "robot starts in front of it" in str(said)]
    before_it += [before.group(before.lastindex or 0)] if before else []
    assert [task.robot_start.at_object] == (before_it or [""])
    assert len(task.paraphrases) >= 4
    assert row["instruction"] not in (task.instruction, *task.paraphrases)


def _check_stage(task: Task, stage: Stage, said: str) -> None:
    first, *rest = re.findall(r"\w+", said)
    if first != "pick_place":
        assert (stage.skill, stage.verb) in VERBS[first]
        return
    assert stage.skill == "pick_place"
    # A surface that is wiped is reached with the tool by the stage that wipes it.
    wiped = any((later.verb, later.object) == ("wipe", stage.object) for later in stages_of(task))
    taken = wiped or "-> gripper" in said or ("->" not in said and re.search(r"\((pick|grasp)", said))
    assert stage.verb in ({"pick"} if taken else {"place", "hold"})
    # An object is called by its name or kind, or ours carries it in what it lies in.
    ours = {wanted.name if wanted.count == (1, 1) else f"{wanted.name}_i": wanted for wanted in task.objects}
    inside = {name for name, wanted in ours.items() if _holder(wanted) == stage.object}
    kinds = {group for name in {stage.object, *inside} for group in ours[name].groups}
    assert rest[0] in {stage.object, *inside} or any(kind.startswith(rest[0].rstrip("0")) for kind in kinds)


def _holder(wanted: ObjectSpec) -> str:
    return wanted.start.object if isinstance(wanted.start, Placement) else ""


@pytest.mark.parametrize("name", OURS)
def test_objects_and_where_they_start(name: str, blueprints: dict[str, Any]) -> None:
    task, row = get_task(name), blueprints[name]
    ours = {wanted.name: wanted for wanted in task.objects}
    ours |= {container.name: container for wanted in task.objects for container in _container_of(wanted)}
    assert set(ours) == {said["name"].replace("{i}", "") for said in row["objects"]}
    for said in row["objects"]:
        wanted = ours[said["name"].replace("{i}", "")]
        category, property_ = re.fullmatch(r"([^(]+?)(?: \((\w+)\))?", said["category"]).groups()
        groups = category.replace("all", "any").split(", ")
        assert wanted.groups == tuple(group for group in groups if not group.startswith("-"))
        assert wanted.exclude == tuple(group[1:] for group in groups if group.startswith("-"))
        low, _, high = str(said["count"]).partition("-")
        assert wanted.count == (int(low), int(high or low))
        placed = said.get("size_or_offset")
        placed = placed if isinstance(placed, dict) else {}
        needs = {*placed.get("require", ()), *filter(None, [property_, *said.get("needs", "").split(", ")])}
        assert needs <= {*wanted.properties, *(["graspable"] if wanted.graspable else [])}
        assert _per_axis(wanted.scale) == _per_axis(placed.get("scale", _said_scale(said)))
        # A demonstrator's object that cannot be grasped goes with what it lies in; thin ones are made thicker.
        handled = {stage.object for stage in stages_of(task)}
        thicker = _per_axis(wanted.scale)[2] >= 1.5
        assert wanted.graspable >= (said["graspable"] and said["name"] in handled and not thicker)
        _check_start(task, wanted, said)


def _container_of(wanted: ObjectSpec) -> list[ObjectSpec]:
    """The container that is put under an object where it starts, if any."""
    start = wanted.start
    if not isinstance(start, Placement) or not start.try_to_place_in:
        return []
    return [ObjectSpec(f"{wanted.name}_container", (start.try_to_place_in,), replace(start, try_to_place_in=""))]


def _per_axis(scale: float | str | list[float] | tuple[float, ...]) -> list[float]:
    assert not isinstance(scale, str)
    return list(map(float, scale)) if isinstance(scale, list | tuple) else [float(scale)] * 3


def _said_scale(said: dict[str, Any]) -> float | list[float]:
    """The scale that a text says: "scale 1.25", "scale 1.1,0.8,1", "scale z 2"."""
    found = re.search(r"scale (z )?\[?([\d.,]+)", str(said.get("size_or_offset", "")))
    if found is None:
        return 1.0
    factors = [float(number) for number in found.group(2).strip(",.").split(",")]
    return [1.0, 1.0, factors[0]] if found.group(1) else factors if len(factors) == 3 else factors[0]


def _check_start(task: Task, wanted: ObjectSpec, said: dict[str, Any]) -> None:
    start, at = wanted.start, said["at"]
    assert isinstance(start, Placement)
    if start.object:
        holder = next(each for each in task.objects if each.name == start.object)
        words = (start.object, *(f"{group} (container)" for group in holder.groups))
        assert at.startswith(tuple(f"{where} {word}" for where in ("in", "on") for word in words))
        return
    size, pos = _said_rectangle(said.get("size_or_offset", {}))
    if start.try_to_place_in:
        holder, kind = f"{wanted.name}_container", start.try_to_place_in
        if at == f"on {holder} ({kind})":  # all else is said of the container
            return
        assert at.startswith(f"on {kind} ({holder})")  # whose rectangle is compared
    else:
        assert list(start.size or ()) == size
    if pos is not None:
        assert list(start.pos) == pos
    for axis, amount in re.findall(r"offset ([xy]) ([+-][\d.]+)", str(said.get("size_or_offset", ""))):
        assert start.offset["xy".index(axis)] == float(amount)
    assert ("left or right" in at) == (start.region.loc == "left_right")
    assert (start.region.name == "any") == ("random" in at)
    low, high = (float(bound) for bound in (re.findall(r"([\d.]+)-([\d.]+) m", at) or [start.region.height])[0])
    assert start.region.height == (low, high)
    if isinstance(said.get("size_or_offset"), dict) and "min_patch" in said["size_or_offset"]:
        assert list(start.region.top_size) == said["size_or_offset"]["min_patch"]
    _check_fixture(task, start, at)
    if pos is None and start.offset == (0.0, 0.0):
        _check_part(start, at)
    turned = "turned 90 deg" in at or "yaw" in str(said.get("size_or_offset"))
    other = OURS[task.name].turned.get(wanted.name)
    if other is not None:
        assert start.rotation == pytest.approx(other, abs=1e-3)
        return
    assert turned == (start.rotation != Placement().rotation)
    if turned:
        bounds = (np.pi / 2, np.pi / 2) if "90 deg" in at else (np.pi / 4, 3 * np.pi / 8)
        assert start.rotation == pytest.approx(bounds, abs=1e-3)


def _check_fixture(task: Task, start: Placement, at: str) -> None:
    """Every fixture that is named is the one it stands on, or the one that this is named by."""
    same = OURS[task.name].same
    named = {fixture.role for fixture in task.fixtures if re.search(rf"\b{fixture.role}\b", at)}
    named |= {other for role, other in same.items() if role in at}
    assert named <= {start.fixture, start.region.ref}
    kinds = {fixture.role: fixture.kind.replace("_", " ") for fixture in task.fixtures}
    on_burner = "burner" in at and kinds[start.fixture] == "stove"
    assert start.fixture in named or kinds[start.fixture] in at or on_burner


def _check_part(start: Placement, at: str) -> None:
    """Front, back, left and right of the fixture; not the fixture that it is in front of."""
    words = set(re.findall(r"\w+", re.sub(r"in front of|left or right", "", at)))
    across, along = start.pos
    assert ("front" not in words) or along == -1.0
    assert ("back" not in words) or along == 1.0
    assert ("centre" not in words) or across == 0.0
    if words & {"left", "right"}:
        assert isinstance(across, float)
        assert ("right" in words) == (across > 0.0)
    if "setting" in words or "at stool" in at:
        assert (across, along) == ("ref", "ref")


def _said_rectangle(placed: dict[str, Any] | list[float] | str) -> tuple[list[float], list[float | str] | None]:
    """Size, and position if it is said, of "region 0.35x0.35 m, pos (ref,-1)" and of records."""
    if isinstance(placed, list):
        return placed, None
    if isinstance(placed, dict):
        return placed.get("size", []), placed.get("pos")
    pos = re.search(r"pos \((-?[\w.]+),(-?[\w.]+)\)", placed)
    return _lengths(placed), [_where(text) for text in pos.groups()] if pos else None


def _where(text: str) -> float | str:
    return text if text == "ref" else float(text)


def _lengths(text: str) -> list[float]:
    """The first two lengths of a text such as "counter, >= 0.2x0.3 m"; none if it has none."""
    found = re.search(r"([\d.]+|full width )x ?([\d.]+)", text)
    return [np.inf if number == "full width " else float(number) for number in found.groups()] if found else []


@pytest.mark.parametrize("name", OURS)
def test_goal_and_initial_states(name: str, blueprints: dict[str, Any]) -> None:
    task, row, ours = get_task(name), blueprints[name], OURS[name]
    goal = goal_of(task)
    parts = goal.parts if isinstance(goal, AllOf) else (goal,)
    assert list(ours.goal) == row["goal"]
    assert {*ours.goal.values(), *ours.besides} == set(parts)
    assert RECEPTACLE_SHARE == 0.7  # of goals of `ObjectOn` that name no distance
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
