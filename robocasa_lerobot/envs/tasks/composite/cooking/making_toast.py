"""Make toast."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)  # radians
_FRONT = (np.inf, 0.6)  # metres: the whole width of the counter

BREAD_SELECTION = Task(
    name="BreadSelection",
    summary="The croissant and the jam are on the cutting board, the gripper away from the croissant.",
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet", size=(0.9, 0.6))),
    robot_start=RobotStart("counter", at_object="cutting_board"),
    objects=(
        ObjectSpec("cutting_board", ("cutting_board",), on_counter("cabinet", _FRONT, rotation=_ACROSS)),
        ObjectSpec("distr_pastry", ("baguette", "cupcake"), on_counter("cabinet", _FRONT, try_to_place_in="plate")),
        ObjectSpec("croissant", ("croissant",), on_counter("cabinet", _FRONT, try_to_place_in="plate"), graspable=True),
        ObjectSpec("jam", ("jam",), in_cabinet("cabinet", (np.inf, 0.2)), graspable=True),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (np.inf, 0.2), pos=("ref", 1.0))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(ObjectOn("croissant", "cutting_board"), ObjectOn("jam", "cutting_board"), GripperFar("croissant")),
    stages=(
        Stage("pick_place", "place", "cutting_board", object="croissant"),
        Stage("pick_place", "place", "cutting_board", object="jam"),
    ),
    instruction="Move the croissant from its plate to the cutting board, and the jam from the cabinet next to it.",
    paraphrases=(
        "Of the pastries, the croissant goes on the cutting board, together with the jam out of the cabinet.",
        "Get breakfast ready: croissant and jam on the cutting board.",
        "Lay the croissant on the board and fetch the jam from the cabinet to it.",
        "The croissant and the jam belong on the cutting board.",
    ),
)

PREPARE_TOAST = Task(
    name="PrepareToast",
    summary="The bread lies on the cutting board on the counter, the jam is there too, the cabinet is shut.",
    fixtures=(
        FixtureSpec("toaster", "toaster"),
        FixtureSpec("cabinet", "cabinet", near="toaster"),
        counter_near("cabinet"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", ("bread",), in_cabinet("cabinet", (0.5, 0.3), pos=(0.0, -0.1)), graspable=True),
        ObjectSpec("container", ("cutting_board",), on_counter("cabinet", (0.6, 0.5))),
        ObjectSpec("obj2", ("jam",), in_cabinet("cabinet", (0.3, 0.15), offset=(-0.05, 0.0)), graspable=True),
        ObjectSpec("obj3", ("knife",), on_counter("cabinet", (0.3, 0.3), pos=("ref", 0.0), offset=(-0.05, 0.05))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectTouches("obj2", "counter"),
        GripperFar("obj"),
        ObjectOn("obj", "container"),
        ObjectTouches("container", "counter"),
        DoorsClosed("cabinet"),
    ),
    stages=(
        Stage("pick_place", "place", "container", object="obj"),
        Stage("pick_place", "place", "counter", object="obj2"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the {obj} from the cabinet on the cutting board, the jam on the counter, and close the cabinet.",
    paraphrases=(
        "Get ready for toast: {obj} onto the cutting board, jam onto the counter, and the cabinet shut.",
        "Take {obj} and jam out of the cabinet, the one to the board, the other to the counter. Shut the cabinet.",
        "The cutting board needs the {obj}, the counter the jam, and the cabinet is to be left closed.",
        "Bring the cabinet's {obj} to the cutting board and its jam to the counter below, and close it.",
    ),
)

_JAM_BESIDE = AllOf(ObjectTouches("jam", "counter"), Near("jam", "plate", 0.25, in_space=True), GripperFar("jam"))


def _onto_plate(name: str) -> Stage:
    return Stage("pick_place", "place", "plate", object=name)


SWEET_SAVORY_TOAST_SETUP = Task(
    name="SweetSavoryToastSetup",
    summary=(
        "Bread and avocado lie on the plate, the jam stands on the counter, 25 cm from the plate at most, the cabinet "
        "is shut, the gripper away from the plate."
    ),
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet", size=(1.0, 0.5))),
    robot_start=RobotStart("counter", at_object="plate"),
    objects=(
        ObjectSpec("plate", ("plate",), on_counter("cabinet", (np.inf, 0.5))),
        ObjectSpec(
            "avocado", ("avocado",), on_counter("cabinet", (np.inf, 0.4), reuse_region_from="plate"), graspable=True
        ),
        ObjectSpec(
            "bread",
            ("bread",),
            on_counter("cabinet", (np.inf, 0.4), reuse_region_from="plate"),
            graspable=True,
            scale=0.8,
        ),
        ObjectSpec("jam", ("jam",), in_cabinet("cabinet", (0.4, 0.3)), graspable=True),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (np.inf, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        GripperFar("plate"),
        ObjectOn("bread", "plate"),
        ObjectOn("avocado", "plate"),
        *_JAM_BESIDE.parts[:2],
        DoorsClosed("cabinet"),
    ),
    stages=(
        _onto_plate("avocado"),
        _onto_plate("bread"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="jam",
            until=_JAM_BESIDE,
            text="put the jam on the counter beside the plate",
        ),
        Stage("doors", "close", "cabinet"),
    ),
    instruction=(
        "Put the avocado and the {bread} on the plate, the jam from the cabinet on the counter beside it, and close "
        "the cabinet."
    ),
    paraphrases=(
        "Set up for toast, sweet or savory: avocado and {bread} on the plate, jam beside it, cabinet shut.",
        "The plate gets the {bread} and the avocado, and the cabinet's jam as neighbour. Close the cabinet.",
        "Lay avocado and {bread} on the plate, then bring the jam down next to it and shut the doors.",
        "Jam out of the cabinet, which is closed after that; {bread} and avocado onto the plate near it.",
    ),
)

TASKS = (BREAD_SELECTION, PREPARE_TOAST, SWEET_SAVORY_TOAST_SETUP)
