"""PickPlaceCounterToSink: take an object from the counter beside the sink and put it into the basin."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInBasin
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InsideOf, ObjectSpec, OnCounter, RobotStart
from robocasa_lerobot.envs.tasks.task import Stage, Task

COUNTER_TO_SINK = Task(
    name="PickPlaceCounterToSink",
    summary="Goal: an object from the counter lies in the sink. Success: its centre is in the basin, the gripper away.",
    fixtures=(FixtureSpec("sink", "sink"),),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "obj",
            ("any",),
            OnCounter("sink", loc="left_right", size=(0.30, 0.40), at="front"),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec(
            "distr_counter",
            ("any",),
            OnCounter("sink", loc="left_right", size=(0.30, 0.30), at="front", offset=(0.0, 0.3)),
        ),
        ObjectSpec("distr_sink", ("any",), InsideOf("sink", size=(0.25, 0.25), at=1.0), properties=("washable",)),
    ),
    goal=AllOf(ObjectInBasin("obj", "sink"), GripperFar("obj")),
    stages=(Stage("pick_place", "place", "sink", object="obj"),),
    instruction="Take the {obj} off the counter and put it into the sink.",
    paraphrases=(
        "The {obj} belongs in the sink basin; bring it there.",
        "Pick up the {obj} beside the sink and drop it in.",
        "Move the {obj} from the worktop to the basin.",
        "Place the {obj} in the sink so that it can be washed.",
    ),
)

TASKS = (COUNTER_TO_SINK,)
