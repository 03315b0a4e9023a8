"""Pack lunches into boxes."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, Exactly, GripperFar, Not, ObjectOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
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

TASKS = (PACK_IDENTICAL_LUNCHES,)
