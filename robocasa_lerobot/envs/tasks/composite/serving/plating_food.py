"""Plate food."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)  # radians


def _onto_plate(name: str) -> Stage:
    return Stage("pick_place", "place", "plate", object=name)


BALANCED_MEAL_PREP = Task(
    name="BalancedMealPrep",
    summary="Meat and vegetable lie on the plate, the gripper away from both.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.3, 0.4))),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "meat_container",
            ("pan",),
            Placement(
                "stove",
                region=SampleRegion(name="any", height=(0.7, 1.2)),
                size=(0.1, 0.1),
                rotation=HANDLE_TO_FRONT,
                ensure_inside=False,
            ),
        ),
        ObjectSpec("meat", ("meat",), Placement(object="meat_container"), graspable=True, properties=("cookable",)),
        ObjectSpec("plate", ("plate",), on_counter("stove", (0.8, 0.4), loc="left_right")),
        ObjectSpec("vegetable_container", ("bowl",), on_counter("stove", (0.8, 0.4), loc="left_right")),
        ObjectSpec("vegetable", ("vegetable",), Placement(object="vegetable_container"), graspable=True),
    ),
    goal=AllOf(ObjectOn("meat", "plate"), ObjectOn("vegetable", "plate"), GripperFar("meat"), GripperFar("vegetable")),
    stages=(_onto_plate("meat"), _onto_plate("vegetable")),
    instruction="Put the {meat} from the pan and the {vegetable} from the bowl on the plate.",
    paraphrases=(
        "A balanced meal has meat and vegetables: {meat} and {vegetable} go on one plate.",
        "Fill the plate with the pan's {meat} and the bowl's {vegetable}.",
        "Take the {meat} out of the pan and the {vegetable} out of the bowl, and lay both on the plate.",
        "Serve the {meat} that is on the stove together with the {vegetable} on the plate.",
    ),
)


def _on_tray(name: str, groups: tuple[str, ...], exclude: tuple[str, ...] = ()) -> ObjectSpec:
    return ObjectSpec(name, groups, Placement(object="tray"), graspable=True, exclude=exclude)


PLATE_STEAK_MEAL = Task(
    name="PlateSteakMeal",
    summary="Steak and asparagus lie on the plate, the other food on the tray, the gripper away from all three.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("dining_counter", at_object="tray"),
    objects=(
        ObjectSpec("plate", ("plate",), before_stool((0.35, 0.3), stool="stool1")),
        ObjectSpec(
            "tray",
            ("tray",),
            before_stool((1.0, 0.4), stool="stool2", pos=("ref", -1.0), rotation=_ACROSS),
            scale=1.25,
        ),
        _on_tray("steak", ("steak",)),
        _on_tray("asparagus", ("asparagus",)),
        _on_tray("random_food", ("fruit", "vegetable", "cooked_food"), exclude=("steak", "asparagus")),
    ),
    goal=AllOf(
        ObjectOn("steak", "plate"),
        ObjectOn("asparagus", "plate"),
        ObjectOn("random_food", "tray"),
        *map(GripperFar, ("steak", "asparagus", "random_food")),
    ),
    stages=(_onto_plate("steak"), _onto_plate("asparagus")),
    instruction="Put the steak and the asparagus from the tray on the plate; the {random_food} stays on the tray.",
    paraphrases=(
        "Of what lies on the tray, steak and asparagus belong on the plate, and the {random_food} does not.",
        "Make a meal of steak with asparagus on the plate, without the tray's {random_food}.",
        "Move the asparagus and the steak to the plate, and leave the {random_food} on its tray.",
        "The plate gets steak and asparagus; nothing else leaves the tray.",
    ),
)

TASKS = (BALANCED_MEAL_PREP, PLATE_STEAK_MEAL)
