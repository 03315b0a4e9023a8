"""Warm food up again."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    StateIs,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

WAFFLE_REHEAT = Task(
    name="WaffleReheat",
    summary="The waffle is in the bowl, the bowl in the microwave, shut and running, the gripper off its button.",
    fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave")),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec("waffle_container", ("bowl",), on_counter("microwave", (0.3, 0.3)), graspable=True),
        # It leans on the wall of a bowl that is narrower than itself.
        ObjectSpec("waffle", ("waffle",), Placement(object="waffle_container", ensure_inside=False)),
    ),
    goal=AllOf(
        ObjectOn("waffle", "waffle_container"),
        ObjectInside("waffle_container", "microwave"),
        StateIs("microwave", "on"),
        DoorsClosed("microwave"),
        GripperFarFromPart("microwave", "start_button"),
    ),
    stages=(
        Stage("doors", "open", "microwave"),
        Stage("pick_place", "place", "microwave", object="waffle_container"),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction="Open the microwave, put the bowl with the waffle in, close the door and press the start button.",
    paraphrases=(
        "Reheat the waffle in its bowl in the microwave.",
        "The waffle is cold: the bowl goes into the microwave, the door is shut, the microwave started.",
        "Warm up the waffle on the counter with the microwave.",
        "Let the microwave run with the bowl and its waffle behind the closed door.",
    ),
)

TASKS = (WAFFLE_REHEAT,)
