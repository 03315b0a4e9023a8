"""Keep condiments in order."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, Beside, GripperFar, Near, NearFixture, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BOTTLES = ("condiment_bottle", "ketchup", "syrup_bottle")
_BEFORE = on_counter("cabinet", (0.5, 0.2))
_BESIDE_M = 0.15


def _in_cabinet() -> Placement:
    return in_cabinet("cabinet", (np.inf, 0.2))


def _stored(name: str) -> AllOf:
    """In the cabinet beside what is like it there, and let go."""
    return AllOf(ObjectInside(name, "cabinet"), Near(name, f"cab_{name}", _BESIDE_M), GripperFar(name))


def _store(name: str) -> Stage:
    text = f"put the {{{name}}} into the cabinet beside the {{cab_{name}}}"
    return Stage("pick_place", "place", "cabinet", object=name, until=_stored(name), text=text)


CATEGORIZE_CONDIMENTS = Task(
    name="CategorizeCondiments",
    summary="Bottle and shaker are in the cabinet beside the other bottle and the other shaker, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("counter", at_object="obj1"),
    objects=(
        ObjectSpec("obj1", _BOTTLES, _BEFORE, graspable=True),
        ObjectSpec("obj2", ("shaker",), _BEFORE, graspable=True),
        ObjectSpec("cab_obj1", _BOTTLES, _in_cabinet(), graspable=True, repeats=True),
        ObjectSpec("cab_obj2", ("shaker",), _in_cabinet(), graspable=True, repeats=True),
        ObjectSpec(
            "distr_counter1", ("any",), on_counter("cabinet", (np.inf, 0.3), pos=("ref", 1.0)), exclude=("condiment",)
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_stored("obj1").parts, *_stored("obj2").parts),
    stages=(_store("obj1"), _store("obj2")),
    instruction="Put the {obj1} from the counter next to the {cab_obj1} in the cabinet, and the shaker to the other.",
    paraphrases=(
        "Sort the condiments into the cabinet: bottle beside bottle, shaker beside shaker.",
        "The {obj1} and the shaker on the counter belong in the cabinet, each with its own kind.",
        "Clear the counter's {obj1} and shaker away, next to the cabinet's {cab_obj1} and shaker.",
        "In the cabinet, the {obj1} should join the {cab_obj1}, and the shaker the one that is there.",
    ),
)

_CONDIMENTS = ("condiment1", "condiment2", "condiment3")
_SHAKERS = ("shaker", "salt_and_pepper_shaker")


def _beside(name: str, groups: tuple[str, ...], depth: float = 0.3, exclude: tuple[str, ...] = ()) -> ObjectSpec:
    again = "" if name == "condiment1" else "condiment1"
    start = on_counter("cabinet", (np.inf, depth), reuse_region_from=again)
    return ObjectSpec(name, groups, start, graspable=True, exclude=exclude, repeats=True)


ORGANIZE_CONDIMENTS = Task(
    name="OrganizeCondiments",
    summary="The three condiments are in the cabinet, what is none is on the counter, the gripper away from all four.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("counter", at_object="condiment1"),
    objects=(
        _beside("condiment1", ("condiment",)),
        _beside("condiment2", _SHAKERS),
        _beside("condiment3", ("condiment", *_SHAKERS)),
        _beside("distractor", ("any",), depth=0.5, exclude=("condiment", *_SHAKERS)),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        *(ObjectInside(name, "cabinet") for name in _CONDIMENTS),
        ObjectTouches("distractor", "counter"),
        *map(GripperFar, (*_CONDIMENTS, "distractor")),
    ),
    stages=tuple(Stage("pick_place", "place", "cabinet", object=name) for name in _CONDIMENTS),
    instruction=(
        "Put the {condiment1}, the {condiment2} and the {condiment3} into the cabinet; the {distractor} stays on the "
        "counter."
    ),
    paraphrases=(
        "Put every condiment and shaker on the counter away into the open cabinet, but not the {distractor}.",
        "Three things on the counter season food: they belong in the cabinet. Leave the {distractor}.",
        "Tidy {condiment1}, {condiment2} and {condiment3} into the cabinet above.",
        "The cabinet is for the {condiment1}, the {condiment2} and the {condiment3}, the counter for the {distractor}.",
    ),
)


_IN_A_ROW = Beside("condiment2", "condiment1", "counter", across=0.2, along=0.05)


def _by_stove(name: str) -> AllOf:
    return AllOf(ObjectTouches(name, "counter"), NearFixture(name, "stove", 0.35), GripperFar(name))


def _in_front(name: str) -> ObjectSpec:
    groups = ("condiment", "shaker", "salt_and_pepper_shaker")
    return ObjectSpec(name, groups, in_cabinet("cabinet", (np.inf, 0.2)), graspable=True, repeats=True)


LINE_UP_CONDIMENTS = Task(
    name="LineUpCondiments",
    summary="Both condiments stand in a row on the counter, 35 cm from the stove at most, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("cabinet"),
    objects=(_in_front("condiment1"), _in_front("condiment2")),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_by_stove("condiment1").parts, *_by_stove("condiment2").parts, _IN_A_ROW),
    stages=(
        *fetch("condiment1", "cabinet", "counter", until=_by_stove("condiment1")),
        Stage("navigation", "drive", "cabinet"),
        *fetch("condiment2", "cabinet", "counter", until=AllOf(*_by_stove("condiment2").parts, _IN_A_ROW)),
    ),
    instruction=(
        "Put both condiments from the cabinet on the counter by the stove, next to each other in a row along the "
        "counter's edge."
    ),
    paraphrases=(
        "Line the two condiments up beside the stove; they are in the open cabinet.",
        "Bring {condiment1+condiment2} to the counter at the stove and stand them side by side.",
        "The cook wants both condiments close to the stove, one next to the other.",
        "By the stove there should be a row of two: {condiment1+condiment2}.",
    ),
)

TASKS = (CATEGORIZE_CONDIMENTS, LINE_UP_CONDIMENTS, ORGANIZE_CONDIMENTS)
