"""Garnish dishes at the dining counter."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Exactly, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import in_cabinet
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
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.3, 0.3), pos=(0.0, 1.0)),
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
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.3, 0.3), pos=(0.0, 1.0)),
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


_CHERRIES, _STRAWBERRIES = ("cherry1", "cherry2"), ("strawberry1", "strawberry2")


def _on_cake_or_plate(name: str) -> AnyOf:
    return AnyOf(ObjectOn(name, "cake"), ObjectOn(name, "cake_plate"))


GARNISH_CAKE = Task(
    name="GarnishCake",
    summary="One cherry is on the cake or its plate, one strawberry on that plate, the gripper away from it.",
    fixtures=(FixtureSpec("stool", "stool"), FixtureSpec("dining_counter", "dining_counter", near="stool")),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="fruit_plate"),
    objects=(
        ObjectSpec("cake_plate", ("plate",), before_stool((0.35, 0.35)), scale=1.2),
        ObjectSpec("fruit_plate", ("plate",), before_stool((1.0, 0.35), pos=(0.0, "ref")), repeats=True),
        ObjectSpec("cake", ("cake",), Placement(object="cake_plate"), graspable=True, scale=1.4),
        *(
            ObjectSpec(
                name,
                (name.rstrip("12"),),
                Placement(object="fruit_plate", heaped=name == "strawberry2"),
                graspable=True,
                repeats=True,
            )
            for name in (*_CHERRIES, *_STRAWBERRIES)
        ),
    ),
    goal=AllOf(
        Exactly(1, *map(_on_cake_or_plate, _CHERRIES)),
        Exactly(1, *(ObjectOn(name, "cake_plate") for name in _STRAWBERRIES)),
        ObjectTouches("cake_plate", "dining_counter"),
        GripperFar("cake_plate"),
    ),
    stages=(
        Stage(
            "pick_place",
            "place",
            "cake_plate",
            object="cherry1",
            until=AllOf(_on_cake_or_plate("cherry1"), GripperFar("cake_plate")),
        ),
        Stage("pick_place", "place", "cake_plate", object="strawberry1"),
    ),
    instruction="Put one of the cherries on the cake or on its plate, and one of the strawberries on that plate.",
    paraphrases=(
        "Garnish the cake with one cherry, on it or beside it, and one strawberry beside it.",
        "The cake's plate should get a single strawberry and a single cherry from the plate of fruit.",
        "One cherry and one strawberry go to the cake; the other two fruits stay where they are.",
        "From the plate of fruit, take a cherry and a strawberry over to the cake.",
    ),
)

_BY_CUPCAKE = AllOf(
    Near("cinnamon", "cupcake_container", 0.3), ObjectTouches("cinnamon", "dining_counter"), GripperFar("cinnamon")
)
*_CINNAMON_CARRIED, _CINNAMON_PUT = fetch("cinnamon", "cabinet", "dining_counter", until=_BY_CUPCAKE)

GARNISH_CUPCAKE = Task(
    name="GarnishCupcake",
    summary=(
        "Chocolate and cupcake are on the plate on the dining counter, the cinnamon is 30 cm from it at most, the "
        "gripper away from both."
    ),
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("cinnamon", ("cinnamon",), in_cabinet("cabinet", (1.0, 0.2)), graspable=True),
        ObjectSpec(
            "distr_cabinet",
            ("cup", "mug", "bowl"),
            in_cabinet("cabinet", (1.0, 0.3), pos=(0.0, 1.0)),
            graspable=True,
        ),
        ObjectSpec("cupcake_container", ("plate",), before_stool((0.35, 0.35))),
        ObjectSpec("cupcake", ("cupcake",), Placement(object="cupcake_container"), graspable=True),
        ObjectSpec("chocolate", ("chocolate",), before_stool((1.0, 0.3), pos=("ref", -1.0)), scale=(0.8, 0.8, 1.8)),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        *_BY_CUPCAKE.parts,
        *(ObjectOn(name, "cupcake_container") for name in ("chocolate", "cupcake")),
        ObjectTouches("cupcake_container", "dining_counter"),
        GripperFar("chocolate"),
    ),
    stages=(
        *_CINNAMON_CARRIED,
        replace(_CINNAMON_PUT, text="put the cinnamon on the dining counter beside the plate"),
        Stage("pick_place", "place", "cupcake_container", object="chocolate"),
    ),
    instruction=(
        "Stand the cinnamon from the cabinet beside the cupcake's plate on the dining counter, and put the chocolate "
        "on that plate."
    ),
    paraphrases=(
        "Garnish the cupcake: chocolate onto its plate, and the cabinet's cinnamon next to the plate.",
        "Bring the cinnamon to the dining counter, close to the cupcake, and lay the chocolate beside the cupcake.",
        "By the plate with the cupcake there should be cinnamon, and on it the chocolate.",
        "Carry the cinnamon over to the cupcake, then add the dining counter's chocolate to its plate.",
    ),
)

TASKS = (ADD_LEMON_TO_FISH, ADD_SUGAR_CUBES, GARNISH_CAKE, GARNISH_CUPCAKE, GARNISH_PANCAKE)
