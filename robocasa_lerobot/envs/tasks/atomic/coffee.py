"""A mug at the coffee machine: put under its spout, and taken away."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectAtSite, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import MUG_ON_COUNTER, MUG_UNDER_SPOUT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FIXTURES = (FixtureSpec("coffee_machine", "coffee_machine"), counter_near("coffee_machine"))

TASKS = (
    Task(
        name="CoffeeSetupMug",
        summary="The mug stands under the spout, the gripper away.",
        fixtures=_FIXTURES,
        robot_start=RobotStart("coffee_machine"),
        objects=(
            ObjectSpec(
                "obj", ("mug",), on_counter("coffee_machine", (0.3, 0.4), rotation=MUG_ON_COUNTER), graspable=True
            ),
        ),
        goal=AllOf(ObjectAtSite("obj", "coffee_machine", "receptacle", across=0.04, high=0.10), GripperFar("obj")),
        stages=(Stage("pick_place", "place", "coffee_machine", object="obj", part="receptacle"),),
        instruction="Put the {obj} under the coffee machine's dispenser.",
        paraphrases=(
            "The {obj} should stand where the coffee comes out.",
            "Get the {obj} from the counter ready for coffee.",
            "Place the {obj} below the outlet of the coffee machine.",
            "Bring the {obj} to the coffee machine.",
        ),
    ),
    Task(
        name="CoffeeServeMug",
        summary="The mug stands on the counter, the gripper away.",
        fixtures=_FIXTURES,
        robot_start=RobotStart("coffee_machine"),
        objects=(
            ObjectSpec(
                "obj",
                ("mug",),
                Placement("coffee_machine", region=SampleRegion(name="cup"), rotation=MUG_UNDER_SPOUT),
                graspable=True,
            ),
        ),
        goal=AllOf(ObjectTouches("obj", "counter"), GripperFar("obj")),
        stages=(Stage("pick_place", "place", "counter", object="obj"),),
        instruction="Take the {obj} from under the coffee machine's dispenser and put it on the counter.",
        paraphrases=(
            "The coffee is ready: set the {obj} on the worktop.",
            "Bring the {obj} from the coffee machine to the counter.",
            "Serve the {obj} that stands under the outlet.",
            "Get the {obj} out of the coffee machine onto the counter.",
        ),
    ),
)
