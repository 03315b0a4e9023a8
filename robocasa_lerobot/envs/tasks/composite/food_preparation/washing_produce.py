"""Wash fruits and vegetables."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    Goal,
    GripperFar,
    ObjectAtSite,
    ObjectInBasin,
    ObjectOn,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_UNDER = UnderWater("colander", "sink")


def _in_colander(name: str) -> Goal:
    return ObjectOn(name, "colander")


_LOADED = ForEach("fruit", _in_colander)
_WASHED = StepsWhile(AllOf(_UNDER, _LOADED), 25, label="fruit_washed")
_BELOW_SPOUT = ObjectAtSite("colander", "sink", "water", across=0.08, high=0.6)

WASH_FRUIT_COLANDER = Task(
    name="WashFruitColander",
    summary=(
        "The colander stands in the basin under running water with all the fruit, for 25 steps and in the end, "
        "the gripper away."
    ),
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "fruit",
            ("fruit",),
            on_counter("sink", (0.3, 0.3), loc="left_right"),
            count=(1, 3),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("colander", ("colander",), on_counter("sink", (0.4, 0.5), loc="left_right"), graspable=True),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(_UNDER, _LOADED, _WASHED, ObjectInBasin("colander", "sink"), GripperFar("colander")),
    stages=(
        Stage(
            "pick_place",
            "place",
            "sink",
            object="colander",
            until=AllOf(ObjectInBasin("colander", "sink"), _BELOW_SPOUT, GripperFar("colander")),
        ),
        EachStage(
            "fruit",
            lambda name: (
                Stage(
                    "pick_place", "place", "colander", object=name, until=AllOf(_in_colander(name), GripperFar(name))
                ),
            ),
        ),
        Stage("levers", "on", "sink", part="handle", until=_WASHED),
    ),
    instruction="Stand the colander in the sink, put {fruit} into it and run the water over it.",
    paraphrases=(
        "Wash {fruit} in the colander under the faucet of the sink.",
        "Put the colander below the faucet, fill it with {fruit}, and open the water.",
        "Rinse {fruit} from the counter: the colander goes into the basin, then the fruit; then turn on the water.",
        "With {fruit} in the colander and the colander in the sink, let water run over it all.",
    ),
)

TASKS = (WASH_FRUIT_COLANDER,)
