"""OpenDrawer and CloseDrawer: one top drawer, the robot standing beside it."""

from robocasa_lerobot.envs.predicates import DrawerClosed, DrawerOpen
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    InsideOf,
    ObjectSpec,
    OnCounter,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_FIXTURES = (FixtureSpec("drawer", "drawer_top"),)
# The base is placed as exactly as the original does for tasks beside a fixture.
_START = RobotStart("drawer", beside=True, deviation=(0.05, 0.05))
_OBJECTS = (
    ObjectSpec(
        "drawer_obj",
        ("tool", "utensil"),
        InsideOf("drawer", size=(0.30, 0.30), at=-0.75),
        graspable=True,
        max_height=0.10,
    ),
    ObjectSpec(
        "distr_counter", ("any",), OnCounter("drawer", size=(1.0, 0.5), at="front", offset=(0.0, 0.1)), count=(1, 3)
    ),
)

OPEN_DRAWER = Task(
    name="OpenDrawer",
    summary="Goal: pull a closed top drawer out. Success: at least 95 % of its full travel.",
    fixtures=_FIXTURES,
    robot_start=_START,
    objects=_OBJECTS,
    initial=(InitialOpenness("drawer", 0.0, 0.0),),
    goal=DrawerOpen("drawer", at_least=0.95),
    stages=(Stage("drawers", "open", "drawer"),),
    instruction="Pull the {side} drawer out as far as it goes.",
    paraphrases=(
        "Slide out the drawer on your {side}.",
        "The {side} drawer should be wide open.",
        "Take the handle of the {side} drawer and draw it towards you.",
        "Get the drawer to the {side} fully extended.",
    ),
)

CLOSE_DRAWER = Task(
    name="CloseDrawer",
    summary="Goal: push an open top drawer in. Success: at most 5 % of its full travel left.",
    fixtures=_FIXTURES,
    robot_start=_START,
    objects=_OBJECTS,
    initial=(InitialOpenness("drawer", 0.90, 1.0),),
    goal=DrawerClosed("drawer", at_most=0.05),
    stages=(Stage("drawers", "close", "drawer"),),
    instruction="Push the {side} drawer shut.",
    paraphrases=(
        "Slide the drawer on your {side} back in.",
        "The {side} drawer should be closed.",
        "Put the {side} drawer back all the way into the cabinet.",
        "Make sure that no gap is left at the {side} drawer.",
    ),
)

TASKS = (OPEN_DRAWER, CLOSE_DRAWER)
