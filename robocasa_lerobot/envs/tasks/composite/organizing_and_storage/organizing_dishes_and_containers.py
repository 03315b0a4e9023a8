"""Keep dishes in order."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SIZE = (1.0, 0.6)  # metres

STACK_BOWLS_CABINET = Task(
    name="StackBowlsCabinet",
    summary="Both bowls are in the cabinet, the small one in the large one, the gripper away from both.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("bowl1", ("bowl",), on_counter("cabinet", _SIZE, pos=("ref", -0.8)), scale=0.7, graspable=True),
        ObjectSpec("bowl2", ("bowl",), on_counter("cabinet", _SIZE), scale=0.95, graspable=True, repeats=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectInside("bowl1", "cabinet"),
        ObjectInside("bowl2", "cabinet"),
        ObjectOn("bowl1", "bowl2"),
        GripperFar("bowl1"),
        GripperFar("bowl2"),
    ),
    stages=(
        Stage("pick_place", "place", "cabinet", object="bowl2", text="put the large bowl into the cabinet"),
        Stage("pick_place", "place", "bowl2", object="bowl1", text="put the small bowl into the large one"),
    ),
    instruction="Put the large bowl into the cabinet and the small bowl into the large one.",
    paraphrases=(
        "Stack both bowls in the cabinet, with the larger one below.",
        "Clear the bowls off the counter: the big one in the cabinet, the little one in it.",
        "The bowls belong in the open cabinet, one in the other.",
        "Nest the small bowl in the large bowl inside the cabinet.",
    ),
)

TASKS = (STACK_BOWLS_CABINET,)
