"""Thaw frozen food."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectInside, StateIs
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
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

TASKS = (MICROWAVE_THAWING,)
