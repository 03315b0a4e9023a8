"""Collect what is to be recycled from all over the kitchen."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    NearFixture,
    ObjectInBasin,
    ObjectTouches,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_LARGE, _SMALL = 1.2, 0.9  # the gripper opens by 8 cm
_BOTTLES = ("bottle_large1", "bottle_small1", "bottle_large_sample", "bottle_small_sample")
_LARGE_BY_SINK = AllOf(*(NearFixture(name, "sink", 0.25) for name in ("bottle_large1", "bottle_large_sample")))
_BY_SAMPLE = AllOf(
    ObjectTouches("bottle_large1", "counter"),
    NearFixture("bottle_large1", "sink", 0.25),
    Near("bottle_large1", "bottle_large_sample", 0.4, in_space=True),
    GripperFar("bottle_large1"),
)


def _bottle(name: str, start: Placement, scale: float) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("bottled_drink",),
        start,
        graspable=True,
        properties=("washable",),
        scale=scale,
        repeats=True,
    )


RECYCLE_BOTTLES_BY_SIZE = Task(
    name="RecycleBottlesBySize",
    summary=(
        "The large bottles stand on the counter, 25 cm from the sink and 40 cm from each other at most, the small ones "
        "are in the sink, the gripper away from all."
    ),
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("dining_counter", at_object="bottle_large1"),
    objects=(
        _bottle("bottle_large1", before_stool((0.2, 0.2), pos=("ref", -0.9)), _LARGE),
        _bottle("bottle_small1", before_stool((0.2, 0.2), pos=("ref", -0.9), offset=(0.2, 0.0)), _SMALL),
        _bottle("bottle_large_sample", on_counter("sink", (0.2, 0.4), loc="left_right", pos=("ref", -0.9)), _LARGE),
        _bottle("bottle_small_sample", Placement("sink", size=(0.2, 0.2), pos=(1.0, 1.0)), _SMALL),
    ),
    goal=AllOf(
        ObjectInBasin("bottle_small1", "sink"),
        ObjectInBasin("bottle_small_sample", "sink"),
        _LARGE_BY_SINK,
        ObjectTouches("bottle_large1", "counter"),
        ObjectTouches("bottle_large_sample", "counter"),
        Near("bottle_large1", "bottle_large_sample", 0.4, in_space=True),
        *map(GripperFar, _BOTTLES),
    ),
    stages=(
        Stage("pick_place", "pick", "dining_counter", object="bottle_large1"),
        Stage("navigation", "drive", "bottle_large_sample", object="bottle_large1"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="bottle_large1",
            until=_BY_SAMPLE,
            text="put the large {bottle_large1} on the counter beside the other one",
        ),
        Stage("navigation", "drive", "bottle_small1"),
        *fetch("bottle_small1", "dining_counter", "sink"),
    ),
    instruction=(
        "Bring the two bottles from the dining counter to the sink: the large one beside the large bottle on the "
        "counter, the small one into the basin to the other small bottle."
    ),
    paraphrases=(
        "Sort the bottles by size: large ones on the counter next to the sink, small ones in it.",
        "The small bottle on the dining counter belongs in the sink, the large one beside the large one at the sink.",
        "Large bottle to large bottle, small bottle to small bottle: both pairs are to be at the sink.",
        "Recycle the bottles on the dining counter, the big one next to the sink, the little one inside it.",
    ),
)

_CANS = ("can1", "can2", "can3", "can4")
_ORDER = ("can3", "can4", "can1", "can2")  # in which they are collected
_COUNTERS = ("counter_cab", "dining_counter", "counter_microwave")


def _can(name: str, start: Placement) -> ObjectSpec:
    return ObjectSpec(name, ("can",), start, graspable=True, repeats=True)


def _on_dining_counter(across: float) -> Placement:
    return Placement("dining_counter", region=SampleRegion(ref="stool"), size=(0.3, 0.3), pos=(across, "ref"))


def _by_stove(name: str) -> Stage:
    """Beside one of those that are there already."""
    there = _ORDER[: _ORDER.index(name)]
    near = (Near(name, there, 0.25),) if there else ()
    until = AllOf(ObjectTouches(name, "counter_stove"), NearFixture(name, "stove", 0.25), *near, GripperFar(name, 0.15))
    text = "put the can on the counter beside the stove"
    return Stage("pick_place", "place", "counter_stove", object=name, until=until, text=text)


def _carry(name: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "dining_counter", object=name),
        Stage("navigation", "drive", "stove", object=name),
        _by_stove(name),
    )


RECYCLE_SODA_CANS = Task(
    name="RecycleSodaCans",
    summary=(
        "All four cans stand on the counter by the stove, 25 cm from it and from another can at most, the gripper "
        "15 cm away from them."
    ),
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        FixtureSpec("stove", "stove"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("microwave", "microwave"),
        counter_near("microwave", name="counter_microwave"),
        counter_near("cabinet", name="counter_cab"),
        counter_near("stove", name="counter_stove"),
        FixtureSpec("dining_counter", "dining_counter"),
    ),
    robot_start=RobotStart("{start}"),
    choices=(Choice("start", {name: {} for name in _COUNTERS}),),
    objects=(
        _can("can1", on_counter("microwave", (0.3, 0.3), counter="counter_microwave")),
        _can("can2", on_counter("cabinet", (0.3, 0.3), counter="counter_cab")),
        _can("can3", _on_dining_counter(1.0)),
        _can("can4", _on_dining_counter(-1.0)),
    ),
    goal=AllOf(
        AllOf(*(NearFixture(name, "stove", 0.25) for name in _CANS)),
        AllOf(*(Near(name, tuple(other for other in _CANS if other != name), 0.25) for name in _CANS)),
        AllOf(*(ObjectTouches(name, "counter_stove") for name in _CANS)),
        AllOf(*(GripperFar(name, 0.15) for name in _CANS)),
    ),
    stages=(
        *_carry("can3"),
        Stage("navigation", "drive", "can4"),
        *_carry("can4"),
        _by_stove("can1"),
        _by_stove("can2"),
    ),
    instruction="Collect the four cans of the kitchen on the counter beside the stove, close together.",
    paraphrases=(
        "All four cans are to be recycled: stand them together next to the stove.",
        "There are cans on the dining counter, by the microwave and below a cabinet; gather them beside the stove.",
        "Bring every can to the stove and group them on the counter there.",
        "The four soda cans belong side by side on the counter at the stove.",
    ),
)

TASKS = (RECYCLE_BOTTLES_BY_SIZE, RECYCLE_SODA_CANS)
