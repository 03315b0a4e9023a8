"""Steam vegetables on the stove."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    NearFixture,
    ObjectOn,
    ObjectTouchesAnyCounter,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, Water
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.cooking.lids import (
    COVERED,
    COVERS,
    FRONT_BURNER,
    ON_LIT_BURNER,
    STOVE_AND_COUNTER,
    lid,
    on_plate,
    saucepan,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_KINDS = ("broccoli", "carrot", "potato", "sweet_potato")


def _steamed(name: str, *, heaped: bool = False) -> ObjectSpec:
    return ObjectSpec(name, _KINDS, Placement(object="saucepan", heaped=heaped), graspable=True)


REMOVE_STEAMED_VEGETABLES = Task(
    name="RemoveSteamedVegetables",
    summary="Both vegetables lie on the plate, the gripper away from it.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove", beginning="front"),),
    objects=(
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_burner(size_m=0.05),
            scale=(1.35, 1.35, 0.75),
            filled="water",
        ),
        _steamed("vegetable1"),
        _steamed("vegetable2", heaped=True),
        ObjectSpec("serving_plate", ("plate",), on_counter("stove", (0.3, 0.3), loc="left_right")),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=AllOf(
        ObjectOn("vegetable1", "serving_plate"), ObjectOn("vegetable2", "serving_plate"), GripperFar("serving_plate")
    ),
    stages=(
        Stage("pick_place", "place", "serving_plate", object="vegetable1"),
        Stage(
            "pick_place",
            "place",
            "serving_plate",
            object="vegetable2",
            until=AllOf(ObjectOn("vegetable2", "serving_plate"), GripperFar("serving_plate")),
        ),
    ),
    instruction="Take the {vegetable1} and the {vegetable2} out of the saucepan and put them on the plate.",
    paraphrases=(
        "The {vegetable1} and the {vegetable2} are steamed: serve them on the plate beside the stove.",
        "Empty the saucepan: {vegetable1} and {vegetable2} belong on the plate.",
        "Out of the water and onto the plate with the {vegetable2} and the {vegetable1}.",
        "The plate is for what was steamed in the saucepan, {vegetable1} and {vegetable2}.",
    ),
)

_WASHED = StepsWhile(
    AllOf(UnderWater("colander", "sink"), ObjectOn("vegetable1", "colander"), ObjectOn("vegetable2", "colander")),
    50,
    label="vegetables_washed",
)
_BY_STOVE = AllOf(ObjectTouchesAnyCounter("colander"), NearFixture("colander", "stove", 0.3), GripperFar("colander"))


def _to_wash(name: str, *, heaped: bool = False) -> ObjectSpec:
    return ObjectSpec(name, (*_KINDS, "squash"), Placement(object="colander", heaped=heaped))


PREPARE_VEGGIES_FOR_STEAMING = Task(
    name="PrepareVeggiesForSteaming",
    summary=(
        "The colander was under running water with both vegetables in it for 50 steps; it stands on a counter, 30 cm "
        "from the stove at most, the gripper away from it."
    ),
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink"),
        FixtureSpec("stove", "stove"),
        counter_near("stove", name="stove_counter"),
    ),
    robot_start=RobotStart("counter", at_object="colander"),
    choices=(Choice("knob", of="stove", beginning="front"),),
    objects=(
        ObjectSpec("colander", ("colander",), on_counter("sink", (0.4, 0.4), loc="left_right"), graspable=True),
        _to_wash("vegetable1"),
        _to_wash("vegetable2", heaped=True),
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
        ),
    ),
    initial=(Water("sink", on=True),),
    goal=AllOf(_WASHED, *_BY_STOVE.parts),
    stages=(
        Stage(
            "pick_place",
            "hold",
            "sink",
            object="colander",
            until=_WASHED,
            text="hold the colander with the vegetables under the faucet of the sink",
        ),
        Stage("pick_place", "pick", "sink", object="colander"),
        Stage("navigation", "drive", "stove", object="colander"),
        Stage(
            "pick_place",
            "place",
            "stove_counter",
            object="colander",
            until=_BY_STOVE,
            text="put the colander on the counter close to the stove",
        ),
    ),
    instruction=(
        "Hold the colander with the {vegetable1} and the {vegetable2} under the running water for a few seconds, then "
        "put it on the counter close to the stove."
    ),
    paraphrases=(
        "Wash the vegetables in the colander under the faucet and bring them, in it, to the stove.",
        "Get {vegetable1} and {vegetable2} ready to be steamed: rinse their colander, then stand it by the stove.",
        "The colander goes under the faucet for a while and from there to the counter beside the stove.",
        "Rinse what is in the colander and leave it, still in there, next to the stove.",
    ),
)

_TO_STEAM = ("vegetable1", "vegetable2")

STEAM_VEGGIES_WITH_WATER = Task(
    name="SteamVeggiesWithWater",
    summary=(
        "Both vegetables are in the saucepan over its lit burner, the lid lies level on the saucepan, the gripper away "
        "from the lid."
    ),
    fixtures=STOVE_AND_COUNTER,
    robot_start=RobotStart("counter", at_object="vegetable_plate"),
    choices=(FRONT_BURNER,),
    objects=(
        ObjectSpec("vegetable_plate", ("plate",), on_counter("stove", (0.3, 0.3), loc="left_right")),
        *(ObjectSpec(name, _KINDS, on_plate("vegetable_plate"), graspable=True) for name in _TO_STEAM),
        saucepan("water"),
        lid(on_counter("stove", (0.6, 0.55), loc="left_right")),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=AllOf(*(ObjectOn(name, "saucepan") for name in _TO_STEAM), *COVERED.parts, ON_LIT_BURNER),
    stages=(*(Stage("pick_place", "place", "saucepan", object=name) for name in _TO_STEAM), COVERS),
    instruction="Put the {vegetable1} and the {vegetable2} into the saucepan with water and cover it with its lid.",
    paraphrases=(
        "Steam the {vegetable1} and the {vegetable2}: both into the saucepan, the lid on top.",
        "From the plate into the hot water with the {vegetable1} and the {vegetable2}; then the lid goes on.",
        "The vegetables on the plate are to be steamed in the covered saucepan.",
        "Fill the saucepan on the {knob} burner with the {vegetable2} and the {vegetable1}, then close it.",
    ),
)

TASKS = (
    PREPARE_VEGGIES_FOR_STEAMING,
    REMOVE_STEAMED_VEGETABLES,
    STEAM_VEGGIES_WITH_WATER,
)
