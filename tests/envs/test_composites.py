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
from blueprint_reading import Category, category, counted, is_turned, lengths, offset, per_axis, rectangle, scale, turn
from blueprint_words import all_words
from blueprint_words.ours import MISCOUNTED, UNLISTED, UNLISTED_LAST

from robocasa_lerobot.envs.predicates.logic import AllOf
from robocasa_lerobot.envs.predicates.objects import RECEPTACLE_SHARE
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.spec import ObjectSpec, Placement
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of

OURS = all_words()
# First words of the blueprints' stages, with our skill and its verbs for it; a verb of objects is found from the rest.
VERBS = {
    "open_door": ("doors", "open"),
    "open_drawer": ("drawers", "open"),
    "close_door": ("doors", "close", "close_large", "lift_shut", "lift_low", "lower_head", "push_lid"),
    "close_drawer": ("drawers", "close"),
    "close_drawer fridge_drawer": ("racks", "push"),
    "press_button": ("buttons", "press"),
    "turn_knob": ("knobs", "on", "off", "low", "medium", "raise", "lowest", "highest"),
    "turn_lever": ("levers", "on", "off", "hot", "press", "sweep"),
    "slide_rack": ("racks", "pull", "push"),
    "navigate": ("navigation", "drive"),
    "wipe": ("pick_place", "wipe"),
    "pour": ("pick_place", "pour"),
    "stir": ("pick_place", "stir"),
    "wait": ("knobs", "wait"),
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
    assert (facts.horizon, facts.activity, facts.mobile) == (row["horizon"], activity, row["mobile"])
    stages = stages_of(task)
    stages = stages[UNLISTED.get(name, 0) : len(stages) - UNLISTED_LAST.get(name, 0)]
    # Of several objects of which a number is drawn, our stages are those of any of them.
    as_many = len(stages) == len(row["stages"])
    said_stages = [said for said in row["stages"] if as_many or not _is_of_another(said, row)]
    if "when there are" in said_stages[-1] and len(stages) < len(said_stages):
        said_stages.pop()
    assert (len(stages), len(row["stages"])) == (len(said_stages), MISCOUNTED.get(name, row["subtasks"]))
    for stage, said in zip(stages, said_stages, strict=True):
        _check_stage(task, stage, said)
    assert {fixture.role for fixture in task.fixtures} == set(row["fixtures"]) - {*ours.same, *ours.drawn} | ours.more
    for fixture in (each for each in task.fixtures if each.role not in ours.more):
        said = row["fixtures"][fixture.role].removeprefix("another ")
        # Which of a kitchen's stools are the first and the second is drawn: blueprints have the order of the layout.
        kind = ours.kinds.get(fixture.role, said.replace("reachable ", "").replace(" ", "_"))
        assert said.startswith("stool") == fixture.kind.startswith("stool")
        assert kind.startswith(fixture.kind)
        near = re.search(r"(?:near|nearest|serving|holding) (?:to )?(?!an? )(\w+)", said)
        kinds = {other.role: other.kind for other in task.fixtures}
        assert (near.group(1) if near else ours.near.get(fixture.role, "")) in (fixture.near, kinds.get(fixture.near))
        assert list(fixture.size) == (lengths(said) or [0.0, 0.0])
        assert ("layouts with dining counter" not in said) or "dining_counter" in task.needs
        assert ("reachable freezer" not in said) or "freezer" in task.needs
    for role, other in ours.same.items():
        assert row["fixtures"][role] == row["fixtures"][other]
    _check_robot_start(task, row)
    assert len(task.paraphrases) >= 4
    assert row["instruction"] not in (task.instruction, *task.paraphrases)
    if re.search(r"\{\w*side\}|\{left/right\}", row["instruction"]):
        assert "side}" in task.instruction, row["instruction"]


def _is_of_another(said: str, row: dict[str, Any]) -> bool:
    """Whether a stage is that of a second one of several objects of which a number is drawn, as it is of the first."""
    drawn = [
        re.escape(each["name"].split("{")[0])
        for each in row["objects"]
        if "{" in each["name"] and "{0,1}" not in each["name"]
    ]
    firsts = [re.sub(rf"\b{name}1\b", f"{name}0", said.split(" (")[0]) for name in drawn]
    return "repeat per" in said or any(each.startswith(f) for f in firsts if f not in said for each in row["stages"])


def _check_robot_start(task: Task, row: dict[str, Any]) -> None:
    """Before a fixture, or beside it; in line with an object, which may say so itself."""
    facing, *_ = row["robot_start"].split()
    told = " ".join([row["robot_start"], *row["initial"]])
    before = re.search(r"in front of (\w+)|base centred on (\w+)", told)
    in_front_of = {
        said["name"]
        for said in row["objects"]
        if re.search("robot starts (in front|here)", str(said.get("size_or_offset")))
    }
    in_front_of |= set(re.findall(r"robot starts at (\w+)", str(row["objects"])))
    in_front_of |= {before.group(before.lastindex or 0)} if before else set()
    beside = re.search(r"beside the (\w+), .* half width \+ ([\d.]+) m, back ([\d.]+) m", told)
    start = task.robot_start
    drawn = {option for choice in task.choices for option in choice.options if start.fixture == f"{{{choice.name}}}"}
    assert (drawn or {start.fixture}) == {*(beside.group(1) if beside else facing).split("|")}
    assert {start.at_object} == ({OURS[task.name].called.get(name, name) for name in in_front_of} or {""})
    of_robot = [said for said in (row["robot_start"], *row["initial"]) if "robot" in said or said == row["robot_start"]]
    assert start.beside == ("left or right" in " ".join(of_robot))
    assert not beside or (start.clearance, start.setback) == (float(beside.group(2)), float(beside.group(3)))


def _check_stage(task: Task, stage: Stage, said: str) -> None:
    first, *rest = re.findall(r"\w+", said)
    if first not in ("pick_place", "insertion"):
        skill, *verbs = VERBS.get(said) or VERBS[first]
        assert stage.skill == skill
        assert stage.verb in verbs
        return
    assert stage.skill == "pick_place"
    if rest[0] == "blender_lid":
        assert stage.verb == ("uncover" if "counter" in said else "cover")
        assert stage.object == f"{{{stage.target}}}_lid"
        return
    # A surface that is wiped is reached with the tool by the stage that wipes it.
    wiped = any((later.verb, later.object) == ("wipe", stage.object) for later in stages_of(task))
    taken = wiped or "-> gripper" in said or ("->" not in said and re.search(r"\((pick|grasp)", said))
    put = {"place", "hold", "rinse", "press", "press_with", "turn", "place_upside_down"}
    assert stage.verb in ({"pick", "shake", "tilt"} if taken else put)
    # An object is called by its name or kind, or ours carries it in what it lies in.
    called = OURS[task.name].called.get(rest[0], rest[0])
    ours = {wanted.name if wanted.count == (1, 1) else f"{wanted.name}_i": wanted for wanted in task.objects}
    drawn = re.compile(re.sub(r"\{\w+\}", r"\\w+", stage.object))  # by a choice
    name = next((each for each in ours if drawn.fullmatch(each)), re.sub(r"_\d+$", "_i", stage.object))
    inside = {name for name, wanted in ours.items() if _holder(wanted) == stage.object}
    kinds = {group for each in {name, *inside} for group in ours[each].groups}
    assert {called, re.sub(r"_?\d+$", "_i", called)} & {stage.object, *inside} or any(
        kind.startswith(called.rstrip("0")) for kind in kinds
    )


def _holder(wanted: ObjectSpec) -> str:
    return wanted.start.object if isinstance(wanted.start, Placement) else ""


@pytest.mark.parametrize("name", OURS)
def test_objects_and_where_they_start(name: str, blueprints: dict[str, Any]) -> None:
    task, row = get_task(name), blueprints[name]
    ours = {wanted.name: wanted for wanted in task.objects}
    ours |= {container.name: container for wanted in task.objects for container in _container_of(wanted)}
    left_out = ("fixture part", "not a sampled object")
    objects = [said for said in row["objects"] if not any(words in str(said) for words in left_out)]
    assert set(ours) == {_plain(said["name"]) for said in objects}
    for said in objects:
        wanted = ours[_plain(said["name"])]
        of = category(said["category"])
        _check_kinds(task, wanted, said["category"], of)
        assert wanted.count == counted(said["count"]) or "only when" in said["at"] or _by_choice(task, wanted, said)
        placed = said.get("size_or_offset")
        required = placed.get("require", ()) if isinstance(placed, dict) else ()
        needs = {*required, *filter(None, said.get("needs", "").split(", "))}
        # Ours of what is in a freezer have the word for that.
        needs = {"freezable" if "freezer" in said["at"] and need == "fridgable" else need for need in needs}
        assert needs <= {*wanted.properties, *(["graspable"] if wanted.graspable else [])}
        assert per_axis(wanted.scale) == per_axis(OURS[name].scales.get(wanted.name, scale(placed)))
        # A demonstrator's object that cannot be grasped goes with what it lies in; flat tools are made higher.
        handled = {stage.object for stage in stages_of(task)}
        made_so = len(set(per_axis(wanted.scale))) > 1
        assert wanted.graspable >= (said["graspable"] and said["name"] in handled and not made_so)
        _check_start(task, wanted, said)


def _by_choice(task: Task, wanted: ObjectSpec, said: dict[str, Any]) -> bool:
    """Whether a choice says how many there are, with every number that the blueprint has."""
    if "only if" not in said["at"]:
        return False
    low, high = counted(said["count"])
    options = [words for choice in task.choices for words in choice.options.values()]
    numbers = {words[str(wanted.count).strip("{}")] for words in options}
    return numbers == {str(number) for number in range(low, high + 1)}


def _plain(name: str) -> str:
    """Name in our declaration of objects of which a number is drawn: of obj_{i}, obj_0..obj_2, obj_i_container."""
    return re.sub(r"_?\{(i|0\.\.n-1|0,1)\}|_0\.\.\w+|_i(?=_container$)", "", name)


def _check_kinds(task: Task, wanted: ObjectSpec, said: str, of: Category) -> None:
    """Groups and what is left out of them; or the kind of another object, or one that is drawn."""
    if wanted.groups[0].startswith("{"):
        said = said.replace(" | ", " OR ")
    if said.startswith("same category as "):
        assert wanted.same_category_as == said.removeprefix("same category as ")
    elif "pre-sliced halves" in said:
        assert wanted.groups == ("orange_half", "kiwi_half")
        assert wanted.face_down
    elif "same instance as" in said:
        assert wanted.same_model
        assert f"same instance as {wanted.same_category_as}" in said
    elif said == "same category A":
        assert wanted.same_category_as == "food1"
    elif wanted.groups[0].startswith("{") and " OR " not in said:
        (group,) = wanted.groups
        assert {value for choice in task.choices for value in choice.options} >= set(of.groups)
        assert group.strip("{}") in {choice.name for choice in task.choices}
    elif " OR " in said:
        either = re.findall(r"\w+(?= OR)|(?<=OR )\w+|(?<=OR \()\w+|(?<=OR \(fruit, )\w+", said)
        options = [option for choice in task.choices for option in choice.options.values()]
        groups = [group.strip("{}") for group in wanted.groups]
        assert {option[group] for group in groups for option in options if group in option} == set(either)
    elif wanted.part_of:
        whole = next(each for each in task.objects if each.name == wanted.part_of)
        assert (said.removesuffix(" (matching)").replace(" ", "_"),) == wanted.groups
        assert whole.groups == ("saucepan_with_lid",)
        assert per_axis(whole.scale) == per_axis(wanted.scale)
    else:
        assert set(wanted.groups) == set(of.groups) or wanted.groups == (of.brackets,)
        assert of.brackets in {"", *wanted.properties, *wanted.groups}
        assert set(of.exclude) <= set(wanted.exclude)


def _container_of(wanted: ObjectSpec) -> list[ObjectSpec]:
    """The container that is put under an object where it starts, if any."""
    start = wanted.start
    if not isinstance(start, Placement) or not start.try_to_place_in:
        return []
    held = replace(start, try_to_place_in="")
    return [ObjectSpec(f"{wanted.name}_container", (start.try_to_place_in,), held, count=wanted.count)]


def _check_start(task: Task, wanted: ObjectSpec, said: dict[str, Any]) -> None:
    start, at = wanted.start, said["at"].replace("cutting board (", "cutting_board (")
    at = at.replace("on top of", "on")
    at = re.sub(r"^each on own (\w+) \((\w+)_i_container\)", r"on \1 (\2_container)", at)
    assert isinstance(start, Placement)
    if "under each" in at or "only when" in at:  # of what has been compared
        return
    if wanted.name in OURS[task.name].placed:
        assert start == OURS[task.name].placed[wanted.name]
        return
    if "{" in start.object:
        (holders,) = (choice.options for choice in task.choices if choice.name == start.object.strip("{}"))
        assert at == f"on {' or '.join(holders)} at random"
        return
    if start.object:
        holder = next(each for each in task.objects if each.name == start.object)
        called = ("container", start.object)
        words = (start.object, *(f"{group} ({name})" for group in holder.groups for name in called))
        assert at.startswith(tuple(f"{where} {word}" for where in ("in", "on") for word in words))
        return
    placed = said.get("size_or_offset") or {}
    size, pos = rectangle(placed)
    if start.try_to_place_in and "if it is" not in at:
        # Of the container all else is compared.
        kind = start.try_to_place_in
        whole = (f"{wanted.name}_container", f"{wanted.name}_container ({kind})", f"{kind}_container")
        if at in tuple(f"on {holder}" for holder in whole):
            return
        own = [f"{kind} ({prefix}container)" for prefix in ("", f"{wanted.name}_")]
        own += [f"{prefix}container ({kind})" for prefix in ("", f"{wanted.name}_")]
        assert at.startswith(tuple(f"on {holder}" for holder in own))
    else:
        assert list(start.size or ()) == size
    if pos is not None and not _stands_at(start, pos):
        assert [_side(each) for each in start.pos] == pos
    for axis, by in offset(placed).items():
        assert start.offset[axis] == by
    by_choice = "{" in f"{start.pos[0]} {start.region.name}"
    assert ("left or right" in at and not by_choice) == (start.region.loc == "left_right")
    assert (start.region.name == "any") == ("random" in at and not by_choice)
    low, high = (float(bound) for bound in (re.findall(r"([\d.]+)-([\d.]+) m", at) or [start.region.height])[0])
    assert start.region.height == (low, high)
    if isinstance(placed, dict) and "min_patch" in placed:
        assert list(start.region.top_size) == placed["min_patch"]
    _check_fixture(task, start, at)
    if pos is None and not offset(placed):
        _check_part(start, at)
    own = OURS[task.name].turned.get(wanted.name)
    assert is_turned(start, (own,) if own else turn(at, placed, said["category"]))


def _side(pos: float | str | None) -> float | str | None:
    """Sides that a choice names, as blueprints write them."""
    if isinstance(pos, str) and "{" in pos:
        return "-+1" if pos.startswith("-") else "+-1"
    return pos


def _stands_at(start: Placement, pos: list[float | str | None]) -> bool:
    """Whether what the blueprint places before a stool, "pos (0.3,...)", starts in line with that, so much aside."""
    across, along = pos
    aside = across if isinstance(across, float) else 0.0
    return start.pos == ("ref", along) and start.offset[0] <= aside and start.region.ref != ""


def _check_fixture(task: Task, start: Placement, at: str) -> None:
    """Every fixture that is named is the one it stands on, or the one that this is named by."""
    same, at = OURS[task.name].same, re.sub(r" \(must .*\)", "", at)
    named = {fixture.role for fixture in task.fixtures if re.search(rf"\b{fixture.role}\b", at)}
    named |= {other for role, other in same.items() if role in at}
    drawn = {choice.name: set(choice.options) for choice in task.choices}
    assert named <= {start.fixture, start.region.ref, *drawn.get(start.region.ref.strip("{}"), ())}
    kinds = {fixture.role: fixture.kind.replace("_", " ") for fixture in task.fixtures}
    on_burner = "burner" in at and kinds[start.fixture] == "stove"
    in_freezer = "freezer" in at and kinds[start.fixture].startswith("fridge")
    with_container = start.try_to_place_in != ""  # of which the same is compared in a sentence of its own
    elsewhere = on_burner or in_freezer or with_container or (start.slot and "slot" in at)
    assert start.fixture in named or kinds[start.fixture] in at or elsewhere


def _check_part(start: Placement, at: str) -> None:
    """Front, back, left and right of the fixture; not the fixture that it is in front of."""
    words = set(re.findall(r"\w+", re.sub(r"in front of|left or right", "", at)))
    across, along = start.pos
    assert ("front" not in words) or along == -1.0 or (along == -0.95 and "near" in words)
    assert ("back" not in words) or along == 1.0
    assert ("centre" not in words) or across == 0.0 or (across == "ref" and "below" in words)
    if start.region.name.startswith("basin"):
        assert ("right" in words) == (start.region.name == "basin1")
    elif words & {"left", "right"} and not str(across).strip("-").startswith("{"):
        assert isinstance(across, float)
        assert ("right" in words) == (across > 0.0)
    if "setting" in words or ("at stool" in at and "front" not in words):
        assert (across, along) == ("ref", "ref")


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
    assert set(task.initial) == states | ours.more_initial
    assert {state for state in ours.initial.values() if isinstance(state, str)} <= {o.name for o in task.objects}


@pytest.mark.parametrize(
    "name", [name for name, ours in OURS.items() if ours.besides or ours.turned or ours.scales or ours.placed]
)
def test_what_differs_has_a_reason_that_users_read(name: str) -> None:
    assert get_task(name).facts.note


@pytest.mark.parametrize("seed", [300_000, 300_006, 300_008])
def test_objects_on_several_shelves_do_not_lie_in_each_other(seed: int) -> None:
    scene = build_scene(get_task("BuildAppetizerPlate"), "target", seed)
    data, _ = scene.initial_data(np.random.default_rng(seed))
    moved = {name: np.linalg.norm(data.body(name).xpos - placed.pos) for name, placed in scene.objects.items()}
    assert max(moved.values()) < 0.05, moved
