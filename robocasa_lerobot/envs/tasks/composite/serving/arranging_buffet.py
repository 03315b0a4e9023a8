"""Arrange a buffet on the dining counter."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_AWAY_M = 0.15
_ACROSS = (np.pi / 2, np.pi / 2)  # radians
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
        ObjectSpec("tray", ("tray",), before_stool((0.4, 0.4), pos=(0.0, -1.0), rotation=_ACROSS)),
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

TASKS = (ARRANGE_BUFFET_DESSERT,)
