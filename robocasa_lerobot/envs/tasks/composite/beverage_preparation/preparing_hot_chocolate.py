"""Sweeten hot chocolate."""

from robocasa_lerobot.envs.predicates import AllOf, ForEach, Goal, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

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


def _in_saucepan(name: str) -> Goal:
    return ObjectOn(name, "saucepan")


SWEETEN_HOT_CHOCOLATE = Task(
    name="SweetenHotChocolate",
    summary="All the sugar cubes are in the saucepan of hot chocolate, the gripper away from it.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("burner", of="stove", without="rear"),),
    objects=(
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            Placement(
                "stove",
                region=SampleRegion(name="{burner}"),
                size=(0.05, 0.05),
                rotation=HANDLE_TO_FRONT,
                ensure_inside=False,
            ),
            graspable=True,
            filled="hot_chocolate",
        ),
        ObjectSpec(
            "sugar",
            ("sugar_cube",),
            on_counter("stove", (0.25, 0.25), loc="left_right"),
            count=(1, 3),
            graspable=True,
            repeats=True,
        ),
    ),
    initial=(BurnerAt("stove", "{burner}", "on"),),
    goal=AllOf(ForEach("sugar", _in_saucepan), GripperFar("saucepan")),
    stages=(
        EachStage(
            "sugar",
            lambda name: (
                Stage(
                    "pick_place",
                    "place",
                    "saucepan",
                    object=name,
                    until=AllOf(_in_saucepan(name), GripperFar("saucepan")),
                ),
            ),
        ),
    ),
    instruction="Put {sugar} from the counter into the saucepan of hot chocolate.",
    paraphrases=(
        "Sweeten the hot chocolate on the stove with {sugar}.",
        "The hot chocolate is not sweet yet: {sugar} into the saucepan.",
        "All the sugar beside the stove belongs in the saucepan.",
        "Drop {sugar} into the hot chocolate that is on the burner.",
    ),
)

TASKS = (ADD_MARSHMALLOW, SWEETEN_HOT_CHOCOLATE)
