"""Clean the sink."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    NearFixture,
    Not,
    ObjectOn,
    ObjectTouchesAnyCounter,
    Once,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_RUNS = StateIs("sink", "water_on")
_RINSED = AllOf(
    Once(AllOf(_RUNS, StateIs("sink", "left")), label="left_rinsed"),
    Once(
        AllOf(_RUNS, StateIs("sink", "left", value=False), StateIs("sink", "right", value=False)),
        label="center_rinsed",
    ),
    Once(AllOf(_RUNS, StateIs("sink", "right")), label="right_rinsed"),
)

RINSE_SINK_BASIN = Task(
    name="RinseSinkBasin",
    summary="Water has run with the spout to the left, in the middle and to the right.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(ObjectSpec("plate", ("plate",), on_counter("sink", (0.3, 0.3), loc="left_right")),),
    initial=(Water("sink", on=False), PartAt("sink", "spout", (0.5, 0.5))),
    goal=_RINSED,
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        Stage(
            "levers",
            "sweep",
            "sink",
            part="spout",
            until=_RINSED,
            text="swing the spout of the sink from one side to the other",
        ),
    ),
    instruction="Turn on the faucet and rinse the whole basin: left, middle and right, by turning the spout.",
    paraphrases=(
        "With the water running, point the spout to the left, the middle and the right of the sink.",
        "Rinse all of the sink with the faucet's spout.",
        "Open the tap and move its spout across the basin until each side was under the stream.",
        "Clean the basin with running water on both sides and in the middle.",
    ),
)


def _waste(name: str, along: float) -> ObjectSpec:
    start = Placement("sink", size=(0.3, 0.3), pos=(0.0, along))
    return ObjectSpec(name, ("fruit", "vegetable"), start, graspable=True, properties=("washable",), repeats=True)


CLEAR_FOOD_WASTE = Task(
    name="ClearFoodWaste",
    summary="Both pieces of food are in the colander, the gripper away from them.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        _waste("food_0", 0.5),
        _waste("food_1", 0.7),
        ObjectSpec("colander", ("colander",), on_counter("sink", (0.4, 0.4), loc="left_right"), graspable=True),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(
        ObjectOn("food_0", "colander"), ObjectOn("food_1", "colander"), GripperFar("food_0"), GripperFar("food_1")
    ),
    stages=(
        Stage("pick_place", "place", "colander", object="food_0"),
        Stage("pick_place", "place", "colander", object="food_1"),
    ),
    instruction="Put {food_0+food_1} from the sink into the colander.",
    paraphrases=(
        "Clear the sink of food: {food_0+food_1} go into the colander.",
        "The colander beside the sink is for {food_0+food_1}.",
        "No food may stay in the basin; collect {food_0+food_1} in the colander.",
        "Move {food_0+food_1} out of the sink, into the colander on the counter.",
    ),
)

_AWAY = ("mug1", "mug2", "bowl")


def _far_off(name: str) -> AllOf:
    return AllOf(Not(NearFixture(name, "sink", 1.0)), ObjectTouchesAnyCounter(name), GripperFar(name))


def _take_away(name: str) -> tuple[Stage, ...]:
    return fetch(name, "counter", "spot", until=_far_off(name))


CLEAR_SINK_AREA = Task(
    name="ClearSinkArea",
    summary="Both mugs and the bowl stand on counters, more than 1 m from the sink, the gripper away from them.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink"),
        FixtureSpec("spot", "counter", other_than=("sink",), middle_apart_m=1.6),
    ),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "food",
            ("fruit", "vegetable"),
            Placement("sink", size=(0.3, 0.3), pos=(1.0, 0.5)),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.5, 0.5), loc="left_right"), graspable=True),
        *(
            ObjectSpec(name, ("mug",), on_counter("sink", (0.3, 0.4), loc="left_right"), graspable=True, repeats=True)
            for name in ("mug1", "mug2")
        ),
    ),
    goal=AllOf(*(part for name in _AWAY for part in _far_off(name).parts)),
    stages=(
        *_take_away("mug1"),
        Stage("navigation", "drive", "sink"),
        *_take_away("mug2"),
        Stage("navigation", "drive", "sink"),
        *_take_away("bowl"),
    ),
    instruction="Carry both mugs and the bowl from the sink to a counter that is more than a metre away.",
    paraphrases=(
        "Around the sink there should be room: take the two mugs and the bowl a metre or more away.",
        "Nothing but the food in it may stay at the sink; mugs and bowl go to a counter farther off.",
        "Clear the counter by the sink of the mugs and the bowl, to a place more than one metre from it.",
        "Move first the mugs, one by one, then the bowl, well away from the sink.",
    ),
)

TASKS = (CLEAR_FOOD_WASTE, CLEAR_SINK_AREA, RINSE_SINK_BASIN)
