"""Pack lunches into boxes."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Exactly,
    GripperFar,
    Near,
    Not,
    ObjectOn,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, in_cabinet, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)  # radians
# Of boxes that are 17 cm long at their own scale: the published 2.5 would make them 44 cm long.
_SCALE = (1.5, 1.5, 1.25)
_VEGETABLES, _MEATS, _BOXES = ("vegetable0", "vegetable1"), ("meat0", "meat1"), ("tupperware0", "tupperware1")


def _in_fridge(name: str, group: str, x: float, same: str = "", exclude: tuple[str, ...] = ()) -> ObjectSpec:
    shelf = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
    start = Placement("fridge", region=shelf, size=(0.3, 0.2), pos=(x, -1.0), margin=0.0)
    return ObjectSpec(name, (group,), start, graspable=True, exclude=exclude, same_category_as=same)


def _box(name: str, x: float) -> ObjectSpec:
    start = Placement("counter", region=SampleRegion(ref="fridge"), size=(1.5, 0.5), pos=(x, -1.0), rotation=_ACROSS)
    return ObjectSpec(name, ("tupperware",), start, scale=_SCALE, repeats=True)


def _one_in(box: str, names: tuple[str, ...]) -> Exactly:
    return Exactly(1, *(ObjectOn(name, box) for name in names))


def _fetch(name: str, box: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "fridge", object=name),
        Stage("navigation", "drive", box, object=name),
        Stage("pick_place", "place", box, object=name),
    )


_BACK = Stage("navigation", "drive", "fridge")

PACK_IDENTICAL_LUNCHES = Task(
    name="PackIdenticalLunches",
    summary="Each of the two boxes holds exactly one of the vegetables and one piece of the meat, the gripper away.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("counter", "counter", near="fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        _in_fridge("vegetable0", "vegetable", -0.25),
        _in_fridge("vegetable1", "vegetable", 0.25, same="vegetable0"),
        _in_fridge("meat0", "meat", -0.25, exclude=("shrimp",)),
        _in_fridge("meat1", "meat", 0.25, same="meat0", exclude=("shrimp",)),
        _box("tupperware0", -0.5),
        _box("tupperware1", 0.5),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(AllOf(_one_in(box, _VEGETABLES), _one_in(box, _MEATS)) for box in _BOXES),
        AllOf(*(Not(AllOf(*(ObjectOn(name, box) for box in _BOXES))) for name in (*_VEGETABLES, *_MEATS))),
        *(GripperFar(name) for name in (*_VEGETABLES, *_MEATS)),
    ),
    stages=(
        *_fetch("vegetable0", "tupperware0"),
        _BACK,
        *_fetch("meat0", "tupperware0"),
        _BACK,
        *_fetch("vegetable1", "tupperware1"),
        _BACK,
        *_fetch("meat1", "tupperware1"),
    ),
    instruction="Pack two equal lunches: put one {vegetable0} and one {meat0} from the fridge into each box.",
    paraphrases=(
        "Put a {vegetable0} and a {meat0} from the fridge into either box on the counter.",
        "Both boxes get the same lunch, {vegetable0} and {meat0}; you find two of each in the fridge.",
        "Share {vegetable0+vegetable1} and {meat0+meat1} between the two boxes, one of each per box.",
        "Make two identical lunch boxes with the {vegetable0} and the {meat0} in the open fridge.",
    ),
)


_STRAIGHT = (0.0, 0.0)  # radians
_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")
_COLD, _HOT = ("cold0", "cold1"), ("hot0", "hot1")


def _fresh(name: str, groups: tuple[str, ...], level: str) -> ObjectSpec:
    return ObjectSpec(name, groups, on_shelf(level, (0.3, 0.2)), graspable=True)


def _apart(hot_box: str, cold_box: str) -> AllOf:
    return AllOf(*(ObjectOn(name, hot_box) for name in _HOT), *(ObjectOn(name, cold_box) for name in _COLD))


PACK_FOOD_BY_TEMP = Task(
    name="PackFoodByTemp",
    summary="The two cold things share one box, the two hot ones the other, the gripper away from all four.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stove", "stove"),
        counter_near("stove"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("fridge"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "hot0_container",
            ("pan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
        ),
        ObjectSpec("hot0", ("cooked_food",), Placement(object="hot0_container"), graspable=True),
        ObjectSpec("hot1_container", ("plate",), on_counter("stove", (np.inf, 0.5), loc="left_right")),
        ObjectSpec("hot1", ("cooked_food",), Placement(object="hot1_container"), graspable=True),
        _fresh("cold0", ("fruit", "vegetable"), "highest"),
        _fresh("cold1", ("fruit", "vegetable"), "second_highest"),
        *(
            ObjectSpec(
                name,
                ("tupperware",),
                before_stool((1.25, 0.45), pos=(x, "ref"), rotation=_STRAIGHT),
                scale=_SCALE,
                repeats=True,
            )
            for name, x in zip(_BOXES, (0.5, -0.5), strict=True)
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(AnyOf(_apart(*_BOXES), _apart(*_BOXES[::-1])), *map(GripperFar, (*_HOT, *_COLD))),
    stages=(
        *fetch_in_turn(_COLD, "fridge", "tupperware0"),
        Stage("navigation", "drive", "stove"),
        *fetch("hot0", "stove", "tupperware1"),
        Stage("navigation", "drive", "hot1"),
        *fetch("hot1", "counter", "tupperware1"),
    ),
    instruction=(
        "Pack {cold0} and {cold1} from the fridge into one box on the dining counter, and {hot0} and {hot1} from the "
        "stove and beside it into the other."
    ),
    paraphrases=(
        "Cold food and hot food travel apart: {cold0} and {cold1} in one box, {hot0} and {hot1} in the other.",
        "One box on the dining counter is for what is in the fridge, the other for what is on and by the stove.",
        "Pack two boxes: {cold0} with {cold1}, and {hot0} with {hot1}.",
        "Sort lunch by temperature into the boxes on the dining counter, two cold things and two hot ones.",
    ),
)

_FRUITS = ("fruit0", "fruit1")

PACK_FRUIT_CONTAINER = Task(
    name="PackFruitContainer",
    summary="Both fruits are in the box on the counter, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        _fresh("fruit0", ("fruit",), "highest"),
        _fresh("fruit1", ("fruit",), "second_highest"),
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            on_counter("fridge", (np.inf, 0.35), rotation=_STRAIGHT),
            graspable=True,
            scale=_SCALE,
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(*(ObjectOn(name, "tupperware") for name in _FRUITS), *map(GripperFar, _FRUITS)),
    stages=fetch_in_turn(_FRUITS, "fridge", "tupperware"),
    instruction="Put the {fruit0} and the {fruit1} from the fridge into the box on the counter.",
    paraphrases=(
        "Pack fruit: the fridge's {fruit0} and {fruit1} go into the plastic box.",
        "Take the {fruit0} and then the {fruit1} out of the open fridge, into the box on the counter.",
        "The box on the counter should hold the {fruit0} and the {fruit1}.",
        "For lunch, both fruits in the fridge belong in the box.",
    ),
)

_BY_BOX = AllOf(ObjectTouchesAnyCounter("snack"), Near("snack", "tupperware", 0.3), GripperFar("snack"))

PACK_SNACK = Task(
    name="PackSnack",
    summary="The snack stands on a counter, 30 cm from the packed box at most, the gripper away from it.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), FixtureSpec("counter", "counter")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            Placement("counter", size=(0.5, 0.4), pos=(1.0, -1.0), rotation=_STRAIGHT),
            scale=(1.5, 1.5, 1.25),
        ),
        ObjectSpec(
            "food1",
            ("cooked_food", "meat"),
            Placement(object="tupperware", heaped=True),
            exclude=("kebab_skewer", "pizza", "shrimp"),
        ),
        ObjectSpec("food2", ("vegetable",), Placement(object="tupperware", heaped=True)),
        ObjectSpec("snack", ("boxed_food", "chips"), in_cabinet("cabinet", (0.5, 0.3)), graspable=True),
        ObjectSpec(
            "distr_cabinet",
            ("receptacle", "stackable", "tool"),
            in_cabinet("cabinet", (np.inf, 0.3), pos=(0.0, 1.0)),
            graspable=True,
            exclude=("tupperware",),
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=_BY_BOX,
    stages=fetch("snack", "cabinet", "counter", until=_BY_BOX),
    instruction="Take the {snack} out of the cabinet and set it on the counter beside the packed box.",
    paraphrases=(
        "The lunch in the box lacks a snack: put the cabinet's {snack} next to it.",
        "Bring the {snack} from the open cabinet to the side of the box on the counter.",
        "Set the {snack} down close to the box with the {food1} and the {food2}.",
        "Beside the packed box on the counter belongs the {snack} from the cabinet.",
    ),
)

TASKS = (PACK_FOOD_BY_TEMP, PACK_FRUIT_CONTAINER, PACK_IDENTICAL_LUNCHES, PACK_SNACK)
