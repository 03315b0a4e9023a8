"""Fill dishes at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_STARTERS = ("cheese", "meat", "vegetable")
_SHELF = Placement(
    "fridge", region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)), size=(0.4, 0.2), pos=(0.0, -1.0)
)


def _fetch(name: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "fridge", object=name),
        Stage("navigation", "drive", "appetizer_plate", object=name),
        Stage("pick_place", "place", "appetizer_plate", object=name),
    )


BUILD_APPETIZER_PLATE = Task(
    name="BuildAppetizerPlate",
    summary="Cheese, meat and vegetable lie on the plate on the dining counter, the gripper away from each.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge", setback=0.3),
    objects=(
        ObjectSpec("cheese", ("cheese",), _SHELF, graspable=True),
        ObjectSpec("vegetable", ("vegetable",), _SHELF, graspable=True),
        ObjectSpec("meat", ("meat",), _SHELF, graspable=True),
        ObjectSpec(
            "appetizer_plate",
            ("plate",),
            Placement("dining_table", region=SampleRegion(ref="stool"), size=(0.4, 0.4), pos=("ref", "ref")),
            scale=1.25,
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0),),
    goal=AllOf(
        *(ObjectOn(name, "appetizer_plate") for name in _STARTERS),
        ObjectTouches("appetizer_plate", "dining_table"),
        *(GripperFar(name) for name in _STARTERS),
    ),
    stages=(
        *_fetch("cheese"),
        Stage("navigation", "drive", "fridge"),
        *_fetch("meat"),
        Stage("navigation", "drive", "fridge"),
        *_fetch("vegetable"),
    ),
    instruction="Bring {cheese}, {meat} and {vegetable} from the fridge to the plate on the dining counter.",
    paraphrases=(
        "Make a plate of starters on the dining counter from the {cheese}, the {meat} and the {vegetable}.",
        "The {cheese}, the {meat} and the {vegetable} in the fridge belong on the plate at the dining counter.",
        "Lay the {cheese}, the {meat} and the {vegetable} out of the fridge on the appetizer plate.",
        "Serve starters: put the fridge's {cheese}, {meat} and {vegetable} on the dining counter's plate.",
    ),
)

TASKS = (BUILD_APPETIZER_PLATE,)
