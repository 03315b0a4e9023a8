"""Objects of atomic tasks are as their blueprints ask for: graspable, of their scale and greatest size, turned so.

What differs stands in the table here and, as users read it, in the task's note.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from blueprint_reading import greatest, is_turned, per_axis, scale, turn

from robocasa_lerobot.envs.objects.catalogue import categories_of
from robocasa_lerobot.envs.scene.spec import ObjectSpec, Placement
from robocasa_lerobot.envs.tasks.registry import get_task, task_names

ATOMIC = tuple(name for name in task_names() if get_task(name).facts.kind == "atomic")
# By task and object: what is ours instead, and the words of the note for it.
SCALES = {
    ("PackDessert", "cooked_food_container"): ([1.5, 1.5, 1.25], "enlarged by 1.5 instead of 2.5"),
}
SIZES = {
    ("PickPlaceCounterToBlender", "obj"): ((0.085, 0.085, None), "small enough for the blender's jug"),
}
PROPERTIES = {
    **dict.fromkeys(
        (("OpenFridge", "door_obj"), ("CloseFridge", "door_obj")), (("fridgable",), "in it can be kept in a fridge")
    ),
    **dict.fromkeys(
        (("OpenMicrowave", "door_obj"), ("CloseMicrowave", "door_obj")),
        (("microwavable",), "in it can be heated in a microwave"),
    ),
}
HANDLES = "Handles of our pans lie along another axis"
MUGS = "Handles of our mugs lie along another axis"


@pytest.fixture(scope="module")
def blueprints(shared: Path) -> dict[str, Any]:
    lines = (shared / "facts" / "task_blueprints.jsonl").read_text(encoding="utf-8").splitlines()
    return {row["task"]: row for row in map(json.loads, lines) if row["activity"] == "atomic"}


def test_every_atomic_task_is_compared(blueprints: dict[str, Any]) -> None:
    assert set(blueprints) == set(ATOMIC)


@pytest.mark.parametrize("name", ATOMIC)
def test_objects_are_as_the_blueprint_says(name: str, blueprints: dict[str, Any]) -> None:
    task = get_task(name)
    ours = {wanted.name: wanted for wanted in task.objects}
    # What is put under an object where it starts is of its own size, and stands as that would.
    below = {f"{each}_container" for each, wanted in ours.items() if _has_container(wanted)}
    compared = set()
    for said in blueprints[name]["objects"]:
        if "fixture part" in said["category"]:
            continue
        called = re.sub(r"_\{i\}$", "", said["name"])
        placed = said.get("size_or_offset")
        if called in below:
            assert not said["graspable"]
            assert scale(placed) == per_axis(1.0)
            continue
        compared.add(called)
        wanted = ours[called]
        # A blueprint also calls so what the task needs grasped, where no category of the kind has the property.
        can_be = any(category.graspable for group in wanted.groups for category in categories_of(group))
        assert wanted.graspable == (said["graspable"] and can_be)
        assert per_axis(wanted.scale) == SCALES.get((name, called), (scale(placed),))[0]
        assert _greatest(wanted) == SIZES.get((name, called), (greatest(said["category"]),))[0]
        assert wanted.properties == PROPERTIES.get((name, called), (_properties(said),))[0]
        sides = turn(said["at"], placed, said["category"])
        assert is_turned(wanted.start, sides)
        assert len(sides) < 2 or HANDLES in task.facts.note
        assert not sides or said["category"] != "mug" or MUGS in task.facts.note
    assert compared == set(ours)


def _has_container(wanted: ObjectSpec) -> bool:
    return isinstance(wanted.start, Placement) and wanted.start.try_to_place_in != ""


def _properties(said: dict[str, Any]) -> tuple[str, ...]:
    """Of "any (microwavable)", "food, fridgable": kinds that the words name are left out."""
    words = re.findall(r"\w+able\b", f"{said['category']} {said['at']} {said.get('size_or_offset', '')}")
    return tuple(word for word in words if word not in ("vegetable", "table"))


def _greatest(wanted: ObjectSpec) -> tuple[float | None, float | None, float | None]:
    """Bounds of the size along x, y, z, metres."""
    x, y, z = wanted.max_size or (None, None, None)
    return x, y, z if wanted.max_height is None else wanted.max_height


@pytest.mark.parametrize(("which", "differs"), [*SCALES.items(), *SIZES.items(), *PROPERTIES.items()])
def test_what_differs_has_a_reason_that_users_read(which: tuple[str, str], differs: tuple[object, str]) -> None:
    (task, called), (_, words) = which, differs
    assert called in {wanted.name for wanted in get_task(task).objects}
    assert words in get_task(task).facts.note
