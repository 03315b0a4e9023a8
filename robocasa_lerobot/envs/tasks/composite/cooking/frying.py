"""Fry on the stove."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, OnBurner
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_PAN = ObjectOn("meat", "pan", within=0.07)

# The pan lies across the cabinet, which is not as deep as the pan is long.
SEARING_MEAT = Task(
    name="SearingMeat",
    summary="The pan stands on the burner that is named, which is on; the meat lies in the pan, the gripper away.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        counter_near("stove", size=(0.3, 0.4)),
        FixtureSpec("cabinet", "cabinet_double_door", near="stove"),
    ),
    robot_start=RobotStart("cabinet"),
    choices=(Choice("burner", of="stove"),),
    objects=(
        ObjectSpec(
            "pan",
            ("pan",),
            in_cabinet("cabinet", (0.8, 0.5), rotation=(-0.2, 0.2)),
            graspable=True,
        ),
        ObjectSpec(
            "meat",
            ("meat",),
            on_counter("stove", (0.3, 0.3), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
    ),
    initial=(BurnerAt("stove", "{burner}", "off"), InitialOpenness("cabinet", 0.9, 1.0)),
    goal=AllOf(OnBurner("pan", "stove", burner="{burner}", lit=True), _IN_PAN, GripperFar("meat")),
    stages=(
        Stage("pick_place", "place", "stove", object="pan", part="{burner}"),
        Stage("pick_place", "place", "pan", object="meat", until=AllOf(_IN_PAN, GripperFar("meat"))),
        Stage("knobs", "on", "stove", part="knob_{burner}"),
    ),
    instruction=(
        "Move the pan from the cabinet to the {burner} burner, put the {meat} into it and turn that burner on."
    ),
    paraphrases=(
        "Sear the {meat}: the pan in the cabinet goes on the {burner} burner, the {meat} in the pan, then light it.",
        "Fry the {meat} on the {burner} burner in the pan from the cabinet.",
        "Get the pan out of the cabinet, stand it on the {burner} burner, lay the {meat} in it and switch it on.",
        "The {meat} on the plate should be seared in the pan, over the lit {burner} burner.",
    ),
)

TASKS = (SEARING_MEAT,)
