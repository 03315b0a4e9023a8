"""Tidy cabinets and drawers."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, NearFixture, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BY_SINK = AllOf(
    ObjectTouches("cleaner", "counter"),
    NearFixture("cleaner", "sink", within=0.35, to_corner=True),
    GripperFar("cleaner"),
)

ORGANIZE_CLEANING_SUPPLIES = Task(
    name="OrganizeCleaningSupplies",
    summary="The cleaner stands on the counter, 35 cm from a corner of the sink at most, the cabinet is shut.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("cab", "cabinet", near="sink"), counter_near("sink")),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("cleaner", ("cleaner",), in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("distr_counter_1", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.3))),
        ObjectSpec("distr_counter_2", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right")),
    ),
    goal=AllOf(*_BY_SINK.parts, DoorsClosed("cab")),
    stages=(
        Stage("doors", "open", "cab"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="cleaner",
            until=_BY_SINK,
            text="put the {cleaner} on the counter beside the sink",
        ),
        Stage("doors", "close", "cab"),
    ),
    instruction="Take the {cleaner} out of the cabinet, stand it on the counter beside the sink and close the cabinet.",
    paraphrases=(
        "The {cleaner} belongs next to the sink; it is in the cabinet, which you leave shut.",
        "Open the cabinet for the {cleaner}, put that by the sink and shut the cabinet.",
        "Get ready to clean: the cabinet's {cleaner} stands right beside the sink, the cabinet is closed.",
        "Move the {cleaner} out of the cabinet to the side of the sink, and leave the cabinet as it was, closed.",
    ),
)

TASKS = (ORGANIZE_CLEANING_SUPPLIES,)
