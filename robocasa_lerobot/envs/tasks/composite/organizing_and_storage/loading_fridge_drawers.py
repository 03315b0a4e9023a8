"""Load the fridge's drawers."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch_in_turn
from robocasa_lerobot.envs.tasks.task import Stage, Task

_VEGETABLES, _DRAWER = ("vegetable1", "vegetable2"), "{drawer}"
_SHUT = PartWithin("fridge", _DRAWER, high=0.02, label="closed")

PLACE_VEGGIES_IN_DRAWER = Task(
    name="PlaceVeggiesInDrawer",
    summary="Both vegetables are in the fridge's drawer, which is shut, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge_with_drawer"), counter_near("fridge")),
    robot_start=RobotStart("counter", at_object="vegetable1"),
    choices=(Choice("drawer", of="fridge"),),
    objects=(
        *(
            ObjectSpec(
                name,
                ("vegetable",),
                on_counter(
                    "fridge",
                    (0.5, 0.2),
                    pos=(x, -1.0),
                    reuse_region_from="" if name == "vegetable1" else "vegetable1",
                ),
                graspable=True,
                properties=("fridgable",),
                repeats=True,
            )
            for name, x in zip(_VEGETABLES, (-0.25, 0.25), strict=True)
        ),
        ObjectSpec(
            "distractor_item",
            ("any",),
            Placement("counter", region=SampleRegion(ref="fridge"), pos=(None, 1.0)),
            exclude=("vegetable",),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.5, 0.5), pos=(None, 1.0)),
            properties=("fridgable",),
        ),
    ),
    initial=(InitialOpenness("fridge", 1.0, 1.0, part="fridge"), PartAt("fridge", _DRAWER, (0.5, 0.8))),
    goal=AllOf(
        *(ObjectInside(name, "fridge", region=_DRAWER) for name in _VEGETABLES), *map(GripperFar, _VEGETABLES), _SHUT
    ),
    stages=(
        *fetch_in_turn(_VEGETABLES, "counter", "fridge", part=_DRAWER, along=True),
        Stage("racks", "push", "fridge", part=_DRAWER, until=_SHUT),
    ),
    instruction="Put {vegetable1+vegetable2} into the drawer of the fridge that is out, and push the drawer in.",
    paraphrases=(
        "The fridge's open drawer is for vegetables: put the two from the counter into it and close it.",
        "Bring {vegetable1+vegetable2} from the counter to the drawer in the fridge, then shut that drawer.",
        "Fill the drawer in the fridge with both vegetables, and slide it back.",
        "Both vegetables on the counter belong in the fridge drawer, which is closed afterwards.",
    ),
)

TASKS = (PLACE_VEGGIES_IN_DRAWER,)
