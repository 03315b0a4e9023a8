"""Measure ingredients."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    Not,
    ObjectOn,
    ObjectTouches,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FOOD = ("packaged_food",)
_WEIGHED = AllOf(ObjectOn("obj", "digital_scale"), ObjectUpright("obj"), GripperFar("obj"))

WEIGH_INGREDIENTS = Task(
    name="WeighIngredients",
    summary="The package stands upright on the scale, the cabinet is shut, the gripper away.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", _FOOD, in_cabinet("cabinet", (0.4, 0.2)), graspable=True),
        ObjectSpec("obj_distractor", _FOOD, in_cabinet("cabinet", (0.4, 0.2), pos=(0.0, 1.0)), graspable=True),
        ObjectSpec("digital_scale", ("digital_scale",), on_counter("cabinet", (0.3, 0.3))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_WEIGHED.parts, DoorsClosed("cabinet")),
    stages=(
        Stage("pick_place", "place", "digital_scale", object="obj", until=_WEIGHED),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the {obj} from the cabinet upright on the digital scale and close the cabinet.",
    paraphrases=(
        "Weigh the {obj}: it stands on the scale, and the cabinet is shut.",
        "Fetch the {obj} out of the cabinet, place it upright on the scale, then shut the {doors}.",
        "The {obj} in the cabinet should stand on the digital scale. Leave the cabinet closed.",
        "Get the {obj} onto the kitchen scale, the right way up, and close the {doors} of the cabinet.",
    ),
)

_WANTED, _OTHER = "measuring_cup_{size}", "measuring_cup_{_other}"
_TAKEN = AllOf(ObjectTouches(_WANTED, "counter"), GripperFar(_WANTED))


def _cup(name: str, scale: float, same: str = "") -> ObjectSpec:
    start = Placement("drawer", size=(0.5, 0.4), pos=(-1.0, 0.0))
    return ObjectSpec(
        name, ("measuring_cup",), start, graspable=True, scale=scale, same_category_as=same, same_model=bool(same)
    )


CHOOSE_MEASURING_CUP = Task(
    name="ChooseMeasuringCup",
    summary="The measuring cup of the size that is meant is on the counter, the other one is not, the gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
    robot_start=RobotStart("drawer", beside=True),
    choices=(
        Choice(
            "size",
            {"small": {"_other": "large", "which": "smaller"}, "large": {"_other": "small", "which": "larger"}},
        ),
    ),
    objects=(
        _cup("measuring_cup_small", 0.75),
        _cup("measuring_cup_large", 1.4, same="measuring_cup_small"),
    ),
    goal=AllOf(*_TAKEN.parts, Not(ObjectTouches(_OTHER, "counter"))),
    stages=(
        Stage("drawers", "open", "drawer"),
        Stage("pick_place", "place", "counter", object=_WANTED, text="put the {which} measuring cup on the counter"),
    ),
    instruction="Open the drawer to the {side} and put the {which} of its two measuring cups on the counter.",
    paraphrases=(
        "From the {side} drawer, which is shut, bring the {which} measuring cup to the counter.",
        "The recipe asks for the {which} measuring cup; it is in the drawer on the {side}.",
        "Leave the other measuring cup in the {side} drawer, and take out the {which} one.",
        "Pull out the drawer to your {side}; its {which} measuring cup goes on the counter above.",
    ),
)

TASKS = (CHOOSE_MEASURING_CUP, WEIGH_INGREDIENTS)
