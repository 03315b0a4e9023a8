"""Arrange a buffet on the dining counter."""

from dataclasses import replace

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, GripperFar, Near, Not, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_AWAY_M = 0.15
_ACROSS = (np.pi / 2, np.pi / 2)  # radians
_ALONG = (0.0, 0.0)  # of our trays, which are longer along another axis than the original's
_ANYWHERE = Placement("dining_counter")


def _sweet(name: str, level: str, x: float) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("sweets",),
        on_shelf(level, (0.3, 0.2), (x, -1.0)),
        graspable=True,
        properties=("fridgable",),
        exclude=("marshmallow", "sugar_cube", "cookie_dough_ball"),
    )


def _full_tray(name: str, group: str, exclude: str, rotation: tuple[float, float]) -> tuple[ObjectSpec, ObjectSpec]:
    return (
        ObjectSpec(f"{name}_container", ("tray",), _ANYWHERE, repeats=True),
        ObjectSpec(name, (group,), Placement(object=f"{name}_container", rotation=rotation), exclude=(exclude,)),
    )


def _served(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "tray"), GripperFar(name, _AWAY_M))


ARRANGE_BUFFET_DESSERT = Task(
    name="ArrangeBuffetDessert",
    summary="Both sweets lie on the tray on the dining counter, the gripper 15 cm away from them and from it.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge"),
    objects=(
        _sweet("sweet1", "highest", -0.3),
        _sweet("sweet2", "second_highest", 0.3),
        ObjectSpec("tray", ("tray",), before_stool((0.4, 0.4), pos=(0.0, -1.0), rotation=_ALONG)),
        *_full_tray("distractor_cooked_food", "cooked_food", "pizza", _ACROSS),
        *_full_tray("distractor_bread_food", "bread_food", "sweets", Placement().rotation),
        ObjectSpec("distractor_glass_cup", ("glass_cup",), _ANYWHERE, graspable=True),
        ObjectSpec(
            "distractor_glass_cup_2",
            ("glass_cup",),
            Placement("dining_counter", reuse_region_from="distractor_glass_cup"),
            graspable=True,
            repeats=True,
        ),
    ),
    goal=AllOf(
        ObjectOn("sweet1", "tray"),
        ObjectOn("sweet2", "tray"),
        ObjectTouches("tray", "dining_counter"),
        *(GripperFar(name, _AWAY_M) for name in ("sweet1", "sweet2", "tray")),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("sweet1", "fridge", "tray", until=_served("sweet1")),
        Stage("navigation", "drive", "fridge"),
        *fetch("sweet2", "fridge", "tray", until=_served("sweet2")),
    ),
    instruction="Bring the {sweet1} and the {sweet2} from the fridge to the empty tray on the dining counter.",
    paraphrases=(
        "Arrange the buffet's dessert: the fridge's {sweet1} and {sweet2} belong on the empty tray.",
        "The tray without food on the dining counter should get the {sweet1} and the {sweet2} out of the fridge.",
        "Open the fridge and lay its {sweet1} and its {sweet2} on the tray that nothing lies on.",
        "Fill the dining counter's empty tray with the {sweet1} and the {sweet2} that are in the fridge.",
    ),
)


def _aside(name: str, groups: tuple[str, ...], again: str = "", **more: object) -> ObjectSpec:
    """Something else, anywhere on the dining counter."""
    start = replace(_ANYWHERE, reuse_region_from=again, **more)  # type: ignore[arg-type]
    return ObjectSpec(name, groups, start, repeats=True)


_STRAIGHT, _ROUND = (0.0, 0.0), (np.pi, np.pi)  # radians
_IN_DRAWER = Placement("drawer", size=(0.3, 0.5), pos=(0.0, 0.0))

CUT_BUFFET_PIZZA = Task(
    name="CutBuffetPizza",
    summary="The pizza cutter lies on the dining counter, as the pizza does, the gripper 15 cm away from both.",
    fixtures=(
        FixtureSpec("dining_counter", "dining_counter"),
        FixtureSpec("drawer", "drawer_top", near="dining_counter"),
    ),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec("pizza_cutter", ("pizza_cutter",), _IN_DRAWER, graspable=True, scale=(1.0, 1.0, 1.5)),
        ObjectSpec("pizza", ("pizza",), Placement("dining_counter", size=(0.5, 0.5), pos=(0.0, 0.0))),
        _aside("distractor_utensil", ("spoon", "fork"), rotation=_STRAIGHT),
        _aside("distractor_utensil_2", ("spoon", "fork"), "distractor_utensil", rotation=_STRAIGHT),
        _aside("distractor_bread_food_container", ("tray",)),
        ObjectSpec("distractor_bread_food", ("bread_food",), Placement(object="distractor_bread_food_container")),
        _aside("distractor_mug", ("mug",)),
        _aside("distractor_mug_2", ("mug",), "distractor_mug"),
    ),
    goal=AllOf(
        ObjectTouches("pizza_cutter", "dining_counter"),
        ObjectTouches("pizza", "dining_counter"),
        GripperFar("pizza_cutter", _AWAY_M),
        GripperFar("pizza", _AWAY_M),
    ),
    stages=(
        Stage("drawers", "open", "drawer"),
        Stage(
            "pick_place",
            "place",
            "dining_counter",
            object="pizza_cutter",
            until=AllOf(ObjectTouches("pizza_cutter", "dining_counter"), GripperFar("pizza_cutter", _AWAY_M)),
        ),
    ),
    instruction="Open the drawer to your {side}, take out the pizza cutter and lay it on the dining counter's top.",
    paraphrases=(
        "The pizza on the dining counter has to be cut: bring the cutter out of the drawer on the {side} to it.",
        "Fetch the pizza cutter from the closed drawer to the {side} and put it on the dining counter.",
        "Pull the {side} drawer open and carry the pizza cutter to the dining counter.",
        "The dining counter should have the pizza cutter that lies in the drawer to your {side}.",
    ),
)

_BESIDE_TRAY = AllOf(
    ObjectTouches("tongs", "dining_counter"), Near("tongs", "food_container", 0.5), GripperFar("tongs", _AWAY_M)
)

TONG_BUFFET_SETUP = Task(
    name="TongBuffetSetup",
    summary="The tongs lie on the dining counter, 50 cm from the tray of food at most, the gripper 15 cm away.",
    fixtures=(
        FixtureSpec("drawer", "drawer_top"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec("tongs", ("tongs",), _IN_DRAWER, graspable=True, scale=(1.0, 1.0, 2.5)),
        ObjectSpec("food_container", ("tray",), before_stool((0.5, 0.4), pos=(0.0, -1.0), rotation=_ALONG)),
        ObjectSpec("food", ("cooked_food",), Placement(object="food_container", rotation=_ACROSS), graspable=True),
        ObjectSpec("distractor_spoon", ("spoon",), before_stool(None, pos=(None, None), rotation=_ROUND)),
        ObjectSpec(
            "distractor_fork",
            ("fork",),
            before_stool(None, pos=(None, None), rotation=_ROUND, reuse_region_from="distractor_spoon"),
        ),
        _aside("distractor_glass_cup", ("glass_cup",)),
        _aside("distractor_glass_cup_2", ("glass_cup",), "distractor_glass_cup"),
    ),
    goal=AllOf(
        *_BESIDE_TRAY.parts,
        ObjectTouches("food_container", "dining_counter"),
        GripperFar("food_container", _AWAY_M),
    ),
    stages=(
        Stage("drawers", "open", "drawer"),
        *fetch("tongs", "drawer", "dining_counter", until=_BESIDE_TRAY),
    ),
    instruction="Open the drawer to the {side} and lay its tongs on the dining counter, by the tray with the {food}.",
    paraphrases=(
        "Guests need tongs for the {food}: there are some in the closed drawer to the {side}; put them by the tray.",
        "Take the tongs out of the drawer to your {side} and lay them near the tray on the dining counter.",
        "The tray with the {food} should have tongs next to it.",
        "Set the buffet up with the drawer's tongs, close to the tray of food.",
    ),
)

_DRINKS = ("alcohol", "juice", "bottled_water")


def _others(name: str) -> tuple[str, ...]:
    return tuple(other for other in _DRINKS if other != name)


def _grouped(name: str) -> AllOf:
    """With one of those that were put there before it."""
    before = _DRINKS[: _DRINKS.index(name)]
    near = (Near(name, before, 0.25),) if before else ()
    return AllOf(ObjectTouches(name, "dining_counter"), *near, GripperFar(name, _AWAY_M))


PLACE_BEVERAGES_TOGETHER = Task(
    name="PlaceBeveragesTogether",
    summary=(
        "All three drinks stand on the dining counter, each 25 cm from another one at most, the gripper 15 cm away."
    ),
    fixtures=(
        FixtureSpec("dining_counter", "dining_counter"),
        FixtureSpec("counter", "counter", other_than=("dining_counter",)),
        FixtureSpec("stool", "stool"),
    ),
    robot_start=RobotStart("counter", at_object="juice"),
    objects=(
        *(
            ObjectSpec(
                name,
                (name,),
                Placement(
                    "counter",
                    size=(1.0, 0.3),
                    pos=(x, -1.0),
                    reuse_region_from="" if name == "alcohol" else "alcohol",
                ),
                graspable=True,
            )
            for name, x in zip(_DRINKS, (-0.5, 0.0, 0.5), strict=True)
        ),
        _aside("distractor_tong_container", ("tray",)),
        ObjectSpec(
            "distractor_tong",
            ("tongs",),
            Placement(object="distractor_tong_container", rotation=_ACROSS),
        ),
        _aside("distractor_cup", ("cup",)),
        _aside("distractor_cup_2", ("cup",), "distractor_cup"),
    ),
    goal=AllOf(
        *(ObjectTouches(name, "dining_counter") for name in _DRINKS),
        AllOf(*(Near(name, _others(name), 0.25) for name in _DRINKS)),
        *(GripperFar(name, _AWAY_M) for name in _DRINKS),
    ),
    stages=fetch_in_turn(_DRINKS, "counter", "dining_counter", until=_grouped, along=True),
    instruction="Bring the {alcohol}, the juice and the water to the dining counter and stand them close together.",
    paraphrases=(
        "All drinks of this counter belong in one group on the dining counter.",
        "Carry {alcohol}, juice and water to the dining counter, and keep them together there.",
        "The dining counter needs a place for drinks: put the {alcohol}, the juice and the water side by side.",
        "Move the three drinks to the dining counter, each next to another one.",
    ),
)

_KINDS = {"vegetable": ("vegetable1", "vegetable2"), "meat": ("meat1", "meat2")}
_TRAYS = ("tray1_container", "tray2_container")


def _to_share(name: str, x: float) -> ObjectSpec:
    kind = name.rstrip("12")
    meat = kind == "meat"
    return ObjectSpec(
        name,
        (kind,),
        on_shelf("{meat_shelf}" if meat else "{_vegetable_shelf}", (0.5, 0.2), (x, -1.0)),
        graspable=True,
        properties=("fridgable",),
        exclude=("shrimp",) if meat else (),
        scale=(1.0, 1.0, 1.5) if meat else 1.0,
        repeats=True,
    )


def _divided(meat_tray: str, vegetable_tray: str) -> AllOf:
    trays = {"meat": (meat_tray, vegetable_tray), "vegetable": (vegetable_tray, meat_tray)}
    return AllOf(
        *(ObjectOn(name, trays[kind][0]) for kind, names in _KINDS.items() for name in names),
        *(Not(ObjectOn(name, trays[kind][1])) for kind, names in _KINDS.items() for name in names),
    )


def _to_tray(kind: str, tray: str) -> tuple[Stage, ...]:
    return fetch_in_turn(
        _KINDS[kind], "fridge", tray, until=lambda name: AllOf(ObjectOn(name, tray), GripperFar(name), GripperFar(tray))
    )


DIVIDE_BUFFET_TRAYS = Task(
    name="DivideBuffetTrays",
    summary="Meat is on one tray, vegetables are on the other and nothing is mixed, the gripper away from all.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice(
            "meat_shelf",
            {
                "highest": {"_vegetable_shelf": "second_highest"},
                "second_highest": {"_vegetable_shelf": "highest"},
            },
        ),
    ),
    objects=(
        *(_to_share(names[number], x) for names in _KINDS.values() for number, x in ((0, -0.25), (1, 0.25))),
        *(
            ObjectSpec(
                tray,
                ("tray",),
                before_stool((0.6, 0.4), stool=f"stool{number}", rotation=_ALONG),
                repeats=True,
            )
            for number, tray in enumerate(_TRAYS, start=1)
        ),
        *(
            ObjectSpec(f"tray{number}", ("tongs",), Placement(object=_TRAYS[number - 1]), repeats=True)
            for number in (1, 2)
        ),
        _aside("distractor_cup", ("cup",)),
        _aside("distractor_cup_2", ("cup",), "distractor_cup"),
    ),
    goal=AllOf(
        AnyOf(_divided(*_TRAYS), _divided(*_TRAYS[::-1])),
        *(GripperFar(name) for names in _KINDS.values() for name in names),
        *map(GripperFar, _TRAYS),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *_to_tray("vegetable", "tray2_container"),
        Stage("navigation", "drive", "fridge"),
        *_to_tray("meat", "tray1_container"),
    ),
    instruction=(
        "Bring {vegetable1} and {vegetable2} from the fridge to one tray on the dining counter, {meat1} and {meat2} "
        "to the other tray."
    ),
    paraphrases=(
        "The buffet has a tray for vegetables and one for meat: fill them with what is in the fridge.",
        "Open the fridge and divide its food between the trays on the dining counter, meat here, vegetables there.",
        "Both vegetables go on one tray, both pieces of meat on the other; all four are in the fridge.",
        "Keep {meat1} and {meat2} on one tray and {vegetable1} and {vegetable2} on the other.",
    ),
)

TASKS = (ARRANGE_BUFFET_DESSERT, CUT_BUFFET_PIZZA, DIVIDE_BUFFET_TRAYS, PLACE_BEVERAGES_TOGETHER, TONG_BUFFET_SETUP)
