"""Serve drinks at the dining counter."""

from dataclasses import replace

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_GLASS = AllOf(ObjectOn("straw", "glass_cup", within=0.06), GripperFar("straw"))

DELIVER_STRAW = Task(
    name="DeliverStraw",
    summary="The straw stands in the glass: it touches it, 6 cm from its middle at most; the gripper away.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("drawer", "drawer_top"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("drawer"),
    objects=(
        ObjectSpec(
            "straw",
            ("straw",),
            Placement("drawer", size=(0.3, 0.2), pos=(0.0, -0.25)),
            graspable=True,
            scale=(1.5, 1.0, 2.0),
        ),
        ObjectSpec(
            "glass_cup",
            ("glass_cup",),
            before_stool((0.25, 0.15)),
        ),
    ),
    goal=_IN_GLASS,
    stages=(
        Stage("drawers", "open", "drawer"),
        Stage("pick_place", "pick", "drawer", object="straw"),
        Stage("navigation", "drive", "glass_cup", object="straw"),
        Stage("pick_place", "place", "glass_cup", object="straw", until=_IN_GLASS),
    ),
    instruction="Take the straw out of the drawer and put it into the glass on the dining counter.",
    paraphrases=(
        "Bring a straw from the drawer to the glass at the dining counter.",
        "The glass on the dining counter lacks its straw, which is in the drawer.",
        "Open the drawer, pick up the straw and stand it in the dining counter's glass.",
        "Serve the drink with a straw: get it from the drawer and slip it into the glass.",
    ),
)

_BESIDE_M = 0.35


def _beside_bowl(name: str) -> AllOf:
    return AllOf(ObjectTouches(name, "dining_counter"), Near(name, "bowl", _BESIDE_M), GripperFar(name))


def _from_cabinet(name: str) -> tuple[Stage, ...]:
    *taken, put = fetch(name, "cabinet", "dining_counter", until=_beside_bowl(name))
    return (
        Stage("navigation", "drive", "cabinet"),
        *taken,
        replace(put, text=f"put the {{{name}}} on the dining counter beside the bowl"),
    )


PREPARE_COCKTAIL_STATION = Task(
    name="PrepareCocktailStation",
    summary=(
        "The lemon wedge is in the bowl, liquor and glass stand on the dining counter, 35 cm from the bowl at most, "
        "the gripper away."
    ),
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("cabinet", "cabinet"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("bowl", ("bowl",), before_stool((0.5, 0.3))),
        ObjectSpec(
            "lemon_wedge", ("lemon_wedge",), on_shelf("highest", (0.2, 0.15)), graspable=True, properties=("fridgable",)
        ),
        ObjectSpec("liquor", ("liquor",), in_cabinet("cabinet", (1.0, 0.2)), graspable=True),
        ObjectSpec("glass_cup", ("glass_cup",), in_cabinet("cabinet", (1.0, 0.2)), graspable=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectOn("lemon_wedge", "bowl"),
        GripperFar("lemon_wedge"),
        *_beside_bowl("liquor").parts,
        *_beside_bowl("glass_cup").parts,
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("lemon_wedge", "fridge", "bowl"),
        *_from_cabinet("liquor"),
        *_from_cabinet("glass_cup"),
    ),
    instruction=(
        "Put the lemon wedge from the fridge into the bowl on the dining counter, and the {liquor} and the "
        "{glass_cup} from the cabinet beside it."
    ),
    paraphrases=(
        "Prepare for cocktails: lemon wedge into the dining counter's bowl, {liquor} and {glass_cup} next to that.",
        "The bowl on the dining counter gets the lemon wedge, and {liquor} and {glass_cup} as neighbours.",
        "Fetch the lemon wedge out of the fridge for the bowl, then {liquor} and {glass_cup} from the cabinet.",
        "Around the bowl there should be the {liquor} and the {glass_cup}, and in it the lemon wedge.",
    ),
)

_ACROSS = (np.pi / 2, np.pi / 2)  # radians
_BY_TRAY = AllOf(Near("pitcher", "tray", 0.3), GripperFar("pitcher"))
*_CARRIED, _PUT = fetch("pitcher", "counter", "dining_counter", until=_BY_TRAY)

PREPARE_DRINK_STATION = Task(
    name="PrepareDrinkStation",
    summary="Cup and mug are on the tray, the pitcher is 30 cm from its middle at most, the gripper away from each.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("cabinet", "cabinet_double_door"),
        counter_near("cabinet"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("tray", ("tray",), before_stool((1.0, 0.35), pos=(0.0, -1.0), rotation=_ACROSS), scale=1.2),
        ObjectSpec("cup", ("cup",), in_cabinet("cabinet", (1.0, 0.2)), graspable=True),
        ObjectSpec("mug", ("mug",), in_cabinet("cabinet", (1.0, 0.2)), graspable=True),
        ObjectSpec("pitcher", ("pitcher",), on_counter("cabinet", (1.0, 0.3), pos=(0.0, -1.0)), graspable=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(ObjectOn("cup", "tray"), ObjectOn("mug", "tray"), *_BY_TRAY.parts, GripperFar("cup"), GripperFar("mug")),
    stages=(
        *fetch("cup", "cabinet", "tray"),
        Stage("navigation", "drive", "cabinet"),
        *fetch("mug", "cabinet", "tray"),
        Stage("navigation", "drive", "counter"),
        *_CARRIED,
        replace(_PUT, text="put the pitcher on the dining counter beside the tray"),
    ),
    instruction=(
        "Bring the cup and the mug from the cabinet to the tray on the dining counter, and the pitcher from the "
        "counter to the tray too, or right beside it."
    ),
    paraphrases=(
        "Prepare the drinks' tray on the dining counter: cup and mug on it, the pitcher on it or next to it.",
        "The dining counter's tray needs the cabinet's cup and mug, and the pitcher by its side.",
        "Carry cup, mug and pitcher to the tray at the dining counter, one after the other.",
        "Cup and mug from the cabinet go onto the tray, and the pitcher stands close to it.",
    ),
)

TASKS = (DELIVER_STRAW, PREPARE_COCKTAIL_STATION, PREPARE_DRINK_STATION)
