"""Slice meat."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet
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


def _in_sink(name: str) -> AllOf:
    return AllOf(ObjectInside(name, "sink"), GripperFar(name))


CLEAN_BOARD = Task(
    name="CleanBoard",
    summary="Cutting board and knife are in the sink, the spray is on the counter, the gripper away from all three.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        counter_near("fridge"),
        FixtureSpec("cabinet", "cabinet", near="counter"),
        FixtureSpec("sink", "sink", near="counter"),
    ),
    robot_start=RobotStart("counter", at_object="receptacle"),
    objects=(
        ObjectSpec("spray", ("spray",), in_cabinet("cabinet", (0.3, 0.3), pos=_LEFT), graspable=True),
        # Flat things are made higher, so that they can be held.
        ObjectSpec(
            "receptacle",
            ("cutting_board",),
            Placement("counter", size=(1.0, 0.5), pos=_FRONT),
            scale=(1.0, 1.0, 1.5),
        ),
        ObjectSpec("knife", ("knife",), Placement("counter", size=(0.5, 0.5), pos=_FRONT), scale=(1.5, 1.5, 2.0)),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        *_in_sink("knife").parts,
        *_in_sink("receptacle").parts,
        ObjectTouches("spray", "counter"),
        GripperFar("spray"),
    ),
    stages=(
        Stage("pick_place", "pick", "counter", object="receptacle"),
        Stage("navigation", "drive", "sink", object="receptacle"),
        Stage("pick_place", "place", "sink", object="receptacle", until=_in_sink("receptacle")),
        Stage("navigation", "drive", "knife"),
        Stage("pick_place", "place", "sink", object="knife", until=_in_sink("knife")),
        Stage("navigation", "drive", "cabinet"),
        Stage("pick_place", "place", "counter", object="spray"),
    ),
    instruction=(
        "Put the cutting board and the knife from the counter into the sink, and the spray from the cabinet on the "
        "counter."
    ),
    paraphrases=(
        "After slicing, board and knife go into the sink; take the spray out of the cabinet for the counter.",
        "The meat is cut: move cutting board, then knife, to the sink, and get the cabinet's spray onto the counter.",
        "Clean up: cutting board in the sink, knife in the sink, spray bottle on the counter.",
        "The sink takes the dirty board and the dirty knife. What stands on the counter in the end is the spray.",
    ),
)

TASKS = (CLEAN_BOARD, RETRIEVE_MEAT, SET_UP_CUTTING_STATION)
