"""Measure ingredients: cups in order."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Beside,
    Goal,
    GripperFar,
    HandlePoints,
    Near,
    Not,
    ObjectTilt,
    ObjectTouches,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SMALL, _MEDIUM, _LARGE = _CUPS = ("measuring_cup_small", "measuring_cup_medium", "measuring_cup_large")
_SCALES = dict(zip(_CUPS, (0.8, 1.0, 1.2), strict=True))
# Handles of our measuring cups lie along -x: a quarter turn brings them to the front. Each is turned from there by 35
# to 60 degrees, to either side.
_TO_FRONT, _LEAST, _MOST = np.pi / 2, 0.611, 1.047
_MOST_OFF, _STEEPEST, _AWAY_M = float(np.deg2rad(30.0)), float(np.deg2rad(60.0)), 0.15
_CLEAR_M = 0.16  # between the middles of two cups


def _cup(name: str) -> ObjectSpec:
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
    objects=tuple(map(_cup, _CUPS)),
    goal=AllOf(
        _beside(_MEDIUM, _SMALL, "right"),
        _beside(_LARGE, _MEDIUM, "right"),
        AllOf(*map(_to_front, _CUPS)),
        AllOf(*map(_stands, _CUPS)),
        AllOf(*map(_touches, _CUPS)),
        *(GripperFar(name, _AWAY_M) for name in _CUPS),
    ),
    stages=(
        _line_up(_SMALL, _beside(_SMALL, _MEDIUM, "left"), "put the small cup to the left of the medium one"),
        _line_up(_MEDIUM, _beside(_MEDIUM, _SMALL, "right"), "put the medium cup to the right of the small one"),
        _line_up(_LARGE, _beside(_LARGE, _MEDIUM, "right"), "put the large cup to the right of the medium one"),
    ),
    instruction="Put the three measuring cups in a row from small, at the left, to large, all handles to the front.",
    paraphrases=(
        "Sort the measuring cups on the counter by size, growing to the right, with their handles towards you.",
        "From left to right: small, medium, large. So should the measuring cups stand, handles to the front.",
        "Tidy up the three measuring cups, the larger the farther right, and turn every handle to the counter's edge.",
        "The smallest measuring cup belongs at the left end of a row of three, and each shows its handle to the front.",
    ),
)

TASKS = (ORGANIZE_MEASURING_CUPS,)
