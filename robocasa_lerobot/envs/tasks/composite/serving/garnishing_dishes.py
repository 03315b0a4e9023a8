"""Garnish dishes at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

GARNISH_PANCAKE = Task(
    name="GarnishPancake",
    summary="The strawberry lies on the pancake on its plate on the dining counter, the gripper away.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "strawberry",
            ("strawberry",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.15, 0.15),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            scale=0.9,
        ),
        ObjectSpec(
            "distr_fridge",
            ("food",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf"), size=(0.3, 0.3), pos=(0.0, 1.0)),
            properties=("fridgable",),
            exclude=("pancake",),
        ),
        ObjectSpec(
            "pancake_container",
            ("plate",),
            Placement("dining_counter", region=SampleRegion(ref="stool"), size=(0.35, 0.35), pos=("ref", "ref")),
        ),
        ObjectSpec("pancake", ("pancake",), Placement(object="pancake_container")),
    ),
    goal=AllOf(
        ObjectOn("strawberry", "pancake"),
        ObjectOn("pancake", "pancake_container"),
        ObjectTouches("pancake_container", "dining_counter"),
        GripperFar("strawberry"),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("pick_place", "pick", "fridge", object="strawberry"),
        Stage("navigation", "drive", "pancake", object="strawberry"),
        Stage("pick_place", "place", "pancake", object="strawberry"),
    ),
    instruction="Fetch the strawberry from the fridge and lay it on the pancake on the dining counter.",
    paraphrases=(
        "Garnish the pancake at the dining counter with the strawberry out of the fridge.",
        "The strawberry in the fridge belongs on top of the pancake.",
        "Open the fridge, carry the strawberry to the dining counter and set it on the pancake.",
        "Put a strawberry on the pancake; you find it in the fridge.",
    ),
)

TASKS = (GARNISH_PANCAKE,)
