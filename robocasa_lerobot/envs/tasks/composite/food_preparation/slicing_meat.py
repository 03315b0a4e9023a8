"""Slice meat."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FRONT = (0.0, -1.0)

SET_UP_CUTTING_STATION = Task(
    name="SetUpCuttingStation",
    summary="Knife and meat lie on the cutting board, the gripper away from knife and board.",
    fixtures=(FixtureSpec("counter", "counter"), FixtureSpec("drawer", "drawer_top", near="counter")),
    robot_start=RobotStart("drawer"),
    objects=(
        ObjectSpec("receptacle", ("cutting_board",), Placement("counter", size=(1.0, 0.5), pos=_FRONT)),
        ObjectSpec(
            "knife",
            ("knife",),
            Placement("drawer", size=(0.5, 0.35), pos=(None, -1.0), offset=(0.0, 0.1)),
            scale=(1.25, 1.25, 2.5),
        ),
        ObjectSpec(
            "meat",
            ("meat",),
            Placement("counter", size=(1.0, 0.4), pos=_FRONT, try_to_place_in="plate"),
            graspable=True,
        ),
    ),
    initial=(InitialOpenness("drawer", 0.9, 1.0),),
    goal=AllOf(
        ObjectOn("meat", "receptacle"), ObjectOn("knife", "receptacle"), GripperFar("knife"), GripperFar("receptacle")
    ),
    stages=(
        Stage("pick_place", "place", "receptacle", object="knife"),
        Stage("pick_place", "place", "receptacle", object="meat"),
    ),
    instruction="Bring the knife from the drawer to the cutting board, then the {meat} from its plate.",
    paraphrases=(
        "The {meat} is to be sliced: lay the drawer's knife and the {meat} on the cutting board.",
        "Knife out of the drawer, {meat} off the plate: both go on the cutting board.",
        "Get the board ready for slicing, with the knife first and the {meat} second.",
        "On the cutting board should lie the knife that is in the drawer and the {meat} that is on the plate.",
    ),
)

TASKS = (SET_UP_CUTTING_STATION,)
