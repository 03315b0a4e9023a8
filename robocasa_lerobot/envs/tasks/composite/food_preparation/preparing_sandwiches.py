"""Prepare sandwiches."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectTouches, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_TIMER = PartWithin("toaster_oven", "knob_time", low=0.10, label="set")


def _on_rack(name: str) -> ObjectTouches:
    return ObjectTouches(name, "toaster_oven", part="{rack}")


def _put_in(name: str) -> Stage:
    there = AllOf(_on_rack(name), GripperFar(name))
    return Stage("pick_place", "place", "toaster_oven", object=name, part="{rack}", until=there)


HEAT_KEBAB_SANDWICH = Task(
    name="HeatKebabSandwich",
    summary="Baguette and kebab lie on the rack of the toaster oven, which is shut, its timer set, the gripper away.",
    fixtures=(FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven")),
    robot_start=RobotStart("counter", at_object="plate"),
    choices=(Choice("rack", of="toaster_oven"),),
    objects=(
        ObjectSpec("plate", ("plate",), on_counter("toaster_oven", (np.inf, 0.4), loc="left_right"), scale=1.25),
        # Both are longer than the plate is wide.
        ObjectSpec(
            "kebab",
            ("kebab_skewer",),
            Placement(object="plate", ensure_inside=False),
            graspable=True,
            scale=(1.1, 0.8, 1.0),
        ),
        ObjectSpec("baguette", ("baguette",), Placement(object="plate", ensure_inside=False), graspable=True),
    ),
    initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "knob_time", (0.0, 0.0))),
    goal=AllOf(
        _on_rack("baguette"),
        _on_rack("kebab"),
        DoorsClosed("toaster_oven"),
        _TIMER,
        GripperFar("baguette"),
        GripperFar("kebab"),
    ),
    stages=(
        Stage("racks", "pull", "toaster_oven", part="{rack}"),
        _put_in("kebab"),
        _put_in("baguette"),
        Stage("racks", "push", "toaster_oven", part="{rack}"),
        Stage("doors", "lift_shut", "toaster_oven"),
        Stage("knobs", "raise", "toaster_oven", part="knob_time", until=_TIMER),
    ),
    instruction=(
        "Put the kebab skewer and the baguette on the {rack} of the toaster oven, close its door and turn its timer up."
    ),
    paraphrases=(
        "Heat the baguette and the kebab skewer from the plate on the toaster oven's {rack}.",
        "Pull out the {rack} of the toaster oven, lay skewer and baguette on it, shut the oven and start its timer.",
        "The kebab skewer and the baguette should get warm: {rack}, door, timer of the toaster oven.",
        "Load the {rack} of the toaster oven with both things on the plate, shut it, and set some time.",
    ),
)

TASKS = (HEAT_KEBAB_SANDWICH,)
