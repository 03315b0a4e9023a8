"""Serve food."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    GripperTouches,
    Never,
    ObjectOn,
    ObjectTouches,
    OnBurner,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SERVED = ObjectOn("vegetable", "plate")
_BACK = OnBurner("vegetable_container", "stove", within=0.08)

PAN_TRANSFER = Task(
    name="PanTransfer",
    summary=(
        "The vegetable is on the plate and was never touched by the gripper, the pan is back on a burner, the "
        "gripper away from it."
    ),
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.3, 0.4))),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "vegetable_container",
            ("pan",),
            Placement(
                "stove",
                region=SampleRegion(name="any", height=(0.7, 1.2)),
                size=(0.05, 0.05),
                pos=(0.0, 0.0),
                rotation=HANDLE_TO_FRONT,
                ensure_inside=False,
            ),
            graspable=True,
        ),
        ObjectSpec("vegetable", ("vegetable",), Placement(object="vegetable_container"), properties=("cookable",)),
        ObjectSpec("plate", ("plate",), on_counter("stove", (0.3, 0.3), loc="left_right")),
        ObjectSpec(
            "dstr_dining",
            ("any",),
            Placement("counter", size=(0.3, 0.2), pos=(0.5, 0.5)),
            exclude=("plate", "pan", "vegetable"),
        ),
    ),
    goal=AllOf(
        _SERVED,
        ObjectTouches("vegetable_container", "stove"),
        _BACK,
        GripperFar("vegetable_container"),
        Never(GripperTouches("vegetable")),
    ),
    stages=(
        Stage("pick_place", "pick", "stove", object="vegetable_container"),
        Stage(
            "pick_place",
            "pour",
            "plate",
            object="vegetable_container",
            until=_SERVED,
            text="pour the {vegetable} out of the pan onto the plate",
        ),
        Stage(
            "pick_place",
            "place",
            "stove",
            object="vegetable_container",
            until=AllOf(_BACK, GripperFar("vegetable_container")),
        ),
    ),
    instruction="Pick up the pan, pour the {vegetable} onto the plate and set the pan down on the stove again.",
    paraphrases=(
        "Serve the {vegetable} from the pan on the plate, and return the pan to a burner.",
        "Tilt the pan over the plate so that the {vegetable} slides out; then the pan goes back to the stove.",
        "Without touching the {vegetable}, get it out of the pan onto the plate. Leave the pan on the stove.",
        "The {vegetable} is done: empty the pan onto the plate beside the stove and put it back.",
    ),
)

TASKS = (PAN_TRANSFER,)
