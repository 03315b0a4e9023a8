"""Prepare meat."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BESIDE_M = 0.3
_BESIDE = AllOf(
    ObjectTouches("condiment", "counter"), Near("condiment", "cutting_board", _BESIDE_M), GripperFar("condiment")
)

PREP_MARINATING_MEAT = Task(
    name="PrepMarinatingMeat",
    summary=(
        "The meat lies on the cutting board on the counter, the condiment stands there 30 cm from the board at most, "
        "the gripper away."
    ),
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab", size=(0.6, 0.6))),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("cutting_board", ("cutting_board",), on_counter("cab", (1.0, 0.5))),
        ObjectSpec("meat", ("meat",), on_counter("cab", (0.3, 0.3), try_to_place_in="plate"), graspable=True),
        ObjectSpec("condiment", ("condiment_bottle",), in_cabinet("cab", (0.5, 0.1)), graspable=True),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cab", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(
        ObjectOn("meat", "cutting_board"),
        ObjectTouches("cutting_board", "counter"),
        *_BESIDE.parts,
        GripperFar("meat"),
    ),
    stages=(
        Stage("pick_place", "place", "cutting_board", object="meat"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="condiment",
            until=_BESIDE,
            text="put the {condiment} on the counter beside the cutting board",
        ),
    ),
    instruction="Put the {meat} from the plate on the cutting board and the {condiment} from the cabinet beside it.",
    paraphrases=(
        "Get ready to marinate: the {meat} onto the cutting board, the {condiment} next to that.",
        "The cutting board should have the {meat} on it and the cabinet's {condiment} by its side.",
        "Move the {meat} from its plate to the board, then stand the {condiment} near the board.",
        "Lay the {meat} on the board and take the {condiment} out of the cabinet to it.",
    ),
)

_MEAT_BOARD = "meat_container"

PREP_FOR_TENDERIZING = Task(
    name="PrepForTenderizing",
    summary="The rolling pin lies on the cutting board with the meat, the gripper away from the board.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab", size=(0.9, 0.6))),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec(
            "meat",
            ("meat",),
            on_counter("cab", (1.0, 0.5), pos=(0.0, -1.0), try_to_place_in="cutting_board"),
            graspable=True,
        ),
        ObjectSpec("rolling_pin", ("rolling_pin",), in_cabinet("cab", (1.0, 0.4)), graspable=True),
    ),
    goal=AllOf(ObjectOn("rolling_pin", _MEAT_BOARD), ObjectOn("meat", _MEAT_BOARD), GripperFar(_MEAT_BOARD)),
    stages=(
        Stage("doors", "open", "cab"),
        Stage("pick_place", "place", _MEAT_BOARD, object="rolling_pin"),
    ),
    instruction="Open the cabinet and put its rolling pin on the cutting board with the {meat}.",
    paraphrases=(
        "The {meat} on the board is to be tenderized: fetch the rolling pin from the cabinet to it.",
        "The rolling pin in the closed cabinet belongs on the cutting board, beside the {meat}.",
        "Lay the cabinet's rolling pin on the board where the {meat} is.",
        "Take out the rolling pin and leave it with the {meat} on the cutting board.",
    ),
)

TASKS = (PREP_FOR_TENDERIZING, PREP_MARINATING_MEAT)
