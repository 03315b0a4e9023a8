"""Put ice into drinks."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Exactly, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ICE = ("ice_cube1", "ice_cube2")
_AWAY_M = 0.15
_IN_GLASS_M = 0.06


def _in_glass(name: str) -> ObjectOn:
    return ObjectOn(name, "glass_cup", within=_IN_GLASS_M)


def _drop(name: str) -> Stage:
    until = AllOf(_in_glass(name), GripperFar(name, _AWAY_M))
    return Stage("pick_place", "place", "glass_cup", object=name, until=until)


def _cube(name: str) -> ObjectSpec:
    return ObjectSpec(name, ("ice_cube",), Placement(object="ice_bowl"), graspable=True, scale=0.9, repeats=True)


MAKE_ICE_LEMONADE = Task(
    name="MakeIceLemonade",
    summary="The lemon wedge and an ice cube are in the glass, 6 cm from its middle at most; the gripper away.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "lemon_wedge",
            ("lemon_wedge",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.25, 0.2),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement(
                "fridge", region=SampleRegion(name="fridge_shelf", height=(0.5, 1.5)), size=(0.3, 0.3), pos=(0.0, 1.0)
            ),
            properties=("fridgable",),
            exclude=("lemon_wedge", "bowl", "ice_cube", "glass_cup"),
        ),
        ObjectSpec("ice_bowl", ("bowl",), on_counter("fridge", (1.0, 0.4)), scale=(1.1, 1.1, 0.75)),
        *map(_cube, _ICE),
        ObjectSpec(
            "glass_cup",
            ("glass_cup",),
            on_counter("fridge", (0.5, 0.25)),
            scale=(1.25, 1.25, 1.0),
            filled="lemonade",
        ),
    ),
    goal=AllOf(
        _in_glass("lemon_wedge"),
        AnyOf(*map(_in_glass, _ICE)),
        *(GripperFar(name, _AWAY_M) for name in ("lemon_wedge", *_ICE)),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("pick_place", "pick", "fridge", object="lemon_wedge"),
        Stage("navigation", "drive", "glass_cup", object="lemon_wedge"),
        _drop("lemon_wedge"),
        _drop("ice_cube1"),
    ),
    instruction="Put the lemon wedge from the fridge and an ice cube from the bowl into the glass of lemonade.",
    paraphrases=(
        "Make an ice lemonade: a lemon wedge out of the fridge and an ice cube go into the glass.",
        "The lemonade lacks ice and lemon; the wedge is in the fridge, the ice in the bowl.",
        "Drop the fridge's lemon wedge into the lemonade, and an ice cube after it.",
        "Finish the lemonade on the counter with one ice cube and the wedge of lemon that is in the fridge.",
    ),
)


def _in_cup(name: str, cup: str, others: tuple[str, ...]) -> AnyOf:
    """Itself, or on another cube that is."""
    through = (AllOf(ObjectOn(other, cup, within=_IN_GLASS_M), ObjectTouches(name, other)) for other in others)
    return AnyOf(ObjectOn(name, cup, within=_IN_GLASS_M), *through)


def _both_in_cup(first: str, second: str, cup: str) -> AllOf:
    return AllOf(_in_cup(first, cup, (second,)), _in_cup(second, cup, (first,)))


def _drop_into(name: str, cup: str, others: tuple[str, ...]) -> Stage:
    until = AllOf(_in_cup(name, cup, others), GripperFar(name, _AWAY_M))
    return Stage("pick_place", "place", cup, object=name, until=until)


PLACE_ICE_IN_CUP = Task(
    name="PlaceIceInCup",
    summary="Both ice cubes are in the glass, 6 cm from its middle at most, or on each other there; the gripper away.",
    fixtures=(FixtureSpec("stool", "stool"), FixtureSpec("dining_counter", "dining_counter", near="stool")),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="ice_bowl"),
    objects=(
        ObjectSpec("ice_bowl", ("bowl",), before_stool((1.0, 0.4), pos=(0.0, -1.0)), scale=(1.1, 1.1, 0.75)),
        *(ObjectSpec(name, ("ice_cube",), Placement(object="ice_bowl"), graspable=True, repeats=True) for name in _ICE),
        ObjectSpec("glass_cup", ("glass_cup",), before_stool((0.25, 0.25)), scale=(1.35, 1.35, 1.2)),
        ObjectSpec("pitcher", ("pitcher",), before_stool((1.0, 0.5), pos=(0.0, -0.5))),
    ),
    goal=AllOf(_both_in_cup(*_ICE, "glass_cup"), *(GripperFar(name, _AWAY_M) for name in _ICE)),
    stages=(
        _drop_into("ice_cube1", "glass_cup", ("ice_cube2",)),
        _drop_into("ice_cube2", "glass_cup", ("ice_cube1",)),
    ),
    instruction="Put both ice cubes from the bowl into the glass.",
    paraphrases=(
        "The two ice cubes in the bowl belong in the glass.",
        "Drop one ice cube after the other into the glass.",
        "Ice the glass with the bowl's two cubes.",
        "Move the ice out of the bowl into the glass.",
    ),
)

_CUBES = ("ice_cube1", "ice_cube2", "ice_cube3", "ice_cube4")
_CUPS = ("glass_cup1", "glass_cup2")


def _others(name: str) -> tuple[str, ...]:
    return tuple(other for other in _CUBES if other != name)


PLACE_EQUAL_ICE_CUBES = Task(
    name="PlaceEqualIceCubes",
    summary="Each glass has exactly two of the ice cubes, the gripper away from all four.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="ice_bowl"),
    objects=(
        ObjectSpec(
            "ice_bowl", ("bowl",), before_stool((1.0, 0.4), stool="stool1", pos=(0.0, -1.0)), scale=(1.25, 1.25, 0.75)
        ),
        *map(_cube, _CUBES),
        *(
            ObjectSpec(
                f"glass_cup{number}",
                ("glass_cup",),
                before_stool((0.4, 0.25), stool=f"stool{number}"),
                scale=(1.3, 1.3, 1.0),
                repeats=True,
                filled="water",
            )
            for number in (1, 2)
        ),
    ),
    goal=AllOf(
        *(Exactly(2, *(_in_cup(name, cup, _others(name)) for name in _CUBES)) for cup in _CUPS),
        *(GripperFar(name, _AWAY_M) for name in _CUBES),
    ),
    stages=tuple(
        _drop_into(name, cup, _others(name))
        for cup, names in zip(_CUPS, (_CUBES[:2], _CUBES[2:]), strict=True)
        for name in names
    ),
    instruction="Put two of the four ice cubes in the bowl into one glass of water and two into the other.",
    paraphrases=(
        "Share the bowl's ice cubes equally between the two glasses.",
        "Either glass gets two ice cubes.",
        "Cool both glasses of water with the four ice cubes, the same number in each.",
        "Divide the ice: two cubes for each glass.",
    ),
)

_TURNED = (np.pi / 2, np.pi / 2)  # radians

RETRIEVE_ICE_TRAY = Task(
    name="RetrieveIceTray",
    summary="The ice cube tray is on the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("fridge", "fridge_with_freezer"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter", "freezer"),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "ice_cube_tray",
            ("ice_cube_tray",),
            on_shelf("highest", (0.25, 0.3), compartment="freezer", rotation=_TURNED),
            properties=("freezable",),
            scale=(1.0, 0.7, 1.0),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="freezer_shelf:second_highest")),
            properties=("fridgable", "freezable"),
            exclude=("ice_cube_tray",),
        ),
        ObjectSpec("glass_cup", ("glass_cup",), before_stool((0.15, 0.15))),
    ),
    goal=AllOf(ObjectTouches("ice_cube_tray", "dining_counter"), GripperFar("ice_cube_tray")),
    stages=(
        Stage("doors", "open", "fridge", part="freezer"),
        *fetch("ice_cube_tray", "fridge", "dining_counter"),
    ),
    instruction="Open the freezer, take the ice cube tray out and put it on the dining counter.",
    paraphrases=(
        "The dining counter needs the ice cube tray, which is in the closed freezer.",
        "Get ice for the glass: bring the tray from the freezer to the dining counter.",
        "Fetch the ice cube tray out of the freezer and set it down on the dining counter.",
        "From the freezer's top shelf to the dining counter: that is the way of the ice cube tray.",
    ),
)

TASKS = (MAKE_ICE_LEMONADE, PLACE_EQUAL_ICE_CUBES, PLACE_ICE_IN_CUP, RETRIEVE_ICE_TRAY)
