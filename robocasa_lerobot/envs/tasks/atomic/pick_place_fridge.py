"""Pick and place inside the fridge: between its shelves and its drawers."""

from robocasa_lerobot.envs.kitchens.fixtures.regions import USABLE_SHELF
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectInside,
)
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
from robocasa_lerobot.envs.tasks.atomic.common import place
from robocasa_lerobot.envs.tasks.atomic.racks import DRAWER
from robocasa_lerobot.envs.tasks.task import Task

_FRIDGE_FAR_M = 0.15


FRIDGE = (
    Task(
        name="PickPlaceFridgeShelfToDrawer",
        summary="The object is inside the highest drawer of the fridge, the gripper 15 cm away.",
        fixtures=(FixtureSpec("fridge", "fridge_with_drawer"),),
        robot_start=RobotStart("fridge", setback=0.3),
        choices=(Choice("level", {"highest": {}, "second_highest": {}}), DRAWER),
        objects=(
            ObjectSpec(
                "obj",
                ("vegetable", "fruit"),
                Placement(
                    "fridge",
                    region=SampleRegion(name="fridge_shelf:{level}"),
                    size=(0.4, 0.15),
                    pos=(0.0, -1.0),
                ),
                graspable=True,
                properties=("fridgable",),
            ),
            ObjectSpec(
                "distr",
                ("any",),
                Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.15), pos=(0.0, -0.5)),
                properties=("fridgable",),
                exclude=("vegetable", "fruit"),
            ),
        ),
        initial=(InitialOpenness("fridge", 1.0, 1.0, part="fridge"), PartAt("fridge", "{drawer}", (0.8, 1.0))),
        goal=AllOf(ObjectInside("obj", "fridge", region="{drawer}"), GripperFar("obj", _FRIDGE_FAR_M)),
        stages=place(target="fridge", part="{drawer}"),
        instruction="Take the {obj} off the fridge shelf and put it into the fridge drawer.",
        paraphrases=(
            "The {obj} belongs in the drawer of the fridge.",
            "Move the {obj} from its shelf down to the refrigerator's drawer.",
            "Drop the {obj} into the open drawer inside the fridge.",
            "Sort the {obj} into the fridge drawer.",
        ),
    ),
    Task(
        name="PickPlaceFridgeDrawerToShelf",
        summary="The object is on a shelf of the fridge, the gripper 15 cm away.",
        fixtures=(FixtureSpec("fridge", "fridge_with_drawer"),),
        robot_start=RobotStart("fridge", setback=0.3),
        choices=(DRAWER,),
        objects=(
            ObjectSpec(
                "obj",
                ("vegetable", "fruit"),
                Placement("fridge", region=SampleRegion(name="{drawer}"), size=(0.4, 0.2), pos=(0.0, 0.25)),
                graspable=True,
                properties=("fridgable",),
            ),
            ObjectSpec(
                "distr",
                ("any",),
                Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.2), pos=(0.0, 0.5)),
                properties=("fridgable",),
                exclude=("vegetable", "fruit"),
            ),
        ),
        initial=(InitialOpenness("fridge", 1.0, 1.0, part="fridge"), PartAt("fridge", "{drawer}", (0.8, 0.8))),
        goal=AllOf(
            ObjectInside("obj", "fridge", region="fridge_shelf", lower=0.9, height=USABLE_SHELF),
            GripperFar("obj", _FRIDGE_FAR_M),
        ),
        stages=place(target="fridge", part="fridge_shelf"),
        instruction="Take the {obj} out of the fridge drawer and put it on a shelf of the fridge.",
        paraphrases=(
            "The {obj} belongs on a shelf of the fridge.",
            "Move the {obj} from the refrigerator's drawer up to a shelf.",
            "Lay the {obj} from the drawer on any shelf inside the fridge.",
            "Sort the {obj} onto a shelf in the fridge.",
        ),
    ),
)

TASKS = (*FRIDGE,)
