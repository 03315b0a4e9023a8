"""Make tea, and bring what goes with it."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTilt, ObjectTouches
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

_LEVEL = ObjectTilt("strainer", high=float(np.deg2rad(30.0)), label="level")
_STANDS = AllOf(ObjectOn("strainer", "bowl"), _LEVEL, GripperFar("strainer"))
_ALONG = (0.0, 0.0)  # radians: our strainers lie along x, and cabinets are not as deep as these are long

STRAINER_SETUP = Task(
    name="StrainerSetup",
    summary="The strainer is in the bowl, tilted by 30 degrees at most, the gripper away from it.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("bowl", ("bowl",), on_counter("cabinet", (1.0, 0.4)), graspable=True),
        ObjectSpec("strainer", ("strainer",), in_cabinet("cabinet", (1.0, 0.3), rotation=_ALONG), graspable=True),
    ),
    goal=_STANDS,
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "bowl", object="strainer", until=_STANDS),
    ),
    instruction="Open the cabinet, take out the strainer and put it upright into the bowl.",
    paraphrases=(
        "Prepare to strain tea: the cabinet's strainer belongs in the bowl, the right way up.",
        "The bowl on the counter should have the strainer in it; that is in the closed cabinet.",
        "Fetch the strainer out of the cabinet and set it level in the bowl.",
        "Put the strainer, with its opening up, into the bowl below the cabinet where it is.",
    ),
)

ARRANGE_TEA_ACCOMPANIMENTS = Task(
    name="ArrangeTeaAccompaniments",
    summary="Milk and sugar cube are on the tray, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("counter", "counter", size=(0.6, 0.6))),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "milk",
            ("milk",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.4, 0.2),
                pos=(0.0, -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "distr",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.2), pos=(0.0, 1.0)),
            properties=("fridgable",),
            exclude=("milk",),
        ),
        ObjectSpec(
            "tray",
            ("tray",),
            Placement("counter", region=SampleRegion(top_size=(0.6, 0.4)), size=(0.5, 0.5), pos=(0.0, -1.0)),
        ),
        ObjectSpec(
            "sugar_cube",
            ("sugar_cube",),
            Placement("counter", size=(0.5, 0.5), pos=(0.0, -1.0), reuse_region_from="tray"),
            graspable=True,
            scale=1.3,
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(ObjectOn("milk", "tray"), ObjectOn("sugar_cube", "tray"), GripperFar("tray")),
    stages=(
        *fetch("milk", "fridge", "tray"),
        Stage("pick_place", "place", "tray", object="sugar_cube"),
    ),
    instruction="Bring the milk from the fridge to the tray, and put the sugar cube beside it on the tray too.",
    paraphrases=(
        "Milk and sugar for the tea go on the tray: the {milk} is in the fridge, the sugar cube by the tray.",
        "The tray on the counter should carry the fridge's milk and the sugar cube.",
        "Carry the milk out of the open fridge to the tray, then add the sugar cube.",
        "Complete the tea tray with the milk from the fridge and the sugar cube next to it.",
    ),
)

SERVE_TEA = Task(
    name="ServeTea",
    summary="The mug of tea stands on its saucer on the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("microwave", "microwave"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec("teacup", ("mug",), Placement("microwave", size=(0.3, 0.2)), graspable=True, filled="tea"),
        ObjectSpec("saucer", ("plate",), before_stool((0.5, 0.3), counter="dining_table"), scale=(0.6, 0.6, 1.0)),
    ),
    initial=(InitialOpenness("microwave", 0.9, 1.0),),
    goal=AllOf(ObjectOn("teacup", "saucer"), ObjectTouches("saucer", "dining_table"), GripperFar("teacup")),
    stages=fetch("teacup", "microwave", "saucer"),
    instruction="Take the mug of tea out of the microwave and set it on the saucer on the dining counter.",
    paraphrases=(
        "The tea in the microwave is warm: serve it on the saucer at the dining counter.",
        "Carry the microwave's mug to the dining counter, onto its saucer.",
        "The saucer on the dining counter waits for the mug in the microwave.",
        "Bring the tea from the open microwave to the small plate on the dining counter.",
    ),
)

TASKS = (ARRANGE_TEA_ACCOMPANIMENTS, SERVE_TEA, STRAINER_SETUP)
