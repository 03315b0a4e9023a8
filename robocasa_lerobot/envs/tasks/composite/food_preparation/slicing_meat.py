"""Slice meat."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.composite.common import fetch
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

_SHELF = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
_LEFT = (-0.6, -0.5)

RETRIEVE_MEAT = Task(
    name="RetrieveMeat",
    summary="The meat lies on the cutting board, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("counter", "counter", near="fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "meat",
            ("meat",),
            Placement("fridge", region=_SHELF, size=(0.5, 0.25), pos=_FRONT, try_to_place_in="plate"),
            graspable=True,
        ),
        ObjectSpec(
            "dist_obj",
            ("vegetable",),
            Placement("fridge", region=_SHELF, size=(0.5, 0.25), pos=_FRONT),
            graspable=True,
        ),
        ObjectSpec("receptacle", ("cutting_board",), Placement("counter", size=(1.0, 0.4), pos=_LEFT)),
        ObjectSpec("knife", ("knife",), Placement("counter", size=(0.3, 0.3), pos=_LEFT)),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(ObjectOn("meat", "receptacle"), GripperFar("meat")),
    stages=fetch("meat", "fridge", "receptacle"),
    instruction="Take the {meat} out of the fridge and put it on the cutting board.",
    paraphrases=(
        "The {meat} in the fridge is to be sliced: bring it to the cutting board.",
        "Carry the {meat} from its plate in the open fridge to the cutting board on the counter.",
        "The cutting board should have the fridge's {meat} on it.",
        "Fetch the {meat} for slicing and lay it on the board.",
    ),
)

TASKS = (RETRIEVE_MEAT, SET_UP_CUTTING_STATION)
