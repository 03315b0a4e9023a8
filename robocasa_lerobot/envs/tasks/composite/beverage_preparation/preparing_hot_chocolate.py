"""Sweeten hot chocolate."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Task

_IN_MUG = AllOf(ObjectOn("marshmallow", "mug"), GripperFar("mug"))

ADD_MARSHMALLOW = Task(
    name="AddMarshmallow",
    summary="The marshmallow is in the mug of hot chocolate, the gripper away from it.",
    fixtures=(
        FixtureSpec("counter", "counter"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("counter", at_object="marshmallow"),
    objects=(
        ObjectSpec(
            "marshmallow",
            ("marshmallow",),
            Placement(
                "counter",
                region=SampleRegion(top_size=(0.4, 0.4)),
                size=(0.4, 0.4),
                pos=(0.0, -1.0),
                try_to_place_in="plate",
            ),
            graspable=True,
        ),
        ObjectSpec("mug", ("mug",), before_stool((0.2, 0.2)), graspable=True, filled="hot_chocolate"),
    ),
    goal=_IN_MUG,
    stages=fetch("marshmallow", "counter", "mug", until=_IN_MUG),
    instruction="Take the marshmallow from its plate to the dining counter and drop it into the mug of hot chocolate.",
    paraphrases=(
        "The hot chocolate on the dining counter lacks the marshmallow from the counter.",
        "Sweeten the hot chocolate at the dining counter with the marshmallow on the plate.",
        "Pick up the marshmallow, carry it to the dining counter and put it into the mug.",
        "A marshmallow belongs in the mug: take the one on the plate there.",
    ),
)

TASKS = (ADD_MARSHMALLOW,)
