"""Serve drinks at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_GLASS = AllOf(ObjectOn("straw", "glass_cup", within=0.06), GripperFar("straw"))

DELIVER_STRAW = Task(
    name="DeliverStraw",
    summary="The straw stands in the glass: it touches it, 6 cm from its middle at most; the gripper away.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("drawer", "drawer_top"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("drawer"),
    objects=(
        ObjectSpec(
            "straw",
            ("straw",),
            Placement("drawer", size=(0.3, 0.2), pos=(0.0, -0.25)),
            graspable=True,
            scale=(1.5, 1.0, 2.0),
        ),
        ObjectSpec(
            "glass_cup",
            ("glass_cup",),
            Placement("dining_counter", region=SampleRegion(ref="stool"), size=(0.25, 0.15), pos=("ref", "ref")),
        ),
    ),
    goal=_IN_GLASS,
    stages=(
        Stage("drawers", "open", "drawer"),
        Stage("pick_place", "pick", "drawer", object="straw"),
        Stage("navigation", "drive", "glass_cup", object="straw"),
        Stage("pick_place", "place", "glass_cup", object="straw", until=_IN_GLASS),
    ),
    instruction="Take the straw out of the drawer and put it into the glass on the dining counter.",
    paraphrases=(
        "Bring a straw from the drawer to the glass at the dining counter.",
        "The glass on the dining counter lacks its straw, which is in the drawer.",
        "Open the drawer, pick up the straw and stand it in the dining counter's glass.",
        "Serve the drink with a straw: get it from the drawer and slip it into the glass.",
    ),
)

TASKS = (DELIVER_STRAW,)
