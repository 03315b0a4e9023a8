"""Make toast."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
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

TASKS = (BREAD_SELECTION,)
