"""Thaw frozen food."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectInside, ObjectOn, StateIs
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

_BEFORE = SampleRegion(ref="microwave", loc="nn")

MICROWAVE_THAWING = Task(
    name="MicrowaveThawing",
    summary="The food is in the microwave, which is shut and runs, the gripper away.",
    fixtures=(FixtureSpec("microwave", "microwave"), FixtureSpec("counter", "counter", near="microwave")),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec(
            "obj",
            ("food",),
            Placement("counter", region=_BEFORE, size=(0.3, 0.3), pos=("ref", -1.0), try_to_place_in="plate"),
            graspable=True,
            properties=("microwavable", "freezable"),
        ),
        ObjectSpec(
            "container", ("plate",), Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False)
        ),
        ObjectSpec("distr_counter", ("any",), Placement("counter", region=_BEFORE, size=(0.5, 0.2), pos=("ref", 1.0))),
    ),
    goal=AllOf(
        ObjectInside("obj", "microwave"), DoorsClosed("microwave"), StateIs("microwave", "on"), GripperFar("obj")
    ),
    stages=(
        Stage("doors", "open", "microwave"),
        Stage(
            "pick_place",
            "place",
            "container",
            object="obj",
            until=AllOf(ObjectInside("obj", "microwave"), GripperFar("obj")),
            text="put the {obj} into the microwave",
        ),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction="Take the {obj} off the counter, put it into the microwave and start the microwave.",
    paraphrases=(
        "Thaw the {obj} that lies on the counter in the microwave.",
        "The {obj} is frozen: place it in the microwave, shut the door and press start.",
        "Open the microwave, lay the {obj} inside, close it and switch it on.",
        "Defrost the {obj} with the microwave.",
    ),
)

_FROSTED = ("meat", "vegetable")
_FRONT_OF_SHELF = Placement(
    "fridge", region=SampleRegion(name="fridge_shelf", height=(0.5, 1.5)), size=(0.3, 0.25), pos=(None, -1.0)
)

MOVE_TO_COUNTER = Task(
    name="MoveToCounter",
    summary="The food lies on the plate on the counter, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("frosted_food", _FROSTED, _FRONT_OF_SHELF, graspable=True),
        ObjectSpec("distractor_obj", ("any",), _FRONT_OF_SHELF, graspable=True, exclude=_FROSTED),
        ObjectSpec("plate", ("plate",), on_counter("fridge", (0.4, 0.4))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(ObjectOn("frosted_food", "plate"), GripperFar("frosted_food")),
    stages=fetch("frosted_food", "fridge", "plate"),
    instruction="Take the {frosted_food} out of the fridge and put it on the plate on the counter to defrost.",
    paraphrases=(
        "Let the {frosted_food} thaw on the counter's plate; it is in the open fridge.",
        "The {frosted_food} is to defrost: carry it from the fridge to the plate.",
        "The plate on the counter waits for the fridge's {frosted_food}.",
        "Move the {frosted_food} from the fridge to where it gets warmer, onto the plate.",
    ),
)

TASKS = (MICROWAVE_THAWING, MOVE_TO_COUNTER)
