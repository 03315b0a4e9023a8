"""Plate food."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, DoorsClosed, GripperFar, ObjectInside, ObjectOn
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

_PANS = Placement(
    "stove",
    region=SampleRegion(name="any", height=(0.7, 1.2)),
    size=(0.2, 0.2),
    rotation=HANDLE_TO_FRONT,
    ensure_inside=False,
)
_STEAKS = ("meat1", "meat2")


def _plated_and_stored(plated: str, stored: str) -> AllOf:
    return AllOf(ObjectOn(plated, "plate"), ObjectOn(stored, "bowl"), ObjectInside(stored, "fridge"))


PLATE_STORE_DINNER = Task(
    name="PlateStoreDinner",
    summary="One steak lies on the plate, the other in the bowl, which stands on a shelf of the shut fridge.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec("meat1_container", ("pan",), _PANS),
        ObjectSpec("meat1", ("steak",), Placement(object="meat1_container"), graspable=True),
        ObjectSpec("meat2_container", ("pan",), _PANS, repeats=True),
        ObjectSpec("meat2", ("steak",), Placement(object="meat2_container"), graspable=True, repeats=True),
        ObjectSpec("plate", ("plate",), on_counter("stove", (0.6, 0.45), loc="left_right")),
        ObjectSpec("bowl", ("bowl",), on_counter("stove", (0.6, 0.45), loc="left_right"), graspable=True),
    ),
    goal=AllOf(
        AnyOf(_plated_and_stored(*_STEAKS), _plated_and_stored(*reversed(_STEAKS))),
        ObjectInside("bowl", "fridge", region="fridge_shelf", lower=0.9),
        DoorsClosed("fridge"),
        *map(GripperFar, _STEAKS),
    ),
    stages=(
        _onto_plate("meat1"),
        Stage("pick_place", "place", "bowl", object="meat2"),
        Stage("navigation", "drive", "fridge"),
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("navigation", "drive", "bowl"),
        Stage("pick_place", "pick", "counter", object="bowl"),
        Stage("navigation", "drive", "fridge", object="bowl"),
        Stage("pick_place", "place", "fridge", object="bowl", part="fridge_shelf"),
        Stage("doors", "close_large", "fridge", part="fridge"),
    ),
    instruction=(
        "Put one of the two steaks from the stove on the plate and the other one into the bowl, and store the bowl in "
        "the fridge, which is shut afterwards."
    ),
    paraphrases=(
        "A steak for now on the plate, a steak for later in the bowl: that goes into the fridge. Shut it.",
        "The bowl with one steak belongs behind the closed {fridge_doors}, the plate gets the other.",
        "Share the two pans' steaks between plate and bowl, and keep the bowl on a shelf of the closed fridge.",
        "Plate one steak; fill the bowl with the second, carry it to the fridge and close that again.",
    ),
)

TASKS = (BALANCED_MEAL_PREP, PLATE_STEAK_MEAL, PLATE_STORE_DINNER)
