"""Wash fruits and vegetables."""

import functools
from dataclasses import replace

from robocasa_lerobot.envs.objects.catalogue import pool
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    ForEach,
    Goal,
    GripperFar,
    Not,
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StateIs,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_UNDER = UnderWater("colander", "sink")


def _in_colander(name: str) -> Goal:
    return ObjectOn(name, "colander")


_LOADED = ForEach("fruit", _in_colander)
_WASHED = StepsWhile(AllOf(_UNDER, _LOADED), 25, label="fruit_washed")
_BELOW_SPOUT = ObjectAtSite("colander", "sink", "water", across=0.08, high=0.6)

WASH_FRUIT_COLANDER = Task(
    name="WashFruitColander",
    summary=(
        "The colander stands in the basin under running water with all the fruit, for 25 steps and in the end, "
        "the gripper away."
    ),
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "fruit",
            ("fruit",),
            on_counter("sink", (0.3, 0.3), loc="left_right"),
            count=(1, 3),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("colander", ("colander",), on_counter("sink", (0.4, 0.5), loc="left_right"), graspable=True),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(_UNDER, _LOADED, _WASHED, ObjectInBasin("colander", "sink"), GripperFar("colander")),
    stages=(
        Stage(
            "pick_place",
            "place",
            "sink",
            object="colander",
            until=AllOf(ObjectInBasin("colander", "sink"), _BELOW_SPOUT, GripperFar("colander")),
        ),
        EachStage(
            "fruit",
            lambda name: (
                Stage(
                    "pick_place", "place", "colander", object=name, until=AllOf(_in_colander(name), GripperFar(name))
                ),
            ),
        ),
        Stage("levers", "on", "sink", part="handle", until=_WASHED),
    ),
    instruction="Stand the colander in the sink, put {fruit} into it and run the water over it.",
    paraphrases=(
        "Wash {fruit} in the colander under the faucet of the sink.",
        "Put the colander below the faucet, fill it with {fruit}, and open the water.",
        "Rinse {fruit} from the counter: the colander goes into the basin, then the fruit; then turn on the water.",
        "With {fruit} in the colander and the colander in the sink, let water run over it all.",
    ),
)

_OFF = StateIs("sink", "water_on", value=False)
_PRODUCE = ("vegetable", "fruit")


def _in_basin(size: tuple[float, float]) -> Placement:
    """At the faucet's side."""
    return Placement("sink", size=size, pos=(None, 1.0))


def _washed(name: str) -> ObjectSpec:
    return ObjectSpec(name, _PRODUCE, _in_basin((0.5, 0.25)), graspable=True, properties=("washable",))


def _sorted_into(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("food1", first), ObjectOn("food2", first), ObjectOn("food3", second))


AFTERWASH_SORTING = Task(
    name="AfterwashSorting",
    summary="The two alike are in one bowl, the third thing is in the other, and no water runs.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        _washed("food1"),
        replace(_washed("food2"), same_category_as="food1", repeats=True),
        _washed("food3"),
        *(
            ObjectSpec(name, ("bowl",), on_counter("sink", (0.4, 0.55), loc="left_right"), repeats=True)
            for name in ("bowl1", "bowl2")
        ),
    ),
    initial=(Water("sink", on=True),),
    goal=AllOf(_OFF, AnyOf(_sorted_into("bowl1", "bowl2"), _sorted_into("bowl2", "bowl1"))),
    stages=(
        Stage("pick_place", "place", "bowl1", object="food1"),
        Stage("pick_place", "place", "bowl1", object="food2"),
        Stage("pick_place", "place", "bowl2", object="food3"),
        Stage("levers", "off", "sink", part="handle"),
    ),
    instruction="Put {food1+food2} from the sink into one bowl, the {food3} into the other, and turn off the faucet.",
    paraphrases=(
        "The washing is done: {food1+food2} into one bowl, the {food3} into the other bowl, then the water off.",
        "Sort what is in the sink by kind into the two bowls, and close the faucet.",
        "One bowl gets {food1+food2}, the other one the {food3}. Stop the water at the end.",
        "Take the produce out of the sink, each kind into a bowl of its own; no water should run after that.",
    ),
)


def _on_board(name: str) -> Goal:
    return ObjectOn(name, "cutting_board")


AIR_DRY_FRUIT = Task(
    name="AirDryFruit",
    summary="All the fruit lies on the cutting board, no water runs, the gripper is 15 cm away from each.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "fruit",
            ("fruit",),
            _in_basin((0.25, 0.25)),
            count=(1, 3),
            graspable=True,
            properties=("washable",),
            repeats=True,
        ),
        ObjectSpec("cutting_board", ("cutting_board",), on_counter("sink", (0.4, 0.5), loc="left_right")),
    ),
    initial=(Water("sink", on=True),),
    goal=AllOf(_OFF, ForEach("fruit", _on_board), ForEach("fruit", lambda name: GripperFar(name, 0.15))),
    stages=(
        EachStage("fruit", lambda name: (Stage("pick_place", "place", "cutting_board", object=name),)),
        Stage("levers", "off", "sink", part="handle"),
    ),
    instruction="Lay {fruit} from the sink on the cutting board and turn off the water.",
    paraphrases=(
        "Let {fruit} dry on the cutting board, and close the faucet.",
        "Take {fruit} out of the basin onto the board beside it; then stop the water.",
        "The fruit is washed: the board is where it dries. Turn the faucet off as well.",
        "Move {fruit} from the running water to the cutting board and shut the water off.",
    ),
)


CLEAR_SINK_SPACE = Task(
    name="ClearSinkSpace",
    summary="What was in the sink stands on the counter, the gripper away from it.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "obj",
            ("any",),
            _in_basin((0.4, 0.3)),
            count=(1, 2),
            graspable=True,
            properties=("washable",),
            max_size=(0.2, 0.2, 0.16),
            exclude=("food",),
        ),
        ObjectSpec(
            "food_item",
            ("fruit", "vegetable"),
            # Beside the sink: the strips before and behind it are the nearest, but no place for food.
            Placement(
                "counter",
                region=SampleRegion(ref="sink", loc="nn", top_size=(0.35, 0.35)),
                size=(0.35, 0.35),
                pos=("ref", 0.0),
            ),
            count=(2, 2),
            graspable=True,
            properties=("washable",),
        ),
    ),
    goal=AllOf(ForEach("obj", lambda name: ObjectTouches(name, "counter")), ForEach("obj", GripperFar)),
    stages=(EachStage("obj", lambda name: (Stage("pick_place", "place", "counter", object=name),)),),
    instruction="Make room for washing: put {obj} from the sink on the counter.",
    paraphrases=(
        "The sink should be empty; the counter takes {obj}.",
        "Clear the basin of {obj}, onto the counter.",
        "Before the food is washed, {obj} must be out of the sink.",
        "Take {obj} out of the sink and set everything down on the counter.",
    ),
)


@functools.cache
def _washable() -> tuple[str, ...]:
    return tuple(category.name for category in pool(("any",), properties=("washable",)))


def _inside(name: str) -> Goal:
    return ObjectInside(name, "sink")


def _on_tray(name: str) -> Goal:
    return ObjectOn(name, "receptacle")


_RINSED = StepsWhile(
    AllOf(
        ForEach("obj", _inside),
        ForEach("unwashable_obj", lambda name: Not(_inside(name))),
        StateIs("sink", "water_on"),
    ),
    11,
    consecutive=True,
    label="produce_washed",
)

CLEAR_CLUTTER = Task(
    name="ClearClutter",
    summary=(
        "The produce alone was in the sink with the water on for 11 steps on end and lies on the tray; no water runs."
    ),
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.6, 0.6))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "receptacle",
            ("tray",),
            on_counter("sink", (0.55, 0.4), loc="left_right", offset=(0.0, 0.1), rotation=(0.0, 0.0)),
        ),
        ObjectSpec(
            "obj",
            _PRODUCE,
            on_counter("sink", (0.4, 0.3), loc="left_right"),
            count=(1, 2),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec(
            "unwashable_obj",
            ("any",),
            on_counter("sink", (0.4, 0.3), loc="left_right"),
            count=(1, 2),
            exclude=("food", "tray", *_washable()),
        ),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(_RINSED, ForEach("obj", _on_tray), ForEach("unwashable_obj", lambda name: Not(_on_tray(name))), _OFF),
    stages=(
        EachStage(
            "obj",
            lambda name: (
                Stage("pick_place", "place", "sink", object=name, until=AllOf(_inside(name), GripperFar(name))),
            ),
        ),
        Stage("levers", "on", "sink", part="handle", until=_RINSED),
        Stage("levers", "off", "sink", part="handle"),
        EachStage("obj", lambda name: (Stage("pick_place", "place", "receptacle", object=name),)),
    ),
    instruction="Wash {obj} in the sink with the water on, turn the water off and put all of it on the tray.",
    paraphrases=(
        "Only {obj} must be washed in the sink; then turn off the faucet and use the tray for it.",
        "Put {obj} into the basin, run the water for a moment, shut it off, and move {obj} onto the tray.",
        "The tray should carry {obj}, washed in the sink, and nothing else; the faucet ends closed.",
        "Rinse {obj} in the basin. With the water off again, lay it on the tray.",
    ),
)

_IN_SINK = ObjectInside("obj", "sink")
_DRAINED = StepsWhile(AllOf(_IN_SINK, StateIs("sink", "water_on")), 11, consecutive=True, label="obj_washed")

DRAIN_VEGGIES = Task(
    name="DrainVeggies",
    summary="The vegetable was in the sink with the water on for 11 steps on end and is in the pot; no water runs.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.6, 0.6))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("obj_container", ("pot",), on_counter("sink", (0.4, 0.4), loc="left_right"), graspable=True),
        ObjectSpec("obj", ("vegetable",), Placement(object="obj_container"), graspable=True),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(_DRAINED, ObjectOn("obj", "obj_container"), _OFF),
    stages=(
        Stage("pick_place", "pour", "sink", object="obj_container", until=_IN_SINK, text="empty the pot into the sink"),
        Stage("levers", "on", "sink", part="handle", until=_DRAINED),
        Stage("levers", "off", "sink", part="handle"),
        Stage("pick_place", "place", "obj_container", object="obj"),
    ),
    instruction="Empty the pot with the {obj} into the sink, rinse the {obj} there and put it back into the pot.",
    paraphrases=(
        "Pour the {obj} out of the pot into the sink, turn the water on and off again, and return it to the pot.",
        "The {obj} in the pot must be drained and rinsed in the sink; afterwards it belongs in the pot again.",
        "Drain the {obj}: out of the pot, under the open faucet, and with the water off back into the pot.",
        "Let the {obj} drop from the pot into the basin, run some water, stop it, and refill the pot.",
    ),
)

TASKS = (DRAIN_VEGGIES, AFTERWASH_SORTING, AIR_DRY_FRUIT, CLEAR_CLUTTER, CLEAR_SINK_SPACE, WASH_FRUIT_COLANDER)
