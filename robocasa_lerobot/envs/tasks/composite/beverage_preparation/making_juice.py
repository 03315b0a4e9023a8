"""Make juice."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    GripperTouches,
    Higher,
    Not,
    ObjectInside,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    StateIs,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FILLED = StepsWhile(UnderWater("blender_jug", "sink"), 25, label="blender_jug_filled")

FILL_BLENDER_JUG = Task(
    name="FillBlenderJug",
    summary="The jug of the blender was under running water for 25 steps.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="blender_jug"),
    objects=(
        ObjectSpec("blender_jug", ("blender_jug",), on_counter("sink", (0.4, 0.4), loc="left_right"), graspable=True),
    ),
    initial=(Water("sink", on=False),),
    goal=_FILLED,
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        Stage("pick_place", "hold", "sink", object="blender_jug", until=_FILLED),
    ),
    instruction="Turn on the faucet and hold the jug of the blender under the water until it is full.",
    paraphrases=(
        "Fill the blender's jug with water from the faucet.",
        "Let water run into the jug that stands beside the sink.",
        "The jug of the blender should be full of water: open the faucet and hold the jug below.",
        "With the water running, keep the jug under the stream for a moment.",
    ),
)

_ROTTEN = (0.40, 0.26, 0.14)
_LID = "{blender}_lid"
_UNCOVERED = AllOf(ObjectTouchesAnyCounter(_LID), StateIs("blender", "lid", value=False), GripperFar(_LID, 0.15))

CHOOSE_RIPE_FRUIT = Task(
    name="ChooseRipeFruit",
    summary="The fresh fruit is in the blender's jug and the brown one is not, the gripper away from the fresh one.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("blender", "blender"),
        counter_near("blender", size=(0.35, 0.35)),
    ),
    robot_start=RobotStart("blender"),
    objects=(
        ObjectSpec(
            "fruit0",
            ("fruit",),
            on_counter("blender", (0.35, 0.15), loc="left_right"),
            graspable=True,
            max_size=(0.085, 0.085, None),
            stained=_ROTTEN,
        ),
        ObjectSpec(
            "fruit1",
            ("fruit",),
            on_counter("blender", (0.35, 0.15), loc="left_right"),
            graspable=True,
            same_category_as="fruit0",
            same_model=True,
            repeats=True,
        ),
    ),
    goal=AllOf(ObjectInside("fruit1", "blender"), GripperFar("fruit1"), Not(ObjectInside("fruit0", "blender"))),
    stages=(
        Stage("pick_place", "uncover", "blender", object=_LID, until=_UNCOVERED),
        Stage("pick_place", "place", "blender", object="fruit1", text="put the fresh {fruit1} into the blender"),
    ),
    instruction="Open the blender and put the fresh {fruit1} into it, not the brown one.",
    paraphrases=(
        "One of the two is rotten; the blender should get the other {fruit1}.",
        "Take the lid off the blender, and let the {fruit1} that is not brown drop in.",
        "Choose the ripe {fruit1} for the juice: it goes into the blender, the brown one stays.",
        "The good {fruit1} belongs in the jug of the blender, so uncover that first.",
    ),
)

_PRESSED = StepsWhile(
    AllOf(
        ObjectTouches("fruit", "reamer"),
        ObjectTilt("fruit", high=float(np.deg2rad(20.0)), label="face_down"),
        GripperTouches("fruit"),
        Higher("fruit", "reamer"),
    ),
    11,
    label="fruit_pressed",
)


def _in_front(size: tuple[float, float], again: str = "") -> Placement:
    return Placement("counter", size=size, pos=(0.0, -1.0), reuse_region_from=again)


JUICE_FRUIT_REAMER = Task(
    name="JuiceFruitReamer",
    summary="The gripper has pressed the fruit, its cut face down, on the reamer for 11 steps.",
    fixtures=(FixtureSpec("counter", "counter"),),
    robot_start=RobotStart("counter", at_object="fruit"),
    objects=(
        ObjectSpec("fruit", ("orange_half", "kiwi_half"), _in_front((0.3, 0.3)), graspable=True, face_down=True),
        ObjectSpec("reamer", ("reamer",), _in_front((0.5, 0.3), again="fruit")),
    ),
    goal=_PRESSED,
    stages=(
        Stage("pick_place", "pick", "counter", object="fruit"),
        Stage(
            "pick_place",
            "press",
            "reamer",
            object="fruit",
            until=_PRESSED,
            text="press the {fruit} on the reamer",
        ),
    ),
    instruction="Pick up the {fruit} and press it on the reamer.",
    paraphrases=(
        "Squeeze the {fruit} out on the reamer.",
        "Make juice: hold the {fruit} down on the reamer for a moment.",
        "The {fruit} belongs on the reamer, pressed down with its cut face.",
        "Bring the {fruit} to the reamer and push it onto that.",
    ),
)

TASKS = (CHOOSE_RIPE_FRUIT, FILL_BLENDER_JUG, JUICE_FRUIT_REAMER)
