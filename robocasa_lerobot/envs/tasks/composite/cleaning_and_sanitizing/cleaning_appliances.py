"""Get appliances ready to be cleaned."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectInBasin,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnShelf,
)
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

CLEAN_BLENDER_JUG = Task(
    name="CleanBlenderJug",
    summary="The jug of the blender is in the sink, the gripper away from it.",
    fixtures=(FixtureSpec("counter", "counter"), FixtureSpec("sink", "sink")),
    robot_start=RobotStart("counter", at_object="blender_jug"),
    objects=(
        ObjectSpec(
            "blender_jug", ("blender_jug",), Placement("counter", size=(0.5, 0.25), pos=(0.0, -1.0)), graspable=True
        ),
    ),
    goal=AllOf(ObjectInBasin("blender_jug", "sink"), GripperFar("blender_jug")),
    stages=fetch("blender_jug", "counter", "sink"),
    instruction="Take the jug of the blender from the counter to the sink and put it in.",
    paraphrases=(
        "The blender's jug is dirty: carry it to the sink and put it inside.",
        "Pick up the jug on the counter, bring it over, and stand it in the basin.",
        "For washing, the jug of the blender must be in the sink.",
        "The jug on the counter belongs in the sink.",
    ),
)

_SHELVES_M = (1.0, 1.5)
_STORED = ("fruit", "vegetable", "meat")


def _stored(kind: str) -> ObjectSpec:
    region = SampleRegion(name="fridge_shelf", height=_SHELVES_M)
    start = Placement("fridge", region=region, size=(0.5, 0.2), pos=(0.0, -1.0))
    return ObjectSpec(kind, (kind,), start, graspable=True, properties=("fridgable",))


def _take_out(name: str) -> Stage:
    until = AllOf(ObjectTouchesAnyCounter(name), GripperFar(name))
    return Stage("pick_place", "place", "counter", object=name, until=until)


PREP_FRIDGE_FOR_CLEANING = Task(
    name="PrepFridgeForCleaning",
    summary="Fruit, vegetable and meat are on counters, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=tuple(map(_stored, _STORED)),
    goal=AllOf(*map(ObjectTouchesAnyCounter, _STORED), *map(GripperFar, _STORED)),
    stages=(Stage("doors", "open", "fridge", part="fridge"), *map(_take_out, _STORED)),
    instruction="Open the fridge and put the {fruit}, the {vegetable} and the {meat} from it on a counter.",
    paraphrases=(
        "The fridge is to be cleaned: take {fruit+vegetable+meat} out of it, onto a counter.",
        "Empty the closed fridge. On a counter there should be {fruit+vegetable+meat} afterwards.",
        "Get the {fruit}, then the {vegetable}, then the {meat} out of the fridge and set them down on the worktop.",
        "Nothing may stay in the fridge: {fruit+vegetable+meat} go to a counter.",
    ),
)

_PUT_AWAY = AllOf(ObjectTouches("cup", "cabinet"), GripperFar("cup"))

PREP_SINK_FOR_CLEANING = Task(
    name="PrepSinkForCleaning",
    summary="The bowl with the food is on a shelf of the fridge, the cup in the cabinet, the gripper away from both.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink"),
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("cabinet", "cabinet_with_door"),
    ),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("food_item_container", ("bowl",), on_counter("sink", (0.5, 0.4), loc="left_right"), graspable=True),
        ObjectSpec(
            "food_item", ("meat", "fruit", "vegetable"), Placement(object="food_item_container"), graspable=True
        ),
        ObjectSpec(
            "cup", ("cup", "mug", "glass_cup"), on_counter("sink", (0.75, 0.4), loc="left_right"), graspable=True
        ),
        ObjectSpec(
            "cleaner_distractor",
            ("cleaner",),
            on_counter("sink", (1.0, 0.4), loc="left_right", pos=(0.0, 1.0)),
            graspable=True,
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0), InitialOpenness("fridge", 0.9, 1.0, part="fridge")),
    goal=AllOf(OnShelf("food_item_container", "fridge"), *_PUT_AWAY.parts, GripperFar("food_item_container")),
    stages=(
        *fetch("cup", "counter", "cabinet", until=_PUT_AWAY),
        Stage("navigation", "drive", "food_item_container"),
        *fetch("food_item_container", "counter", "fridge", part="fridge_shelf:any"),
    ),
    instruction="Put the {cup} into the open cabinet, and the bowl with the {food_item} into the fridge.",
    paraphrases=(
        "The sink is to be cleaned: clear the {cup} into the cabinet and the bowl of food into the fridge.",
        "Beside the sink nothing but the cleaner may stay: cabinet for the {cup}, fridge for the bowl.",
        "Take the {cup} to the cabinet and the bowl that holds the {food_item} to a shelf of the fridge.",
        "Store the {cup} and the {food_item} in its bowl, the one in the cabinet, the other in the fridge.",
    ),
)

TASKS = (CLEAN_BLENDER_JUG, PREP_FRIDGE_FOR_CLEANING, PREP_SINK_FOR_CLEANING)
