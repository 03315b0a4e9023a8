"""Put ice into drinks."""

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ICE = ("ice_cube1", "ice_cube2")
_AWAY_M = 0.15


def _in_glass(name: str) -> ObjectOn:
    return ObjectOn(name, "glass_cup", within=0.06)


def _drop(name: str) -> Stage:
    until = AllOf(_in_glass(name), GripperFar(name, _AWAY_M))
    return Stage("pick_place", "place", "glass_cup", object=name, until=until)


def _cube(name: str) -> ObjectSpec:
    return ObjectSpec(name, ("ice_cube",), Placement(object="ice_bowl"), graspable=True, scale=0.9, repeats=True)


MAKE_ICE_LEMONADE = Task(
    name="MakeIceLemonade",
    summary="The lemon wedge and an ice cube are in the glass, 6 cm from its middle at most; the gripper away.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "lemon_wedge",
            ("lemon_wedge",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.25, 0.2),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement(
                "fridge", region=SampleRegion(name="fridge_shelf", height=(0.5, 1.5)), size=(0.3, 0.3), pos=(0.0, 1.0)
            ),
            properties=("fridgable",),
            exclude=("lemon_wedge", "bowl", "ice_cube", "glass_cup"),
        ),
        ObjectSpec("ice_bowl", ("bowl",), on_counter("fridge", (1.0, 0.4)), scale=(1.1, 1.1, 0.75)),
        *map(_cube, _ICE),
        ObjectSpec(
            "glass_cup",
            ("glass_cup",),
            on_counter("fridge", (0.5, 0.25)),
            scale=(1.25, 1.25, 1.0),
            filled="lemonade",
        ),
    ),
    goal=AllOf(
        _in_glass("lemon_wedge"),
        AnyOf(*map(_in_glass, _ICE)),
        *(GripperFar(name, _AWAY_M) for name in ("lemon_wedge", *_ICE)),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("pick_place", "pick", "fridge", object="lemon_wedge"),
        Stage("navigation", "drive", "glass_cup", object="lemon_wedge"),
        _drop("lemon_wedge"),
        _drop("ice_cube1"),
    ),
    instruction="Put the lemon wedge from the fridge and an ice cube from the bowl into the glass of lemonade.",
    paraphrases=(
        "Make an ice lemonade: a lemon wedge out of the fridge and an ice cube go into the glass.",
        "The lemonade lacks ice and lemon; the wedge is in the fridge, the ice in the bowl.",
        "Drop the fridge's lemon wedge into the lemonade, and an ice cube after it.",
        "Finish the lemonade on the counter with one ice cube and the wedge of lemon that is in the fridge.",
    ),
)

TASKS = (MAKE_ICE_LEMONADE,)
