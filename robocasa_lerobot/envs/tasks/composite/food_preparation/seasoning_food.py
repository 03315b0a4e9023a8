"""Season food."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Beside,
    GripperFar,
    NearFixture,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BESIDE = AllOf(Beside("shaker", "steak", "stool", across=0.25, along=0.1), ObjectTouches("shaker", "dining_counter"))
*_CARRIED, _PUT = fetch("shaker", "cabinet", "dining_counter", until=AllOf(*_BESIDE.parts, GripperFar("shaker")))

SEASONING_STEAK = Task(
    name="SeasoningSteak",
    summary="The shaker stands on the dining counter at a side of the steak, the gripper away from the steak.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec(
            "shaker",
            ("shaker", "salt_and_pepper_shaker"),
            in_cabinet("cabinet", (0.3, 0.2), pos=(0.0, -0.9)),
            graspable=True,
        ),
        ObjectSpec("steak", ("steak",), before_stool((0.4, 0.4), pos=("ref", -1.0), try_to_place_in="plate")),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_BESIDE.parts, GripperFar("steak")),
    stages=(*_CARRIED, replace(_PUT, text="put the {shaker} on the dining counter beside the steak")),
    instruction="Bring the {shaker} from the cabinet to the dining counter and stand it at a side of the steak.",
    paraphrases=(
        "The steak on the dining counter wants seasoning: put the cabinet's {shaker} to its left or right.",
        "Set the {shaker} down beside the plate with the steak; it is in the open cabinet.",
        "Carry the {shaker} to the dining counter, next to the steak and in line with it.",
        "Whoever eats the steak should have the {shaker} beside the plate.",
    ),
)

_SPICES = ("spice", "bottle", "shaker")


def _by_stove(name: str) -> AllOf:
    return AllOf(NearFixture(name, "stove", 0.2), ObjectTouchesAnyCounter(name), GripperFar(name))


def _to_stove(name: str) -> tuple[Stage, ...]:
    text = f"put the {{{name}}} on the counter beside the stove"
    return (
        Stage("pick_place", "pick", "cabinet", object=name),
        Stage("navigation", "drive", "stove", object=name),
        Stage("pick_place", "place", "counter_stove", object=name, until=_by_stove(name), text=text),
    )


_BACK = Stage("navigation", "drive", "cabinet")
_ON_SHELF = in_cabinet("cabinet", (1.0, 0.2), pos=(None, -1.0))

SET_UP_SPICE_STATION = Task(
    name="SetUpSpiceStation",
    summary="Spice, bottle and shaker stand on a counter, 20 cm from the stove at most, the gripper away from them.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("counter_stove", "counter", near="stove"),
        FixtureSpec("cabinet", "cabinet"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("spice", ("turmeric", "paprika"), _ON_SHELF, graspable=True),
        ObjectSpec("shaker", ("shaker",), _ON_SHELF, graspable=True),
        ObjectSpec("bottle", ("ketchup", "mayonnaise"), _ON_SHELF, graspable=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*(part for name in _SPICES for part in _by_stove(name).parts)),
    stages=(*_to_stove("spice"), _BACK, *_to_stove("bottle"), _BACK, *_to_stove("shaker")),
    instruction="Move {spice}, {bottle} and {shaker} from the cabinet to the counter right beside the stove.",
    paraphrases=(
        "Whoever cooks needs {spice}, {bottle} and {shaker} at hand: stand them next to the stove.",
        "The {spice}, the {bottle} and the {shaker} in the cabinet belong by the stove, on the counter.",
        "Set up what seasons beside the stove: first the {spice}, then the {bottle}, then the {shaker}.",
        "Bring the cabinet's {shaker}, {bottle} and {spice} close to the stove.",
    ),
)


LEMON_SEASONING_FISH = Task(
    name="LemonSeasoningFish",
    summary="The lemon is on the fish's cutting board, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "lemon",
            ("lemon",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.15, 0.1),
                pos=(0.0, -1.0),
                margin=0.0,
            ),
            graspable=True,
        ),
        ObjectSpec("fish_container", ("cutting_board",), on_counter("fridge", (1.0, 0.5), pos=(0.0, -1.0))),
        ObjectSpec("fish", ("fish",), Placement(object="fish_container")),
    ),
    goal=AllOf(ObjectOn("lemon", "fish_container"), GripperFar("lemon")),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("pick_place", "place", "fish_container", object="lemon"),
    ),
    instruction="Open the fridge, take the lemon out of it and put it on the cutting board with the fish.",
    paraphrases=(
        "The fish on the board wants a lemon; there is one in the fridge.",
        "Bring the fridge's lemon to the cutting board, beside the fish.",
        "Season the fish: fetch the lemon from the closed fridge and lay it on the fish's board.",
        "On the board with the fish there should also be the lemon that is in the fridge.",
    ),
)

TASKS = (LEMON_SEASONING_FISH, SEASONING_STEAK, SET_UP_SPICE_STATION)
