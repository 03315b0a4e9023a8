"""Keep order in the freezer."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectOn, OnShelf
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)  # radians


def _box(name: str, x: float, *, repeats: bool = False) -> ObjectSpec:
    start = Placement("counter", region=SampleRegion(ref="fridge"), size=(1.0, 0.4), pos=(x, -1.0), rotation=_ACROSS)
    return ObjectSpec(name, ("tupperware",), start, graspable=True, scale=(1.5, 1.5, 1.0), repeats=repeats)


def _in_box(name: str, group: str, box: str) -> ObjectSpec:
    return ObjectSpec(name, (group,), Placement(object=box, size=(0.8, 0.8)), graspable=True)


def _store(box: str, level: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "counter", object=box),
        Stage("navigation", "drive", "fridge", object=box),
        Stage("pick_place", "place", "fridge", object=box, part=f"freezer_shelf:{level}"),
    )


SEPARATE_FREEZER_RACK = Task(
    name="SeparateFreezerRack",
    summary=(
        "The box with the meat is on the second highest shelf of the freezer, the one with both vegetables on the "
        "highest, the gripper away from both."
    ),
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), FixtureSpec("counter", "counter", near="fridge")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="meat_tupperware"),
    objects=(
        _box("meat_tupperware", 0.25),
        _in_box("meat", "meat", "meat_tupperware"),
        _box("veg_tupperware", -0.25, repeats=True),
        _in_box("vegetable1", "vegetable", "veg_tupperware"),
        _in_box("vegetable2", "vegetable", "veg_tupperware"),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"),),
    goal=AllOf(
        ObjectOn("meat", "meat_tupperware"),
        ObjectOn("vegetable1", "veg_tupperware"),
        ObjectOn("vegetable2", "veg_tupperware"),
        OnShelf("meat_tupperware", "fridge", "second_highest", compartment="freezer"),
        OnShelf("veg_tupperware", "fridge", "highest", compartment="freezer"),
        GripperFar("meat_tupperware"),
        GripperFar("veg_tupperware"),
    ),
    stages=(
        *_store("meat_tupperware", "second_highest"),
        Stage("navigation", "drive", "veg_tupperware"),
        *_store("veg_tupperware", "highest"),
    ),
    instruction=(
        "Put the box of {meat} on the second highest shelf of the freezer and the box of {vegetable1} and {vegetable2} "
        "on the highest."
    ),
    paraphrases=(
        "The box with the {vegetable1} and the {vegetable2} goes on top in the freezer, the {meat} box just below.",
        "Freeze the {meat} on the second shelf from the top and the {vegetable1} and {vegetable2} on the first.",
        "Keep {meat} and vegetables apart: its box on the freezer's second highest shelf, theirs on the highest.",
        "Put both boxes into the freezer, vegetables on the uppermost shelf, {meat} one shelf lower.",
    ),
)

_BOTTLES = ("bottle1", "bottle2")


def _bottle(name: str) -> ObjectSpec:
    again = "" if name == "bottle1" else "bottle1"
    start = Placement(
        "counter", region=SampleRegion(ref="fridge"), size=(0.5, 0.3), pos=(0.0, -1.0), reuse_region_from=again
    )
    return ObjectSpec(name, ("bottled_water",), start, graspable=True, repeats=True)


def _freeze(name: str) -> tuple[Stage, ...]:
    return fetch(name, "counter", "fridge", part="freezer_shelf:any")


FREEZE_BOTTLED_WATERS = Task(
    name="FreezeBottledWaters",
    summary="Both bottles are on shelves of the freezer, which is shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), FixtureSpec("counter", "counter", near="fridge")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="bottle1"),
    objects=tuple(map(_bottle, _BOTTLES)),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"),),
    goal=AllOf(
        *(OnShelf(name, "fridge", compartment="freezer") for name in _BOTTLES), DoorsClosed("fridge", part="freezer")
    ),
    stages=(
        *_freeze("bottle1"),
        Stage("navigation", "drive", "bottle2"),
        *_freeze("bottle2"),
        Stage("doors", "close_large", "fridge", part="freezer"),
    ),
    instruction="Put both bottles of water into the freezer and close it.",
    paraphrases=(
        "Freeze the two bottles of water on the counter; leave the freezer shut.",
        "Both water bottles belong on a shelf of the freezer, behind its closed {freezer_doors}.",
        "Carry one bottle of water after the other from the counter to the open freezer, then shut that.",
        "Load the freezer with the counter's two bottles and close the {freezer_doors}.",
    ),
)

TASKS = (FREEZE_BOTTLED_WATERS, SEPARATE_FREEZER_RACK)
