"""Load the fridge with what must not spoil: the new behind the old, and cooked food in a box."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Behind,
    DoorsClosed,
    GripperFar,
    ObjectOn,
    ObjectTouches,
    OnShelf,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)
_HIGHER = (1.0, 1.0, 1.2)
_FIXTURES = (FixtureSpec("fridge", "fridge"), counter_near("fridge"))
_SHELF = Choice("shelf", {"highest": {"level": "highest"}, "second_highest": {"level": "second highest"}})
_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")
_SHUT = DoorsClosed("fridge", part="fridge")
_CLOSE = Stage("doors", "close_large", "fridge", part="fridge")
_BEHIND = AllOf(OnShelf("meat_new", "fridge", "{shelf}"), Behind("meat_new", "meat_old", "fridge", by=0.1))

LOAD_FRIDGE_FIFO = Task(
    name="LoadFridgeFifo",
    summary="Both pieces of meat are on the one shelf of the fridge, the new one behind the old; the fridge is shut.",
    fixtures=_FIXTURES,
    robot_start=RobotStart("counter", at_object="meat_new_container"),
    choices=(_SHELF,),
    objects=(
        ObjectSpec(
            "meat_old",
            ("steak", "chicken_drumstick", "fish"),
            on_shelf("{shelf}", (0.5, 0.15), rotation=_ACROSS),
            scale=_HIGHER,
        ),
        ObjectSpec(
            "meat_new",
            ("steak", "chicken_drumstick", "fish"),
            on_counter("fridge", (0.5, 0.4), pos=(0.0, -1.0), try_to_place_in="plate"),
            graspable=True,
            scale=_HIGHER,
            same_category_as="meat_old",
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(OnShelf("meat_old", "fridge", "{shelf}"), *_BEHIND.parts, _SHUT),
    stages=(
        *fetch(
            "meat_new",
            "counter",
            "fridge",
            part="fridge_shelf:{shelf}",
            until=AllOf(*_BEHIND.parts, GripperFar("meat_new")),
        ),
        _CLOSE,
    ),
    instruction=(
        "Put the {meat_new} from the counter on the {level} shelf of the fridge, behind the {meat_old} that is there, "
        "and close the fridge."
    ),
    paraphrases=(
        "What is older is eaten first: the new {meat_new} goes behind it on the fridge's {level} shelf. Shut it then.",
        "Load the {meat_new} from the plate into the fridge, behind the old one on the {level} shelf; close the door.",
        "On the fridge's {level} shelf the old {meat_old} stays in front, the new one comes behind it. Fridge shut.",
        "Carry the new {meat_new} to the {level} shelf, past the old one, and leave the fridge closed.",
    ),
)

_COOKED = ("meat_in_tupperware", "veg_in_tupperware")
_EXISTING = ("existing_item1_top", "existing_item2_top", "existing_item1_second", "existing_item2_second")
_THIRD = "target_rack_third_item"
_SMALL_M = (0.12, 0.12, 0.2)
_IN_BOX_M = (0.18, 0.12, None)  # a whole lobster would lie on its rim


def _existing(name: str, start: Placement) -> ObjectSpec:
    return ObjectSpec(name, ("any",), start, graspable=True, properties=("fridgable",), max_size=_SMALL_M)


def _at_side(name: str) -> ObjectSpec:
    level = "highest" if name.endswith("top") else "second_highest"
    return _existing(name, on_shelf(level, (0.14, 0.25), (-1.0 if "item1" in name else 1.0, -1.0), margin=0.01))


# The box has room between what stands at the sides of its shelf.
LOAD_PREPARED_FOOD = Task(
    name="LoadPreparedFood",
    summary="The filled box is on its shelf, what was in the fridge is on any of the shelves; the fridge is shut.",
    fixtures=_FIXTURES,
    robot_start=RobotStart("counter", at_object="tupperware"),
    choices=(_SHELF,),
    objects=(
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            on_counter("fridge", (0.6, 0.5), pos=(0.0, -1.0), rotation=_ACROSS),
            graspable=True,
            scale=(1.3, 1.3, 1.2),
        ),
        ObjectSpec("meat_in_tupperware", ("meat",), Placement(object="tupperware"), max_size=_IN_BOX_M),
        ObjectSpec(
            "veg_in_tupperware", ("vegetable",), Placement(object="tupperware", heaped=True), max_size=_IN_BOX_M
        ),
        *map(_at_side, _EXISTING),
        _existing(_THIRD, on_shelf("{shelf}", (0.3, 0.15), (0.0, 1.0), margin=0.01)),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        OnShelf("tupperware", "fridge", "{shelf}"),
        AnyOf(
            AllOf(*(ObjectOn(name, "tupperware") for name in _COOKED)),
            AllOf(AnyOf(*(ObjectOn(name, "tupperware") for name in _COOKED)), ObjectTouches(*_COOKED)),
        ),
        AllOf(*(OnShelf(name, "fridge") for name in (*_EXISTING, _THIRD))),
        _SHUT,
    ),
    stages=(*fetch("tupperware", "counter", "fridge", part="fridge_shelf:{shelf}"), _CLOSE),
    instruction=(
        "Put the tupperware with the {meat_in_tupperware} and the {veg_in_tupperware} on the {level} shelf of the "
        "fridge, where there is room, and close the fridge."
    ),
    paraphrases=(
        "Store the meal in its box on the fridge's {level} shelf, keep all that is there on the shelves, and shut it.",
        "The filled tupperware belongs on the {level} shelf, between the other things. Close the fridge after that.",
        "Carry the box of {meat_in_tupperware} and {veg_in_tupperware} to the fridge's {level} shelf; shut the door.",
        "Load the prepared food, box and all, onto the {level} shelf of the open fridge and leave that closed.",
    ),
)

TASKS = (LOAD_FRIDGE_FIFO, LOAD_PREPARED_FOOD)
