"""Serve drinks at the dining counter."""

from dataclasses import replace

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Beside,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
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


_PAIRS = {"wine_bottle": "wine_glass", "juice_bottle": "glass_cup"}


def _by_its_glass(bottle: str) -> AllOf:
    return AllOf(
        Near(bottle, _PAIRS[bottle], 0.25),
        ObjectTouches(bottle, "dining_counter"),
        ObjectUpright(bottle),
        GripperFar(bottle),
    )


def _to_its_glass(bottle: str) -> tuple[Stage, ...]:
    *carried, put = fetch(bottle, "counter", "dining_counter", until=_by_its_glass(bottle))
    text = f"put the {{{bottle}}} on the dining counter beside the {{{_PAIRS[bottle]}}}"
    return *carried, replace(put, text=text)


def _bottle(name: str, group: str, again: str = "") -> ObjectSpec:
    start = Placement("counter", size=(0.8, 0.2), pos=(0.0, -1.0), reuse_region_from=again)
    return ObjectSpec(name, (group,), start, graspable=True)


MATCH_CUP_AND_DRINK = Task(
    name="MatchCupAndDrink",
    summary="On the dining counter, the wine stands 25 cm from the wine glass at most, the juice so by the glass.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
        FixtureSpec("counter", "counter", other_than=("dining_counter",)),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("counter", at_object="wine_bottle"),
    objects=(
        ObjectSpec("wine_glass", ("wine_glass",), before_stool((0.25, 0.15), stool="stool1")),
        ObjectSpec("glass_cup", ("glass_cup",), before_stool((0.25, 0.15), stool="stool2")),
        _bottle("wine_bottle", "wine"),
        _bottle("juice_bottle", "juice", again="wine_bottle"),
    ),
    goal=AllOf(*(part for bottle in _PAIRS for part in _by_its_glass(bottle).parts)),
    stages=(
        *_to_its_glass("wine_bottle"),
        Stage("navigation", "drive", "juice_bottle"),
        *_to_its_glass("juice_bottle"),
    ),
    instruction="Stand the wine beside the wine glass and the juice beside the other glass on the dining counter.",
    paraphrases=(
        "Every drink goes to its glass: the wine next to the wine glass, the juice next to the tumbler.",
        "Carry the wine to the wine glass on the dining counter, then the juice to the other glass.",
        "Match drinks and glasses on the dining counter; both bottles come from the counter ahead.",
        "The juice belongs close to the plain glass and the wine close to the stemmed one.",
    ),
)

_SODAS = ("soda1", "soda2")


def _chilled(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "ice_bowl"), GripperFar(name, 0.15))


SETUP_SODA_BOWL = Task(
    name="SetupSodaBowl",
    summary="Both sodas are in the bowl with the ice on the dining counter, the gripper away.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("fridge", "fridge"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("ice_bowl", ("bowl",), before_stool((0.3, 0.3))),
        *(
            ObjectSpec(name, ("ice_cube",), Placement(object="ice_bowl", heaped=True), scale=0.5, repeats=True)
            for name in ("ice1", "ice2", "ice3")
        ),
        *(
            ObjectSpec(
                name,
                ("bottled_drink", "can"),
                on_shelf(level, (0.5, 0.2)),
                graspable=True,
                properties=("fridgable",),
                repeats=True,
            )
            for name, level in zip(_SODAS, ("highest", "second_highest"), strict=True)
        ),
    ),
    goal=AllOf(
        *(ObjectOn(name, "ice_bowl") for name in _SODAS),
        ObjectTouches("ice_bowl", "dining_counter"),
        *(GripperFar(name, 0.15) for name in (*_SODAS, "ice_bowl")),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch_in_turn(_SODAS, "fridge", "ice_bowl", until=_chilled),
    ),
    instruction="Put {soda1+soda2} from the fridge into the bowl of ice on the dining counter.",
    paraphrases=(
        "The sodas should stay cool: open the fridge and set both into the ice bowl on the dining counter.",
        "Bring {soda1+soda2} from the fridge to the dining counter, into the bowl with the ice cubes.",
        "Chill both drinks of the fridge in the bowl that holds ice.",
        "The bowl with ice on the dining counter is for the two drinks in the fridge.",
    ),
)


_CUPS, _MEALS = ("cup1", "cup2"), ("plate1", "plate2")


def _at_side(cup: str, plate: str) -> Beside:
    return Beside(cup, plate, plate.replace("plate", "stool"), across=0.25, along=0.15)


def _cup_served(cup: str) -> AllOf:
    plate = cup.replace("cup", "plate")
    return AllOf(_at_side(cup, plate), ObjectTouches(cup, "dining_counter"), GripperFar(cup))


SERVE_MEAL_JUICE = Task(
    name="ServeMealJuice",
    summary="Each plate on the dining counter has a cup of juice of its own beside it, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("counter", at_object="cup1"),
    objects=(
        *(
            ObjectSpec(
                plate, ("plate",), before_stool((0.35, 0.3), stool=plate.replace("plate", "stool")), repeats=True
            )
            for plate in _MEALS
        ),
        *(
            ObjectSpec(
                f"food_{plate}",
                ("cooked_food", "chicken_drumstick"),
                Placement(object=plate),
                exclude=("pizza",),
                repeats=True,
            )
            for plate in _MEALS
        ),
        ObjectSpec("cup1", ("cup",), on_counter("cabinet", (0.5, 0.2)), graspable=True, filled="orange_juice"),
        ObjectSpec(
            "cup2",
            ("cup",),
            on_counter("cabinet", (0.5, 0.2), pos=(0.0, -1.0), reuse_region_from="cup1"),
            graspable=True,
            filled="orange_juice",
            repeats=True,
        ),
    ),
    goal=AllOf(
        AnyOf(
            *(
                AllOf(*(_at_side(*pair) for pair in zip(_CUPS, plates, strict=True)))
                for plates in (_MEALS, _MEALS[::-1])
            )
        ),
        *(ObjectTouches(cup, "dining_counter") for cup in _CUPS),
        *map(GripperFar, _CUPS),
    ),
    stages=fetch_in_turn(_CUPS, "counter", "dining_counter", until=_cup_served, along=True),
    instruction="Carry both cups of juice to the dining counter, and set one beside each plate.",
    paraphrases=(
        "Every meal on the dining counter gets a cup of juice at its side; both cups are on the counter.",
        "Serve juice with the meals: a cup next to either plate.",
        "Bring one cup to the side of one plate and the other cup to the other plate.",
        "The two plates on the dining counter should each have a cup close by.",
    ),
)

TASKS = (
    DELIVER_STRAW,
    MATCH_CUP_AND_DRINK,
    PREPARE_COCKTAIL_STATION,
    PREPARE_DRINK_STATION,
    SERVE_MEAL_JUICE,
    SETUP_SODA_BOWL,
)
