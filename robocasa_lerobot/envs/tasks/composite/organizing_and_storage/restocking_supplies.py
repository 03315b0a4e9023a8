"""Restock cabinets."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, ObjectInside
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BELOW = Placement(
    "counter", region=SampleRegion(ref="cabinet", top_size=(0.5, 0.4)), size=(0.75, 0.5), pos=(0.0, -1.0)
)

RESTOCK_BOWLS = Task(
    name="RestockBowls",
    summary="Both bowls are in the cabinet, which is shut.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_double_door"),
        FixtureSpec("counter", "counter", near="cabinet", size=(0.5, 0.4)),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj1", ("bowl",), _BELOW, graspable=True),
        ObjectSpec("obj2", ("bowl",), _BELOW, graspable=True, repeats=True),
    ),
    goal=AllOf(ObjectInside("obj1", "cabinet"), ObjectInside("obj2", "cabinet"), DoorsClosed("cabinet")),
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "cabinet", object="obj1"),
        Stage("pick_place", "place", "cabinet", object="obj2"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Open the cabinet, move both bowls from the counter into it and close it.",
    paraphrases=(
        "Both bowls belong in the cabinet; leave it shut.",
        "Clear the two bowls off the worktop into the cabinet and close its doors.",
        "Restock the cabinet with the bowls from the counter, then shut the doors.",
        "Put the bowls on the counter away behind the doors of the cabinet.",
    ),
)

TASKS = (RESTOCK_BOWLS,)
