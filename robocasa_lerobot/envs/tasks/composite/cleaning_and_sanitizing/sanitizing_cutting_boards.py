"""Clean cutting boards."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Strokes
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SCRUBBED = AllOf(Strokes("sponge", "cutting_board"), GripperFar("sponge", 0.15))

SCRUB_CUTTING_BOARD = Task(
    name="ScrubCuttingBoard",
    summary="The held sponge has rubbed the board at 5 places or more over 10 cm, and the gripper has let it go.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="sponge"),
    objects=(
        ObjectSpec(
            "cutting_board", ("cutting_board",), on_counter("sink", (0.5, 0.5), loc="left_right", rotation=(0.0, 0.0))
        ),
        ObjectSpec(
            "sponge",
            ("sponge",),
            Placement("counter", reuse_region_from="cutting_board", size=(0.3, 0.3), pos=(0.0, -1.0)),
            graspable=True,
        ),
    ),
    goal=_SCRUBBED,
    stages=(
        Stage("pick_place", "pick", "counter", object="sponge"),
        Stage(
            "pick_place",
            "wipe",
            "cutting_board",
            object="sponge",
            until=_SCRUBBED,
            text="scrub the cutting board with the sponge and let go of it",
        ),
    ),
    instruction="Pick up the sponge, rub the cutting board with it in several places and release the sponge.",
    paraphrases=(
        "Scrub the cutting board with the sponge from the counter, then let the sponge go.",
        "The cutting board is dirty: wipe it all along with the sponge, and leave the sponge.",
        "Clean the board with the sponge that lies on the counter.",
        "Use the sponge to scrub over the board, and put the sponge down when you are done.",
    ),
)

TASKS = (SCRUB_CUTTING_BOARD,)
