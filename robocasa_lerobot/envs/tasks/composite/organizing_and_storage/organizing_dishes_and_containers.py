"""Keep dishes in order."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, HandlePoints, ObjectInside, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
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

# Handles of our mugs lie along +x, which is to the right of a cabinet as they are.
_HANDLE_RIGHT = (0.0, 0.0)
_MOST_OFF = float(np.deg2rad(40.0))  # of the handle from the right: the published 50 to 130 degrees of its yaw


def _shelved(name: str, x: float) -> ObjectSpec:
    start = Placement("cabinet", size=(0.4, 0.2), pos=(x, 0.5), rotation=_HANDLE_RIGHT)
    return ObjectSpec(name, ("mug",), start, repeats=True)


ORGANIZE_MUGS_BY_HANDLE = Task(
    name="OrganizeMugsByHandle",
    summary="The mug from the counter is in the cabinet, its handle to the right as the others, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        _shelved("mug1", -0.9),
        _shelved("mug2", -0.6),
        ObjectSpec(
            "mug_counter1", ("mug",), on_counter("cabinet", (1.0, 0.3), pos=("ref", -0.5)), graspable=True, repeats=True
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectInside("mug_counter1", "cabinet"),
        HandlePoints("mug_counter1", "cabinet", "right", _MOST_OFF),
        GripperFar("mug_counter1"),
    ),
    stages=(
        Stage("pick_place", "pick", "counter", object="mug_counter1"),
        Stage(
            "pick_place",
            "place",
            "cabinet",
            object="mug_counter1",
            until=AllOf(
                ObjectInside("mug_counter1", "cabinet"),
                HandlePoints("mug_counter1", "cabinet", "right", _MOST_OFF),
                GripperFar("mug_counter1"),
            ),
            text="put the mug into the cabinet with its handle to the right",
        ),
    ),
    instruction="Put the mug from the counter into the cabinet with its handle to the right, like the others'.",
    paraphrases=(
        "All mugs in the cabinet should have their handles on the right: the one on the counter joins them.",
        "Store the counter's mug in the open cabinet, turned as the two mugs are that stand there.",
        "Handle to the right, that is how the mug from the counter goes into the cabinet.",
        "The cabinet takes a third mug, the one on the counter; its handle, too, is to the right.",
    ),
)

# The rack's rods hold plates; the mug dries beside them.
_BESIDE_RODS = Placement("dish_rack", size=(0.14, 1.0), pos=(1.0, 0.0), margin=0.005)

EMPTY_DISH_RACK = Task(
    name="EmptyDishRack",
    summary="The mug is in the cabinet, which is shut, the gripper away from it.",
    fixtures=(FixtureSpec("dish_rack", "dish_rack"), FixtureSpec("cabinet", "cabinet_with_door", near="dish_rack")),
    robot_start=RobotStart("dish_rack"),
    objects=(
        *(
            ObjectSpec(name, ("mug",), in_cabinet("cabinet", (0.4, 0.2), pos=(x, -1.0)), repeats=True)
            for name, x in (("cabinet_mug1", -0.9), ("cabinet_mug2", 0.0))
        ),
        ObjectSpec("mug", ("mug",), _BESIDE_RODS, graspable=True, scale=0.95, repeats=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(ObjectInside("mug", "cabinet"), DoorsClosed("cabinet"), GripperFar("mug")),
    stages=(
        Stage(
            "pick_place",
            "place",
            "cabinet",
            object="mug",
            until=AllOf(ObjectInside("mug", "cabinet"), GripperFar("mug")),
        ),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the mug from the dish rack into the cabinet, to the other mugs, and close that.",
    paraphrases=(
        "The mug is dry: take it off the dish rack into the cabinet where the other two are, and shut the cabinet.",
        "Empty the dish rack; its mug belongs in the cabinet, which is closed in the end.",
        "In the open cabinet stand two mugs. Add the one from the rack, then close the cabinet.",
        "Store the mug that is in the rack with the others, behind a closed cabinet.",
    ),
)

TASKS = (EMPTY_DISH_RACK, ORGANIZE_MUGS_BY_HANDLE, STACK_BOWLS_CABINET)
