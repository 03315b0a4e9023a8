"""Prepare sandwiches."""

from dataclasses import replace

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    Near,
    NearFixture,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
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

_BOARD = "baguette_container"
_STRAIGHT, _UPWARDS = (0.0, 0.0), (np.pi / 2, np.pi / 2)  # radians


def _at_front(size: tuple[float, float], pos: tuple[float | None, float], **more: object) -> Placement:
    region = SampleRegion(top_size=(0.9, 0.6))
    return Placement("counter", region=region, size=size, pos=pos, **more)  # type: ignore[arg-type]


PREPARE_SAUSAGE_CHEESE = Task(
    name="PrepareSausageCheese",
    summary="Sausage and cheese lie on the cutting board with the baguette, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("counter", "counter", size=(0.9, 0.6))),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice(
            "sausage_shelf",
            {"highest": {"_cheese_shelf": "second_highest"}, "second_highest": {"_cheese_shelf": "highest"}},
        ),
    ),
    objects=(
        ObjectSpec("sausage", ("sausage",), on_shelf("{sausage_shelf}", (0.2, 0.25)), graspable=True),
        ObjectSpec("cheese", ("cheese",), on_shelf("{_cheese_shelf}", (0.15, 0.15)), graspable=True),
        ObjectSpec(
            "baguette",
            ("baguette",),
            _at_front((0.65, 0.55), (None, -1.0), rotation=_STRAIGHT, try_to_place_in="cutting_board"),
        ),
        ObjectSpec("knife", ("knife",), _at_front((0.35, 0.5), (0.3, -1.0), reuse_region_from="baguette")),
    ),
    goal=AllOf(ObjectOn("sausage", _BOARD), ObjectOn("cheese", _BOARD), GripperFar("sausage"), GripperFar("cheese")),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("sausage", "fridge", _BOARD),
        Stage("navigation", "drive", "fridge"),
        *fetch("cheese", "fridge", _BOARD),
    ),
    instruction="Put the sausage and the {cheese} from the fridge on the cutting board with the baguette.",
    paraphrases=(
        "Prepare a sandwich: sausage and {cheese} out of the fridge go onto the board, to the baguette.",
        "The baguette's cutting board lacks the sausage and the {cheese}, which are in the fridge.",
        "Open the fridge, and carry its sausage and its {cheese} to the cutting board.",
        "Lay sausage and {cheese} beside the baguette; you find both in the fridge.",
    ),
)

_BY_PLATE = AllOf(
    Near("condiment", "plate", 0.35), ObjectTouches("condiment", "dining_counter"), GripperFar("condiment")
)
*_CONDIMENT_CARRIED, _CONDIMENT_PUT = fetch("condiment", "cabinet", "dining_counter", until=_BY_PLATE)

HOT_DOG_SETUP = Task(
    name="HotDogSetup",
    summary=(
        "Bun and sausage are on the plate on the dining counter, the condiment is 35 cm from it at most, the gripper "
        "away from all four."
    ),
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("counter", at_object="hotdog_bun_container"),
    objects=(
        ObjectSpec(
            "hotdog_bun", ("hotdog_bun",), on_counter("cabinet", (0.45, 0.4), try_to_place_in="plate"), graspable=True
        ),
        ObjectSpec(
            "sausage",
            ("sausage",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.45, 0.2),
                pos=(0.0, -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "condiment",
            ("ketchup", "mustard", "condiment_bottle"),
            in_cabinet("cabinet", (0.5, 0.2), pos=(-0.3, -0.8)),
            graspable=True,
        ),
        ObjectSpec("plate", ("plate",), before_stool((0.4, 0.4)), scale=1.35),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectOn("hotdog_bun", "plate"),
        ObjectOn("sausage", "plate"),
        ObjectTouches("plate", "dining_counter"),
        *_BY_PLATE.parts,
        *map(GripperFar, ("hotdog_bun", "sausage", "plate")),
    ),
    stages=(
        *fetch("hotdog_bun", "counter", "plate"),
        Stage("navigation", "drive", "cabinet"),
        *_CONDIMENT_CARRIED,
        replace(_CONDIMENT_PUT, text="put the {condiment} on the dining counter beside the plate"),
        Stage("navigation", "drive", "fridge"),
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("sausage", "fridge", "plate"),
    ),
    instruction=(
        "Bring the hotdog bun from the counter and the sausage from the fridge to the plate on the dining counter, and "
        "the {condiment} from the cabinet beside it."
    ),
    paraphrases=(
        "Make a hot dog ready on the dining counter: bun and sausage on the plate, {condiment} next to it.",
        "The plate at the dining counter gets the bun, then the {condiment} by its side, then the fridge's sausage.",
        "Carry bun, {condiment} and sausage to the dining counter; all but the {condiment} go on the plate.",
        "Set a hot dog up: the bun from the counter, the {condiment} from the cabinet, the sausage from the fridge.",
    ),
)

_VEGETABLES = ("veg1", "veg2")


def _in_basin(name: str, x: float) -> ObjectSpec:
    return ObjectSpec(name, ("vegetable",), Placement("sink", size=(0.25, 0.15), pos=(x, 1.0)), graspable=True)


GATHER_VEGETABLES = Task(
    name="GatherVegetables",
    summary="Both vegetables lie on the cutting board, the gripper away from them.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        _in_basin("veg1", 1.0),
        _in_basin("veg2", -1.0),
        ObjectSpec(
            "cutting_board", ("cutting_board",), on_counter("sink", (0.4, 0.5), loc="left_right", rotation=_UPWARDS)
        ),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(*(ObjectOn(name, "cutting_board") for name in _VEGETABLES), *map(GripperFar, _VEGETABLES)),
    stages=tuple(Stage("pick_place", "place", "cutting_board", object=name) for name in _VEGETABLES),
    instruction="Take {veg1+veg2} out of the sink and put them on the cutting board.",
    paraphrases=(
        "For a sandwich, {veg1+veg2} go from the sink onto the cutting board.",
        "The cutting board on the counter should have both vegetables of the sink on it.",
        "Gather what lies in the basin, {veg1+veg2}, on the board.",
        "Lift the two vegetables out of the sink, one after the other, and lay them on the cutting board.",
    ),
)


_BOWL = "ingredient_bowl"
_SLICES = ("tomato_slice", "pickle_slice", "turkey_slice")
_STATION = (_BOWL, "baguette")


def _kept_in_bowl(name: str) -> AnyOf:
    """In the bowl, or on another slice that is."""
    others = (other for other in _SLICES if other != name)
    return AnyOf(
        ObjectOn(name, _BOWL), *(AllOf(ObjectTouches(name, other), ObjectOn(other, _BOWL)) for other in others)
    )


def _at_toaster_oven(name: str) -> AllOf:
    return AllOf(ObjectTouchesAnyCounter(name), NearFixture(name, "toaster_oven", 0.35), GripperFar(name))


PREPARE_SANDWICH_STATION = Task(
    name="PrepareSandwichStation",
    summary=(
        "The bowl with its slices and the baguette are on the counter, 35 cm from the toaster oven at most, the "
        "gripper away from both."
    ),
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("toaster_oven", "toaster_oven"),
        counter_near("toaster_oven"),
    ),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice(
            "bowl_shelf",
            {"highest": {"_other_shelf": "second_highest"}, "second_highest": {"_other_shelf": "highest"}},
        ),
    ),
    objects=(
        ObjectSpec(_BOWL, ("bowl",), on_shelf("{bowl_shelf}", (0.5, 0.3)), graspable=True),
        *(ObjectSpec(name, (name,), Placement(object=_BOWL, heaped=True)) for name in _SLICES),
        ObjectSpec(
            "baguette", ("baguette",), on_shelf("{_other_shelf}", (0.5, 0.27), rotation=(0.0, 0.0)), graspable=True
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        AllOf(*map(_kept_in_bowl, _SLICES)),
        AnyOf(*(ObjectOn(name, _BOWL) for name in _SLICES)),
        *(part for name in _STATION for part in _at_toaster_oven(name).parts),
    ),
    stages=fetch_in_turn(_STATION, "fridge", "counter", until=_at_toaster_oven),
    instruction="Bring the bowl with its slices and the baguette from the fridge to the counter by the toaster oven.",
    paraphrases=(
        "Sandwiches are made beside the toaster oven: baguette and filled bowl out of the fridge belong there.",
        "Carry the fridge's bowl without spilling it, then the baguette, to the side of the toaster oven.",
        "Set up for sandwiches: first the bowl of slices, then the baguette, next to the toaster oven.",
        "Close to the toaster oven there should be the baguette and the bowl that are in the open fridge.",
    ),
)

_WARM, _COLD = ("sausage", "bread"), ("tomato", "onion")


TOAST_HEATABLE_INGREDIENTS = Task(
    name="ToastHeatableIngredients",
    summary="Sausage and baguette are on the toaster oven's rack, the rest is on the plate, the gripper 15 cm away.",
    fixtures=(FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven")),
    robot_start=RobotStart("counter", at_object="plate"),
    choices=(Choice("rack", of="toaster_oven"),),
    objects=(
        ObjectSpec("plate", ("plate",), on_counter("toaster_oven", (0.75, 0.5), loc="left_right"), scale=1.5),
        # As long as the plate is wide.
        ObjectSpec("bread", ("baguette",), Placement(object="plate", ensure_inside=False), graspable=True),
        ObjectSpec("sausage", ("sausage",), Placement(object="plate", heaped=True), graspable=True),
        *(ObjectSpec(name, (name,), Placement(object="plate", heaped=True)) for name in _COLD),
    ),
    goal=AllOf(
        *map(_on_rack, _WARM),
        *(ObjectOn(name, "plate") for name in _COLD),
        *(GripperFar(name, 0.15) for name in (*_WARM, *_COLD, "plate")),
    ),
    stages=(
        Stage("doors", "open", "toaster_oven"),
        Stage("racks", "pull", "toaster_oven", part="{rack}"),
        *(
            Stage(
                "pick_place",
                "place",
                "toaster_oven",
                object=name,
                part="{rack}",
                until=AllOf(_on_rack(name), GripperFar(name, 0.15)),
            )
            for name in _WARM
        ),
    ),
    instruction=(
        "Open the toaster oven, pull out its {rack} and put the sausage and the baguette on it; tomato and onion stay "
        "on the plate."
    ),
    paraphrases=(
        "Only what is eaten hot goes on the toaster oven's {rack}: the sausage and the baguette.",
        "Load the {rack} of the closed toaster oven with sausage and baguette, and leave the rest on the plate.",
        "From the plate, move baguette and sausage to the {rack} of the toaster oven.",
        "Tomato and onion are served cold; put the other two things on the {rack} of the toaster oven.",
    ),
)

TASKS = (
    GATHER_VEGETABLES,
    HEAT_KEBAB_SANDWICH,
    HOT_DOG_SETUP,
    PREPARE_SANDWICH_STATION,
    PREPARE_SAUSAGE_CHEESE,
    TOAST_HEATABLE_INGREDIENTS,
)
