"""Load the fridge."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, OnShelf
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_BOWLS = {"vegetable1": "veg_bowl", "vegetable2": "veg_bowl", "meat1": "meat_bowl", "meat2": "meat_bowl"}


def _bowl(name: str, x: float, again: str = "") -> ObjectSpec:
    start = on_counter("fridge", (np.inf, 0.4), pos=(x, -1.0), reuse_region_from=again)
    return ObjectSpec(name, ("bowl",), start, graspable=True, repeats=True)


def _in_bowl(name: str, exclude: tuple[str, ...] = ()) -> ObjectSpec:
    start = Placement(object=_IN_BOWLS[name], heaped=True)
    return ObjectSpec(
        name, (name.rstrip("12"),), start, graspable=True, properties=("fridgable",), exclude=exclude, repeats=True
    )


# All fridges have two usable shelves at least.
LOAD_FRIDGE_BY_TYPE = Task(
    name="LoadFridgeByType",
    summary=(
        "The bowl with both vegetables is on its shelf of the fridge, the bowl with both pieces of meat on the other, "
        "the gripper away from the bowls."
    ),
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("counter", at_object="veg_bowl"),
    choices=(
        Choice(
            "veg_shelf",
            {
                "highest": {"_meat_shelf": "second_highest", "meat_level": "second highest", "veg_level": "highest"},
                "second_highest": {"_meat_shelf": "highest", "meat_level": "highest", "veg_level": "second highest"},
            },
        ),
    ),
    objects=(
        _bowl("veg_bowl", -0.25),
        _bowl("meat_bowl", 0.25, again="veg_bowl"),
        _in_bowl("vegetable1"),
        _in_bowl("vegetable2"),
        _in_bowl("meat1", exclude=("shrimp",)),
        _in_bowl("meat2", exclude=("shrimp",)),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(ObjectOn(name, bowl) for name, bowl in _IN_BOWLS.items()),
        OnShelf("veg_bowl", "fridge", "{veg_shelf}"),
        OnShelf("meat_bowl", "fridge", "{_meat_shelf}"),
        GripperFar("veg_bowl"),
        GripperFar("meat_bowl"),
    ),
    stages=(
        *fetch("veg_bowl", "counter", "fridge", part="fridge_shelf:{veg_shelf}"),
        Stage("navigation", "drive", "meat_bowl"),
        *fetch("meat_bowl", "counter", "fridge", part="fridge_shelf:{_meat_shelf}"),
    ),
    instruction=(
        "Put the bowl with {vegetable1+vegetable2} on the {veg_level} shelf of the fridge and the bowl with "
        "{meat1+meat2} on the {meat_level}."
    ),
    paraphrases=(
        "Vegetables go on the {veg_level} shelf of the fridge, meat on the {meat_level}; keep them in their bowls.",
        "Load the fridge: {veg_level} shelf for the bowl of vegetables, {meat_level} shelf for the bowl of meat.",
        "Carry the bowl of vegetables to the fridge's {veg_level} shelf, then the bowl of meat to the {meat_level}.",
        "The bowl of meat belongs on the {meat_level} shelf of the fridge, that of vegetables on the {veg_level}.",
    ),
)

TASKS = (LOAD_FRIDGE_BY_TYPE,)
