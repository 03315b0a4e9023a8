"""Measure ingredients."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectOn, ObjectUpright
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FOOD = ("packaged_food",)
_WEIGHED = AllOf(ObjectOn("obj", "digital_scale"), ObjectUpright("obj"), GripperFar("obj"))

WEIGH_INGREDIENTS = Task(
    name="WeighIngredients",
    summary="The package stands upright on the scale, the cabinet is shut, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", _FOOD, in_cabinet("cabinet", (0.4, 0.2)), graspable=True),
        ObjectSpec("obj_distractor", _FOOD, in_cabinet("cabinet", (0.4, 0.2), pos=(0.0, 1.0)), graspable=True),
        ObjectSpec("digital_scale", ("digital_scale",), on_counter("cabinet", (0.3, 0.3))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_WEIGHED.parts, DoorsClosed("cabinet")),
    stages=(
        Stage("pick_place", "place", "digital_scale", object="obj", until=_WEIGHED),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the {obj} from the cabinet upright on the digital scale and close the cabinet.",
    paraphrases=(
        "Weigh the {obj}: it stands on the scale, and the cabinet is shut.",
        "Fetch the {obj} out of the cabinet, place it upright on the scale, then shut the {doors}.",
        "The {obj} in the cabinet should stand on the digital scale. Leave the cabinet closed.",
        "Get the {obj} onto the kitchen scale, the right way up, and close the {doors} of the cabinet.",
    ),
)

TASKS = (WEIGH_INGREDIENTS,)
