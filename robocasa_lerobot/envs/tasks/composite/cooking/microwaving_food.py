"""Heat food in the microwave."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    Goal,
    GripperFar,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StateIs,
    When,
)
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import both_together, fetch, together
from robocasa_lerobot.envs.tasks.task import Stage, Task

_MICROWAVE = FixtureSpec("microwave", "microwave")
_OPEN = InitialOpenness("microwave", 0.9, 1.0)
_ACROSS = (np.pi / 2, np.pi / 2)  # radians
_SHUT, _RUNS = DoorsClosed("microwave"), StateIs("microwave", "on")
_IN_MIDDLE = Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False)
_START = (
    Stage("doors", "close", "microwave"),
    Stage("buttons", "press", "microwave", part="start_button", until=_RUNS),
)


FILTER_MICROWAVABLE_ITEM = Task(
    name="FilterMicrowavableItem",
    summary=(
        "The fruit lies on the plate; the bowl with the meat is in the microwave, which is shut and runs, the gripper "
        "away from the bowl."
    ),
    fixtures=(_MICROWAVE, counter_near("microwave")),
    robot_start=RobotStart("counter", at_object="bowl"),
    objects=(
        ObjectSpec("bowl", ("bowl",), on_counter("microwave", (1.0, 0.3)), scale=(1.0, 1.0, 0.75)),
        ObjectSpec("meat", ("meat",), Placement(object="bowl"), graspable=True, properties=("microwavable",)),
        ObjectSpec("fruit", ("fruit",), Placement(object="bowl", heaped=True), graspable=True),
        ObjectSpec("plate", ("plate",), on_counter("microwave", (1.0, 0.5)), scale=(0.75, 0.75, 1.0)),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        ObjectInside("bowl", "microwave"),
        ObjectOn("meat", "bowl"),
        ObjectOn("fruit", "plate"),
        _SHUT,
        _RUNS,
        GripperFar("bowl"),
    ),
    stages=(
        Stage("pick_place", "place", "plate", object="fruit"),
        *fetch("bowl", "counter", "microwave"),
        *_START,
    ),
    instruction=(
        "Take the {fruit} out of the bowl and put it on the plate, then put the bowl with the {meat} into the "
        "microwave, shut the door and start it."
    ),
    paraphrases=(
        "Heat the {meat} in its bowl in the microwave, but without the {fruit}, which goes on the small plate.",
        "The {fruit} must not be heated: onto the plate with it, then microwave the bowl with the {meat}.",
        "First the {fruit} from the bowl to the plate; then the bowl into the microwave, door shut, start.",
        "Only the {meat} in the bowl should get warm in the microwave; lay the {fruit} on the plate before.",
    ),
)

_MEALS = ("0", "1")
_FOOD = ("vegetable", "meat", "cooked_food")


def _meal(number: str, start: Placement, *, repeats: bool = False) -> tuple[ObjectSpec, ...]:
    """A bowl and the two kinds of food in it."""
    inside = Placement(object=f"bowl{number}", heaped=True)
    food = (
        ObjectSpec(f"food{each}_bowl{number}", _FOOD, inside, graspable=True, properties=("microwavable",))
        for each in range(2)
    )
    return (ObjectSpec(f"bowl{number}", ("bowl",), start, repeats=repeats), *food)


def _in_bowl(food: str, other: str) -> Goal:
    return When(
        "target",
        {number: together(f"{food}_bowl{number}", f"{other}_bowl{number}", f"bowl{number}") for number in _MEALS},
    )


_MEAL_INSIDE = When("target", {number: ObjectInside(f"bowl{number}", "microwave") for number in _MEALS})
_MEAL_LEFT = When("target", {number: GripperFar(f"bowl{number}") for number in _MEALS})

MICROWAVE_CORRECT_MEAL = Task(
    name="MicrowaveCorrectMeal",
    summary=(
        "The bowl with the food that the instruction names is in the microwave with both kinds of it, the microwave is "
        "shut and runs, the gripper away from the bowl."
    ),
    fixtures=(_MICROWAVE, counter_near("microwave", size=(0.8, 0.5))),
    robot_start=RobotStart("counter", at_object="bowl0"),
    choices=(
        Choice(
            "target",
            {number: {"food_a": f"{{food0_bowl{number}}}", "food_b": f"{{food1_bowl{number}}}"} for number in _MEALS},
        ),
    ),
    objects=(
        *_meal("0", on_counter("microwave", (1.0, 0.3), pos=(0.0, -1.0))),
        *_meal("1", on_counter("microwave", (1.0, 0.3), pos=(0.0, -1.0), reuse_region_from="bowl0"), repeats=True),
    ),
    initial=(_OPEN,),
    goal=AllOf(_MEAL_INSIDE, _in_bowl("food0", "food1"), _in_bowl("food1", "food0"), _SHUT, _RUNS, _MEAL_LEFT),
    stages=(*fetch("bowl{target}", "counter", "microwave"), *_START),
    instruction=(
        "Put the bowl with the {food_a} and the {food_b} into the microwave, shut the door and start the microwave."
    ),
    paraphrases=(
        "Of the two meals, heat the one of {food_a} and {food_b} in the microwave.",
        "Warm up the {food_a} with the {food_b}: their bowl goes into the microwave, not the other one.",
        "The meal with {food_a} and {food_b} should be hot: microwave its bowl behind a closed door.",
        "Choose the bowl that holds {food_a} and {food_b}, shut it in the microwave and press start.",
    ),
)

MICROWAVE_DEFROST_MEAT = Task(
    name="MicrowaveDefrostMeat",
    summary="The meat is in its box, the box in the microwave, which is shut and runs, the gripper away from the box.",
    fixtures=(_MICROWAVE, FixtureSpec("fridge", "fridge_with_freezer")),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            Placement(
                "fridge",
                region=SampleRegion(name="freezer_shelf", height=(1.0, 1.5)),
                size=(0.3, 0.3),
                pos=(0.0, -1.0),
                rotation=_ACROSS,
            ),
            scale=(1.25, 1.25, 1.0),
        ),
        ObjectSpec("meat", ("meat",), Placement(object="tupperware"), properties=("microwavable",)),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"), _OPEN),
    goal=AllOf(
        ObjectInside("tupperware", "microwave"), ObjectOn("meat", "tupperware"), _SHUT, _RUNS, GripperFar("tupperware")
    ),
    stages=(*fetch("tupperware", "fridge", "microwave"), *_START),
    instruction=(
        "Carry the tupperware with the {meat} from the freezer to the microwave, put it in, shut the door and start it."
    ),
    paraphrases=(
        "Defrost the {meat} that is in the freezer, in its tupperware, with the microwave.",
        "The frozen {meat} should thaw in the microwave: take its tupperware there, close the door, press start.",
        "Get the tupperware of {meat} out of the open freezer and let the microwave run with it inside.",
        "From the freezer into the microwave with the tupperware, and switch that on with its door shut.",
    ),
)

_SAFE = ("cup", "mug", "glass_cup")
_UNSAFE = ("bottled_water", "bottled_drink", "liquor", "milk", "wine", "beer")

PLACE_MICROWAVE_SAFE_ITEM = Task(
    name="PlaceMicrowaveSafeItem",
    summary="What stands a microwave is in it, the other thing is not, and it is shut and runs.",
    fixtures=(_MICROWAVE, counter_near("microwave")),
    robot_start=RobotStart("counter", at_object="microwave_safe_item"),
    objects=(
        ObjectSpec("microwave_safe_item", _SAFE, on_counter("microwave", (0.3, 0.3)), graspable=True, filled="water"),
        ObjectSpec(
            "microwave_unsafe_item",
            _UNSAFE,
            on_counter("microwave", (0.3, 0.3), reuse_region_from="microwave_safe_item"),
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        ObjectInside("microwave_safe_item", "microwave"),
        Not(ObjectInside("microwave_unsafe_item", "microwave")),
        _SHUT,
        _RUNS,
    ),
    stages=(Stage("pick_place", "place", "microwave", object="microwave_safe_item"), *_START),
    instruction=(
        "Put the one of the two things on the counter that may be heated in a microwave into it, shut the door and "
        "start it."
    ),
    paraphrases=(
        "Of the two drinks, heat the one whose vessel a microwave does not harm.",
        "One vessel here is safe in a microwave: put it in, close the door and press start.",
        "Warm up the drink that stands in an open vessel in the microwave; leave the other one where it is.",
        "Find what may go into the microwave, close it in there and let the microwave run.",
    ),
)

REHEAT_MEAL = Task(
    name="ReheatMeal",
    summary=(
        "Meat and vegetable are in their box, the box in the microwave, which is shut and runs, the gripper away from "
        "the box."
    ),
    fixtures=(_MICROWAVE, FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.3, 0.35),
                pos=(0.0, -1.0),
                rotation=_ACROSS,
            ),
            scale=(1.5, 1.5, 1.0),
        ),
        ObjectSpec("meat", ("meat",), Placement(object="tupperware"), properties=("microwavable",)),
        ObjectSpec(
            "vegetable", ("vegetable",), Placement(object="tupperware", heaped=True), properties=("microwavable",)
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), _OPEN),
    goal=AllOf(
        ObjectInside("tupperware", "microwave"),
        *both_together("meat", "vegetable", "tupperware"),
        _SHUT,
        _RUNS,
        GripperFar("tupperware"),
    ),
    stages=(*fetch("tupperware", "fridge", "microwave"), *_START),
    instruction=(
        "Carry the tupperware with the {meat} and the {vegetable} from the fridge to the microwave, put it in, shut "
        "the door and start it."
    ),
    paraphrases=(
        "Reheat the leftovers, {meat} with {vegetable}: their tupperware goes from the fridge into the microwave.",
        "The cold meal in the open fridge should be warm; microwave its tupperware behind the closed door.",
        "Get the tupperware of {meat} and {vegetable} out of the fridge and let the microwave run with it.",
        "From the fridge into the microwave with the {meat} and the {vegetable}, in their tupperware. Start it.",
    ),
)

RETURN_HEATED_FOOD = Task(
    name="ReturnHeatedFood",
    summary="The bowl stands on the dining counter with meat and vegetable in it, the gripper away from it.",
    fixtures=(_MICROWAVE, FixtureSpec("dining_counter", "dining_counter")),
    needs=("dining_counter",),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec("bowl", ("bowl",), _IN_MIDDLE),
        ObjectSpec("meat", ("meat",), Placement(object="bowl")),
        ObjectSpec("vegetable", ("vegetable",), Placement(object="bowl", heaped=True)),
    ),
    goal=AllOf(
        ObjectTouches("bowl", "dining_counter"),
        *both_together("meat", "vegetable", "bowl"),
        GripperFar("bowl"),
    ),
    stages=(Stage("doors", "open", "microwave"), *fetch("bowl", "microwave", "dining_counter")),
    instruction=(
        "Open the microwave and carry the bowl with the {meat} and the {vegetable} from it to the dining counter."
    ),
    paraphrases=(
        "The food in the microwave is warm: serve its bowl on the dining counter, with all that is in it.",
        "Bring the bowl of {meat} and {vegetable} from the closed microwave to the dining counter, spill nothing.",
        "Fetch the heated bowl out of the microwave and stand it on the dining counter.",
        "The {meat} and the {vegetable} belong on the dining counter now, in the bowl that is in the microwave.",
    ),
)

TASKS = (
    FILTER_MICROWAVABLE_ITEM,
    MICROWAVE_CORRECT_MEAL,
    MICROWAVE_DEFROST_MEAT,
    PLACE_MICROWAVE_SAFE_ITEM,
    REHEAT_MEAL,
    RETURN_HEATED_FOOD,
)
