"""Brew hot drinks."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, OnBurner
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TURN, counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

# Knobs of stoves are off at the start, as no initial state says otherwise.
KETTLE_BOILING = Task(
    name="KettleBoiling",
    summary="The kettle stands on a burner whose knob is on, the gripper away.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.2, 0.2))),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "obj",
            ("kettle_non_electric",),
            on_counter("stove", (0.35, 0.35), loc="left_right"),
            graspable=True,
        ),
        ObjectSpec(
            "stove_distr",
            ("pan", "pot"),
            Placement(
                "stove",
                region=SampleRegion(name="any", height=(0.7, 1.2)),
                size=(0.02, 0.02),
                pos=(0.0, 0.0),
                rotation=HANDLE_TURN,
                ensure_inside=False,
            ),
            graspable=True,
        ),
    ),
    goal=AllOf(OnBurner("obj", "stove", lit=True), GripperFar("obj")),
    stages=(
        Stage("pick_place", "place", "stove", object="obj"),
        Stage("knobs", "on", "stove", object="obj"),
    ),
    instruction="Move the kettle from the counter to a free burner of the stove and turn that burner on.",
    paraphrases=(
        "Boil water: the kettle beside the stove goes on a burner, and that burner is lit.",
        "Set the kettle on the stove and switch on the burner below it.",
        "Get the kettle heating on one of the stove's burners.",
        "Pick up the kettle, stand it on an empty burner, and use that burner's knob.",
    ),
)

TASKS = (KETTLE_BOILING,)
