"""Garnish dishes at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
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

ADD_LEMON_TO_FISH = Task(
    name="AddLemonToFish",
    summary="The lemon wedge lies on the plate with the fish on the dining counter, the gripper away.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "lemon_wedge",
            ("lemon_wedge",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.15, 0.15),
                pos=(0.0, -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "distr_fridge",
            ("food",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf"), size=(0.3, 0.3), pos=(0.0, 1.0)),
            properties=("fridgable",),
        ),
        ObjectSpec("fish_container", ("plate",), before_stool((0.35, 0.35))),
        ObjectSpec("fish", ("fish",), Placement(object="fish_container")),
    ),
    goal=AllOf(
        ObjectOn("lemon_wedge", "fish_container"),
        ObjectOn("fish", "fish_container"),
        ObjectTouches("fish_container", "dining_counter"),
        GripperFar("lemon_wedge"),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("lemon_wedge", "fridge", "fish_container"),
    ),
    instruction="Bring the lemon wedge from the fridge to the dining counter and put it on the plate with the {fish}.",
    paraphrases=(
        "Garnish the {fish} on the dining counter with the lemon wedge out of the fridge.",
        "The plate with the {fish} lacks its lemon wedge, which is in the fridge.",
        "Open the fridge and carry the lemon wedge to the plate of {fish}.",
        "A lemon wedge goes with the {fish}: fetch the one in the fridge to the dining counter's plate.",
    ),
)

_CUBES = ("sugar_cube_1", "sugar_cube_2")
_AWAY_M = 0.15


def _sweetened(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "cake_container"), GripperFar(name, _AWAY_M))


ADD_SUGAR_CUBES = Task(
    name="AddSugarCubes",
    summary="Both sugar cubes lie on the plate with the cake on the dining counter, the gripper 15 cm away from them.",
    fixtures=(FixtureSpec("stool", "stool"), FixtureSpec("dining_counter", "dining_counter", near="stool")),
    robot_start=RobotStart("stool"),
    objects=(
        ObjectSpec("cake_container", ("plate",), before_stool((0.35, 0.25))),
        ObjectSpec("cake", ("cake",), Placement(object="cake_container"), graspable=True),
        *(
            ObjectSpec(
                name, ("sugar_cube",), before_stool((0.5, 0.15)), graspable=True, scale=(1.0, 1.0, 1.5), repeats=True
            )
            for name in _CUBES
        ),
    ),
    goal=AllOf(
        *_sweetened("sugar_cube_1").parts,
        *_sweetened("sugar_cube_2").parts,
        ObjectOn("cake", "cake_container"),
        ObjectTouches("cake_container", "dining_counter"),
    ),
    stages=tuple(
        Stage("pick_place", "place", "cake_container", object=name, until=_sweetened(name)) for name in _CUBES
    ),
    instruction="Put both sugar cubes on the plate with the cake.",
    paraphrases=(
        "The cake's plate should have the two sugar cubes on it as well.",
        "Garnish the plate of cake with both sugar cubes.",
        "Lay one sugar cube after the other beside the cake, on its plate.",
        "Two sugar cubes lie by the plate with the cake; they belong on it.",
    ),
)

TASKS = (ADD_LEMON_TO_FISH, ADD_SUGAR_CUBES, GARNISH_PANCAKE)
