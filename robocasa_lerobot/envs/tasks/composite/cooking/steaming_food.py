"""Steam food in the microwave."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

STEAM_IN_MICROWAVE = Task(
    name="SteamInMicrowave",
    summary="The vegetable is in the bowl, the bowl in the microwave, shut and running, the gripper off its button.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("microwave", "microwave"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.35, 0.4), loc="left_right"), graspable=True),
        ObjectSpec(
            "vegetable",
            ("vegetable",),
            Placement("sink", size=(0.3, 0.2), pos=(0.0, 1.0)),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("distr_counter_0", ("any",), on_counter("microwave", (0.5, 0.3), offset=(0.0, 0.3))),
        ObjectSpec("distr_counter_1", ("any",), on_counter("sink", (0.5, 0.5), loc="left_right")),
    ),
    initial=(Water("sink", on=False), InitialOpenness("microwave", 0.9, 1.0)),
    goal=AllOf(
        ObjectOn("vegetable", "bowl"),
        ObjectInside("bowl", "microwave"),
        DoorsClosed("microwave"),
        StateIs("microwave", "on"),
        GripperFarFromPart("microwave", "start_button"),
    ),
    stages=(
        Stage("pick_place", "place", "bowl", object="vegetable"),
        Stage("pick_place", "pick", "counter", object="bowl"),
        Stage("navigation", "drive", "microwave", object="bowl"),
        Stage("pick_place", "place", "microwave", object="bowl"),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction=(
        "Take the {vegetable} out of the sink into the bowl, carry the bowl to the microwave, put it in, shut the door "
        "and start it."
    ),
    paraphrases=(
        "Steam the {vegetable} from the sink: into the bowl with it, the bowl into the microwave, door shut, start.",
        "The washed {vegetable} goes into the bowl, and the bowl into the running microwave.",
        "Cook the {vegetable} that lies in the sink in the microwave, in the bowl.",
        "Fill the bowl with the {vegetable} out of the basin, then close it in the microwave and press start.",
    ),
)

TASKS = (STEAM_IN_MICROWAVE,)
