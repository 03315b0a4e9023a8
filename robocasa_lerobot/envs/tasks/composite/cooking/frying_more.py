"""Fry on the stove, in several pans."""

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Goal, GripperFar, ObjectOn, OnBurner
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_WITHIN_M = 0.08
_TWO_PANS = ("pan1", "pan2")
_OTHER_BURNER = OnBurner("pan1", "stove", within=_WITHIN_M, other_than="pan2")


def _shared(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("vegetable", first), ObjectOn("meat", second))


def _on_a_burner(name: str) -> Stage:
    until = AllOf(OnBurner(name, "stove", within=_WITHIN_M), GripperFar(name))
    return Stage("pick_place", "place", "stove", object=name, until=until)


def _pan(name: str, counter: str, side: str) -> ObjectSpec:
    start = on_counter("stove", (1.0, 1.0), loc=side, counter=counter, rotation=HANDLE_TO_FRONT, margin=0.01)
    return ObjectSpec(name, ("pan",), start, graspable=True, repeats=True)


def _food(name: str, counter: str, side: str) -> ObjectSpec:
    return ObjectSpec(name, (name,), on_counter("stove", (0.6, 0.5), loc=side, counter=counter), graspable=True)


# A stove that stands between two counters has one of them on its left and the other on its right.
MEAL_PREP_STAGING = Task(
    name="MealPrepStaging",
    summary="Both pans stand on burners of their own; the vegetable is in one of them, the meat in the other.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("counter", "counter", near="stove", size=(0.3, 0.2), side="left"),
        FixtureSpec("right_counter", "counter", near="stove", size=(0.3, 0.2), side="right"),
    ),
    robot_start=RobotStart("stove"),
    choices=(
        Choice(
            "vegetable_side",
            {
                "left": {"_vegetable": "counter", "_meat": "right_counter", "_meat_side": "right"},
                "right": {"_vegetable": "right_counter", "_meat": "counter", "_meat_side": "left"},
            },
        ),
    ),
    objects=(
        _pan("pan1", "counter", "left"),
        _pan("pan2", "right_counter", "right"),
        _food("vegetable", "{_vegetable}", "{vegetable_side}"),
        _food("meat", "{_meat}", "{_meat_side}"),
    ),
    goal=AllOf(
        *(OnBurner(name, "stove", within=_WITHIN_M) for name in _TWO_PANS),
        _OTHER_BURNER,
        AnyOf(_shared(*_TWO_PANS), _shared(*reversed(_TWO_PANS))),
    ),
    stages=(
        *map(_on_a_burner, _TWO_PANS),
        Stage("pick_place", "place", "pan1", object="vegetable", text="put the {vegetable} into one of the pans"),
        Stage("pick_place", "place", "pan2", object="meat", text="put the {meat} into the other pan"),
    ),
    instruction="Stand each pan on a burner of its own, and put the {vegetable} into one, the {meat} into the other.",
    paraphrases=(
        "Get two pans ready on the stove: one with the {vegetable} in it, the other with the {meat}.",
        "Both pans belong on the stove, on different burners. The {vegetable} and the {meat} get a pan each.",
        "Move the pans beside the stove onto burners; then share out {vegetable} and {meat} between them.",
        "On the stove there should be a pan with the {vegetable} and another pan with the {meat}.",
    ),
)

TASKS = (MEAL_PREP_STAGING,)
