"""Restock the sink."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Goal,
    GripperFar,
    NearFixture,
    ObjectTouchesAnyCounter,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SUPPLIES = ("soap_dispenser", "sponge")


def _in_drawer(name: str, **more: object) -> ObjectSpec:
    start = Placement("drawer", size=(0.5, 0.35), pos=(0.0, -1.0), **more)  # type: ignore[arg-type]
    return ObjectSpec(name, (name,), start, graspable=True)


def _by_sink(name: str, *more: Goal) -> Stage:
    there = AllOf(ObjectTouchesAnyCounter(name), NearFixture(name, "sink", 0.25), *more, GripperFar(name))
    text = f"put the {{{name}}} on the counter beside the sink"
    return Stage("pick_place", "place", "counter", object=name, until=there, text=text)


RESTOCK_SINK_SUPPLIES = Task(
    name="RestockSinkSupplies",
    summary="Sponge and soap dispenser are on a counter by the sink, the dispenser upright, the gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("drawer", beside=True),
    objects=(_in_drawer("sponge"), _in_drawer("soap_dispenser", lying=True, rotation=(0.0, 0.0))),
    initial=(InitialOpenness("drawer", 0.9, 1.0),),
    goal=AllOf(
        *map(ObjectTouchesAnyCounter, _SUPPLIES),
        *(NearFixture(name, "sink", 0.25) for name in _SUPPLIES),
        ObjectUpright("soap_dispenser"),
        *map(GripperFar, _SUPPLIES),
    ),
    stages=(_by_sink("sponge"), _by_sink("soap_dispenser", ObjectUpright("soap_dispenser"))),
    instruction="Take sponge and soap dispenser out of the drawer to the sink, and stand the dispenser up beside it.",
    paraphrases=(
        "By the sink there should be a sponge and an upright soap dispenser; both are in the open drawer.",
        "Restock the sink from the drawer: sponge on the counter next to it, soap dispenser too, the right way up.",
        "The soap dispenser lies in the drawer next to the sponge. Both belong by the sink, the dispenser standing.",
        "Put what is in the drawer on the counter close to the sink; soap is not to lie on its side.",
    ),
)

TASKS = (RESTOCK_SINK_SUPPLIES,)
