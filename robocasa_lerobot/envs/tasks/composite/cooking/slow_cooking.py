"""Cook slowly, under a lid and over a low flame."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    BurnerLevel,
    GripperFar,
    ObjectOn,
    ObjectTouchesAnyCounter,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.cooking.lids import (
    COVERED,
    COVERS,
    FRONT_BURNER,
    LID,
    ON_ITS_PAN,
    ON_LIT_BURNER,
    STOVE_AND_COUNTER,
    UNCOVERS,
    lid,
    on_plate,
    saucepan,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_LOW = BurnerLevel("stove", "{knob}", "low")
_VEGETABLES = ("tomato", "mushroom", "carrot", "potato", "sweet_potato", "broccoli")
_ADDED = ("vegetable1", "vegetable2")

ADD_TO_SOUP_POT = Task(
    name="AddToSoupPot",
    summary=(
        "Both vegetables are in the saucepan, its lid lies level on it, it stands on its burner, which is on low, and "
        "the gripper is away from the lid."
    ),
    fixtures=STOVE_AND_COUNTER,
    robot_start=RobotStart("stove"),
    choices=(FRONT_BURNER,),
    objects=(
        saucepan("soup"),
        lid(ON_ITS_PAN),
        ObjectSpec("vegetable_plate", ("plate",), on_counter("stove", (0.4, 0.35), loc="left_right")),
        *(ObjectSpec(name, _VEGETABLES, on_plate("vegetable_plate"), graspable=True) for name in _ADDED),
    ),
    initial=(BurnerAt("stove", "{knob}", "low"),),
    goal=AllOf(ON_LIT_BURNER, _LOW, *(ObjectOn(name, "saucepan") for name in _ADDED), *COVERED.parts),
    stages=(
        UNCOVERS,
        *(Stage("pick_place", "place", "saucepan", object=name) for name in _ADDED),
        COVERS,
    ),
    instruction=(
        "Take the lid off the soup, add the {vegetable1} and the {vegetable2} from the plate, and put the lid back on "
        "the saucepan."
    ),
    paraphrases=(
        "The soup lacks {vegetable1} and {vegetable2}: open the saucepan, put both in, close it.",
        "Lid off, {vegetable1} and {vegetable2} from the plate into the saucepan, lid on again.",
        "Add what lies on the plate to the soup on the {knob} burner; the lid covers the saucepan again at the end.",
        "Both vegetables should simmer in the soup, under its lid.",
    ),
)

BEGIN_SLOW_COOKING = Task(
    name="BeginSlowCooking",
    summary=(
        "The burner under the saucepan is on low, and the lid lies level on the saucepan, which stands on its burner; "
        "the gripper is away from the lid."
    ),
    fixtures=STOVE_AND_COUNTER,
    robot_start=RobotStart("stove"),
    choices=(FRONT_BURNER,),
    objects=(
        saucepan("broth", graspable=True),
        lid(on_counter("stove", (0.3, 0.3), loc="left_right")),
    ),
    goal=AllOf(ON_LIT_BURNER, _LOW, *COVERED.parts),
    stages=(Stage("knobs", "low", "stove", part="knob_{knob}", until=_LOW), COVERS),
    instruction="Turn the burner under the saucepan of broth on at low heat, then cover the saucepan with its lid.",
    paraphrases=(
        "Start to cook the broth slowly: low flame, lid on.",
        "The broth is to simmer, covered, over a low {knob} burner.",
        "Give the saucepan a little heat from its burner and close it with the lid from the counter.",
        "Set the {knob} burner to low; the lid beside the stove belongs on the saucepan.",
    ),
)

STOP_SLOW_COOKING = Task(
    name="StopSlowCooking",
    summary="The burner is off, the lid lies on a counter, and the gripper is away from the lid.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(FRONT_BURNER,),
    objects=(saucepan("broth", graspable=True), lid(ON_ITS_PAN)),
    initial=(BurnerAt("stove", "{knob}", "low"),),
    goal=AllOf(StateIs("stove", "{knob}_on", value=False), ObjectTouchesAnyCounter(LID), GripperFar(LID)),
    stages=(Stage("knobs", "off", "stove", part="knob_{knob}"), UNCOVERS),
    instruction="Turn off the burner under the saucepan, take the lid off and put it on a counter.",
    paraphrases=(
        "The broth has cooked for long enough: burner off, lid on the counter.",
        "End the slow cooking. The {knob} burner goes out, and the saucepan stays open.",
        "No more heat for the saucepan, and its lid belongs on a counter.",
        "Switch the {knob} burner off and let the broth cool with its lid aside on the counter.",
    ),
)

TASKS = (ADD_TO_SOUP_POT, BEGIN_SLOW_COOKING, STOP_SLOW_COOKING)
