"""Toast bread."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectOn,
    ObjectTouches,
    Once,
    PartWithin,
    StateIs,
)
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_SLOT = ObjectTouches("obj", "toaster", part="lever{_side}")  # the lift below the slot is of the lever
_TOASTING = Once(AllOf(_IN_SLOT, StateIs("toaster", "on{_side}")), label="bread_toasted")
# After the toasting, still in the slot: it has popped up there.
_POPPED = Once(
    AllOf(
        _TOASTING,
        _IN_SLOT,
        StateIs("toaster", "on{_side}", value=False),
        PartWithin("toaster", "lever{_side}", high=0.30, label="up"),
    ),
    label="bread_popped_up",
)

GET_TOASTED_BREAD = Task(
    name="GetToastedBread",
    summary="The bread was toasted, has popped up in its slot and lies on the plate, the gripper away.",
    fixtures=(
        FixtureSpec("toaster", "toaster"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("toaster"),
    choices=(Choice("slot", of="toaster"),),
    objects=(
        ObjectSpec(
            "obj",
            ("sandwich_bread",),
            Placement("toaster", region=SampleRegion(name="slot{slot}"), rotation=(0.0, 0.0), margin=0.0, slot=True),
            scale=(1.0, 1.0, 1.15),
            upright=True,
        ),
        ObjectSpec(
            "plate",
            ("plate",),
            Placement("dining_counter", region=SampleRegion(ref="stool"), size=(0.5, 0.3), pos=(0.0, "ref")),
        ),
    ),
    goal=AllOf(_TOASTING, _POPPED, ObjectOn("obj", "plate"), GripperFar("obj")),
    stages=(
        Stage(
            "levers",
            "press",
            "toaster",
            part="lever{_side}",
            until=_POPPED,
            text="press the lever of the toaster and wait until the bread pops up",
        ),
        Stage("pick_place", "pick", "toaster", object="obj"),
        Stage("navigation", "drive", "plate", object="obj"),
        Stage("pick_place", "place", "plate", object="obj"),
    ),
    instruction=(
        "Push the toaster's lever down, wait for the bread to pop up, and take it to the plate on the dining counter."
    ),
    paraphrases=(
        "Toast the bread, and when it is done serve it on the plate at the dining counter.",
        "Start the toaster; as soon as the slice is up again, carry it over to the dining counter's plate.",
        "The slice in the toaster should be toasted and end on the plate on the dining counter.",
        "Press the toaster down, let it finish, then lay the toast on the plate in front of the stool.",
    ),
)

TASKS = (GET_TOASTED_BREAD,)
