"""Measure ingredients."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Beside,
    DoorsClosed,
    Goal,
    GripperFar,
    HandlePoints,
    Near,
    Not,
    ObjectOn,
    ObjectTilt,
    ObjectTouches,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FOOD = ("packaged_food",)
_WEIGHED = AllOf(ObjectOn("obj", "digital_scale"), ObjectUpright("obj"), GripperFar("obj"))

WEIGH_INGREDIENTS = Task(
    name="WeighIngredients",
    summary="The package stands upright on the scale, the cabinet is shut, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", _FOOD, in_cabinet("cabinet", (0.4, 0.2)), graspable=True),
        ObjectSpec("obj_distractor", _FOOD, in_cabinet("cabinet", (0.4, 0.2), pos=(0.0, 1.0)), graspable=True),
        ObjectSpec("digital_scale", ("digital_scale",), on_counter("cabinet", (0.3, 0.3))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_WEIGHED.parts, DoorsClosed("cabinet")),
    stages=(
        Stage("pick_place", "place", "digital_scale", object="obj", until=_WEIGHED),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the {obj} from the cabinet upright on the digital scale and close the cabinet.",
    paraphrases=(
        "Weigh the {obj}: it stands on the scale, and the cabinet is shut.",
        "Fetch the {obj} out of the cabinet, place it upright on the scale, then shut the {doors}.",
        "The {obj} in the cabinet should stand on the digital scale. Leave the cabinet closed.",
        "Get the {obj} onto the kitchen scale, the right way up, and close the {doors} of the cabinet.",
    ),
)

_WANTED, _OTHER = "measuring_cup_{size}", "measuring_cup_{_other}"
_TAKEN = AllOf(ObjectTouches(_WANTED, "counter"), GripperFar(_WANTED))


def _cup(name: str, scale: float, same: str = "") -> ObjectSpec:
    start = Placement("drawer", size=(0.5, 0.4), pos=(-1.0, 0.0))
    return ObjectSpec(
        name, ("measuring_cup",), start, graspable=True, scale=scale, same_category_as=same, same_model=bool(same)
    )


CHOOSE_MEASURING_CUP = Task(
    name="ChooseMeasuringCup",
    summary="The measuring cup of the size that is meant is on the counter, the other one is not, the gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
    robot_start=RobotStart("drawer", beside=True),
    choices=(
        Choice(
            "size",
            {"small": {"_other": "large", "which": "smaller"}, "large": {"_other": "small", "which": "larger"}},
        ),
    ),
    objects=(
        _cup("measuring_cup_small", 0.75),
        _cup("measuring_cup_large", 1.4, same="measuring_cup_small"),
    ),
    goal=AllOf(*_TAKEN.parts, Not(ObjectTouches(_OTHER, "counter"))),
    stages=(
        Stage("drawers", "open", "drawer"),
        Stage("pick_place", "place", "counter", object=_WANTED, text="put the {which} measuring cup on the counter"),
    ),
    instruction="Open the drawer to the {side} and put the {which} of its two measuring cups on the counter.",
    paraphrases=(
        "From the {side} drawer, which is shut, bring the {which} measuring cup to the counter.",
        "The recipe asks for the {which} measuring cup; it is in the drawer on the {side}.",
        "Leave the other measuring cup in the {side} drawer, and take out the {which} one.",
        "Pull out the drawer to your {side}; its {which} measuring cup goes on the counter above.",
    ),
)

_SMALL, _MEDIUM, _LARGE = _CUPS = ("measuring_cup_small", "measuring_cup_medium", "measuring_cup_large")
_SCALES = dict(zip(_CUPS, (0.8, 1.0, 1.2), strict=True))
# Handles of our measuring cups lie along -x: a quarter turn brings them to the front. Each is turned from there by 35
# to 60 degrees, to either side.
_TO_FRONT, _LEAST, _MOST = np.pi / 2, 0.611, 1.047
_MOST_OFF, _STEEPEST, _AWAY_M = float(np.deg2rad(30.0)), float(np.deg2rad(60.0)), 0.15
_CLEAR_M = 0.16  # between the middles of two cups


def _cup_in_row(name: str) -> ObjectSpec:
    again = "" if name == _SMALL else _SMALL
    start = on_counter(
        "cabinet",
        (0.6, 0.4),
        pos=(0.0, -1.0),
        rotation=(_TO_FRONT + _LEAST, _TO_FRONT + _MOST),
        other_rotation=(_TO_FRONT - _MOST, _TO_FRONT - _LEAST),
        reuse_region_from=again,
    )
    return ObjectSpec(
        name,
        ("measuring_cup",),
        start,
        graspable=True,
        scale=_SCALES[name],
        same_category_as=again,
        same_model=bool(again),
    )


def _beside(name: str, other: str, side: str) -> Beside:
    return Beside(name, other, "counter", across=0.35, along=0.15, side=side)


def _to_front(name: str) -> Goal:
    return HandlePoints(name, "counter", "front", _MOST_OFF)


def _stands(name: str) -> Goal:
    return ObjectTilt(name, high=_STEEPEST, label="stands")


def _touches(name: str) -> Goal:
    return ObjectTouches(name, "counter")


def _line_up(name: str, where: Goal, text: str) -> Stage:
    """A stage for a cup, which comes no nearer to those that stand in the row already than fingers that open need."""
    before = _CUPS[: _CUPS.index(name)]
    clear = (Not(Near(name, before, _CLEAR_M)),) if before else ()
    done = AllOf(where, *clear, _to_front(name), _stands(name), _touches(name), GripperFar(name, _AWAY_M))
    return Stage("pick_place", "place", "counter", object=name, until=done, text=text)


ORGANIZE_MEASURING_CUPS = Task(
    name="OrganizeMeasuringCups",
    summary="The cups stand in a row by size, the smallest at the left, their handles to the front, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("counter", at_object=_MEDIUM),
    objects=tuple(map(_cup_in_row, _CUPS)),
    goal=AllOf(
        _beside(_MEDIUM, _SMALL, "right"),
        _beside(_LARGE, _MEDIUM, "right"),
        AllOf(*map(_to_front, _CUPS)),
        AllOf(*map(_stands, _CUPS)),
        AllOf(*map(_touches, _CUPS)),
        *(GripperFar(name, _AWAY_M) for name in _CUPS),
    ),
    stages=(
        _line_up(_SMALL, _beside(_SMALL, _MEDIUM, "left"), "put the small measuring cup to the left of the medium one"),
        _line_up(
            _MEDIUM, _beside(_MEDIUM, _SMALL, "right"), "put the medium measuring cup to the right of the small one"
        ),
        _line_up(
            _LARGE, _beside(_LARGE, _MEDIUM, "right"), "put the large measuring cup to the right of the medium one"
        ),
    ),
    instruction="Put the three measuring cups in a row from small, at the left, to large, all handles to the front.",
    paraphrases=(
        "Sort the measuring cups on the counter by size, growing to the right, with their handles towards you.",
        "From left to right: small, medium, large. So should the measuring cups stand, handles to the front.",
        "Tidy up the three measuring cups, the larger the farther right, and turn every handle to the counter's edge.",
        "The smallest measuring cup belongs at the left end of a row of three, and each shows its handle to the front.",
    ),
)

TASKS = (CHOOSE_MEASURING_CUP, ORGANIZE_MEASURING_CUPS, WEIGH_INGREDIENTS)
