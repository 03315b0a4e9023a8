"""Sort utensils: what is of metal, on a dining counter."""

from collections.abc import Callable

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, ForEach, Goal, GripperFar, Not, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch_in_turn
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_SECOND = "metallic_utensil_2"
_THIRD_METALLIC, _SECOND_WOODEN = "third_metallic_utensil", "second_wooden_spoon"


def _laid(name: str, groups: tuple[str, ...], high: float, count: tuple[int, int] | str = (1, 1)) -> ObjectSpec:
    start = before_stool((1.0, 0.35), pos=(0.0, -1.0), rotation=(np.pi, np.pi))
    return ObjectSpec(name, groups, start, count=count, scale=(1.0, 1.0, high), repeats=True)


def _of_metal(make: Callable[[str], Goal]) -> AllOf:
    return AllOf(make("metallic_utensil"), make(_SECOND), ForEach(_THIRD_METALLIC, make))


def _of_wood(make: Callable[[str], Goal]) -> AllOf:
    return AllOf(make("wooden_spoon"), ForEach(_SECOND_WOODEN, make))


def _put_away(name: str) -> AllOf:
    return AllOf(ObjectInside(name, "drawer"), Not(ObjectTouches(name, "dining_counter")), GripperFar(name))


def _to_drawer(*names: str) -> tuple[Stage, ...]:
    return fetch_in_turn(names, "dining_counter", "drawer", until=_put_away, along=True)


ORGANIZE_METALLIC_UTENSILS = Task(
    name="OrganizeMetallicUtensils",
    summary="All metallic utensils are in the drawer, the wooden spoons on the dining counter, the gripper away.",
    fixtures=(
        FixtureSpec("drawer", "drawer_top"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("dining_counter", at_object="wooden_spoon"),
    choices=(
        Choice(
            "fourth", {"metallic": {"_metallic": "1", "_wooden": "0"}, "wooden": {"_metallic": "0", "_wooden": "1"}}
        ),
    ),
    objects=(
        _laid("wooden_spoon", ("wooden_spoon",), 1.5),
        _laid("metallic_utensil", ("spoon", "fork"), 2.5),
        _laid(_SECOND, ("knife",), 2.0),
        _laid(_THIRD_METALLIC, ("spoon", "fork"), 2.5, count="{_metallic}"),
        _laid(_SECOND_WOODEN, ("wooden_spoon",), 1.5, count="{_wooden}"),
    ),
    # Published shares are of the slide's range, of which full travel is 0.55.
    initial=(InitialOpenness("drawer", 0.49, 0.55),),
    goal=AllOf(
        _of_metal(lambda name: ObjectInside(name, "drawer")),
        _of_metal(lambda name: Not(ObjectTouches(name, "dining_counter"))),
        _of_wood(lambda name: ObjectTouches(name, "dining_counter")),
        _of_wood(lambda name: Not(ObjectInside(name, "drawer"))),
        AllOf(_of_metal(GripperFar), _of_wood(GripperFar)),
    ),
    stages=(
        *_to_drawer("metallic_utensil", _SECOND),
        EachStage(_THIRD_METALLIC, lambda name: (Stage("navigation", "drive", name), *_to_drawer(name))),
    ),
    instruction="Put all metal cutlery from the dining counter into the open drawer; what is of wood stays there.",
    paraphrases=(
        "The open drawer is for knives, forks and spoons of metal; leave the dining counter nothing but wood.",
        "Sort what lies on the dining counter: metal goes to the drawer that is open, wood does not move.",
        "Carry each metallic utensil from the dining counter to the open drawer, and no wooden one.",
        "Everything metallic on the dining counter belongs in the drawer. Do not take wooden spoons along.",
    ),
)

TASKS = (ORGANIZE_METALLIC_UTENSILS,)
