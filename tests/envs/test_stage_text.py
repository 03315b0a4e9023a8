"""What stages are called: in every task and of every verb something that can be said, without names of the code."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from task_selection import every_task

from robocasa_lerobot.demos.skills import SKILLS
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.stage_text import stage_text
from robocasa_lerobot.envs.tasks.task import Stage

WORDS = re.compile(r"[a-zäöüéñ'-]+( [a-zäöüéñ'-]+)+")


def check(text: str, scene: Any) -> None:
    assert WORDS.fullmatch(text), text
    for name in (*scene.layout.fixtures, *scene.roles):
        assert "_" not in name or name not in text


@pytest.mark.parametrize("name", every_task())
def test_every_stage_of_every_task_can_be_said(name: str) -> None:
    task = get_task(name)
    for split in ("target", "pretrain"):
        scene = build_scene(task, split, 0)
        for stage in task.bound(scene).stages:
            text = stage_text(stage, scene)
            check(text, scene)
            if stage.object in scene.objects:
                assert scene.words[stage.object] in text


@pytest.fixture(scope="module")
def kitchen() -> Any:
    return build_scene(get_task("PickPlaceStoveToCounter"), "target", 0)


@pytest.mark.parametrize("key", SKILLS, ids=" ".join)
def test_every_verb_can_be_said(key: tuple[str, str], kitchen: Any) -> None:
    for part, to in (("", "left"), ("knob_front_left", "increase"), ("rack0", "out"), ("lid_button", "in")):
        text = stage_text(Stage(*key, "stove", object="obj", part=part, to=to), kitchen)
        check(text, kitchen)


def test_a_verb_without_a_wording_is_said_plainly(kitchen: Any) -> None:
    stove = Stage("made", "wipe_down", "stove")
    assert stage_text(stove, kitchen) == "wipe down the stove"
    obj = kitchen.words["obj"]
    assert stage_text(Stage("made", "wipe", "stove", object="obj"), kitchen) == f"wipe the {obj}"


def test_a_text_of_its_own_comes_first(kitchen: Any) -> None:
    stage = Stage("doors", "open", "stove", text="look at the {obj} on the {stove}")
    assert stage_text(stage, kitchen) == f"look at the {kitchen.words['obj']} on the stove"


def test_words_of_what_was_drawn() -> None:
    fixture = SimpleNamespace(compartments=())
    interior = SimpleNamespace(half=np.array([0.1, 0.1, 0.04]))
    bowl = SimpleNamespace(item=SimpleNamespace(interior=interior))
    plate = SimpleNamespace(item=SimpleNamespace(interior=None))
    choices = {"knob": "rear_left", "drawer": "drawer1", "rack": "rack0", "fxtr": "x_group"}
    scene: Any = SimpleNamespace(
        roles={"fxtr": "x_group"},
        objects={"bowl": bowl, "plate": plate},
        choices=choices,
        words={
            "fxtr": "oven", "knob": "rear left", "drawer": "drawer1", "rack": "top", "obj": "ice cube", "bowl": "bowl",
            "plate": "plate", "direction": "out",
        },
        fill=lambda text: text.format(**choices),
        fixture=lambda role: fixture,
    )  # fmt: skip
    for stage, text in (
        (Stage("knobs", "on", "fxtr", part="knob_{knob}"), "turn on the rear left burner of the oven"),
        (Stage("racks", "pull", "fxtr", part="{drawer}"), "pull the drawer of the oven out"),
        (Stage("racks", "slide", "fxtr", part="{rack}", to="{direction}"), "slide the top rack of the oven out"),
        (Stage("pick_place", "place", "bowl", object="obj"), "put the ice cube into the bowl"),
        (Stage("pick_place", "place", "plate", object="obj"), "put the ice cube on the plate"),
        (Stage("pick_place", "place", "fxtr", object="obj", part="{rack}"),
         "put the ice cube on the top rack of the oven"),
        (Stage("made", "hold", "fxtr", object="{fxtr}_lid"), "hold the lid"),
        (Stage("doors", "open", "fxtr", part="left_door"), "open the left door of the oven"),
    ):  # fmt: skip
        assert stage_text(stage, scene) == text
