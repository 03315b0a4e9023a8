"""Make salads."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Near, ObjectTouches, StepsWhile, UnderWater
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_WASHED = StepsWhile(UnderWater("lettuce", "sink"), 25)

# A head of lettuce is wider than the gripper opens: its colander is carried.
WASH_LETTUCE = Task(
    name="WashLettuce",
    summary="The lettuce has been under running water for 25 steps in total.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("lettuce_container", ("colander",), on_counter("sink", (0.4, 0.5), loc="left_right")),
        ObjectSpec("lettuce", ("lettuce",), Placement(object="lettuce_container")),
    ),
    initial=(Water("sink", on=False),),
    goal=_WASHED,
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        Stage("pick_place", "hold", "sink", object="lettuce_container", until=_WASHED),
    ),
    instruction="Turn on the faucet and hold the lettuce under the water until it is washed.",
    paraphrases=(
        "Wash the lettuce that lies in the colander with running water.",
        "Let the water run over the lettuce in its colander for a while.",
        "The lettuce needs rinsing: open the faucet and bring the colander below it.",
        "Rinse the lettuce at the sink.",
    ),
)


_BOWL = "lettuce_container"


def _by_bowl(name: str) -> AllOf:
    return AllOf(ObjectTouches(name, "counter"), Near(name, _BOWL, 0.25, from_edge=True), GripperFar(name))


def _shelf(low: float) -> SampleRegion:
    return SampleRegion(name="fridge_shelf", height=(low, 1.5))


*_CHEESE_CARRIED, _CHEESE_PUT = fetch("cheese", "fridge", "counter", until=_by_bowl("cheese"))

PREPARE_CHEESE_STATION = Task(
    name="PrepareCheeseStation",
    summary="Cheese and grater are on the counter, 25 cm from the lettuce's bowl at most, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet", size=(0.6, 0.6)),
        FixtureSpec("fridge", "fridge"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "cheese",
            ("cheese",),
            Placement("fridge", region=_shelf(1.0), size=(0.3, 0.25), pos=(0.0, -1.0)),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec(
            _BOWL,
            ("bowl",),
            Placement(
                "counter", region=SampleRegion(ref="cabinet", top_size=(0.4, 0.4)), size=(0.4, 0.4), pos=("ref", -1.0)
            ),
        ),
        ObjectSpec("lettuce", ("lettuce",), Placement(object=_BOWL, ensure_inside=False)),
        ObjectSpec("grater", ("cheese_grater",), in_cabinet("cabinet", (0.5, 0.2)), graspable=True, scale=0.75),
        ObjectSpec(
            "distr1",
            ("any",),
            Placement("fridge", region=_shelf(0.5), size=(0.6, 0.2), pos=(0.0, 1.0)),
            exclude=("cheese",),
            properties=("fridgable",),
        ),
        ObjectSpec("distr2", ("any",), in_cabinet("cabinet", (0.6, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), InitialOpenness("cabinet", 0.9, 1.0)),
    goal=AllOf(*_by_bowl("cheese").parts, *_by_bowl("grater").parts),
    stages=(
        *_CHEESE_CARRIED,
        replace(_CHEESE_PUT, text="put the cheese on the counter beside the bowl"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="grater",
            until=_by_bowl("grater"),
            text="put the {grater} on the counter beside the bowl",
        ),
    ),
    instruction="Put cheese from the fridge and grater from the cabinet beside the bowl of lettuce on the counter.",
    paraphrases=(
        "The lettuce will get cheese: set cheese and grater down close to its bowl.",
        "Bring the fridge's cheese to the bowl on the counter, then the cabinet's grater.",
        "Next to the bowl of lettuce there should be the grater and the cheese.",
        "Prepare to grate cheese over the lettuce: cheese out of the fridge, grater out of the cabinet, to the bowl.",
    ),
)

TASKS = (PREPARE_CHEESE_STATION, WASH_LETTUCE)
