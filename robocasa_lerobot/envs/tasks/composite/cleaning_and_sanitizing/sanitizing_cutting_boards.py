"""Clean cutting boards."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    Not,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
    StateIs,
    StepsWhile,
    Strokes,
    UnderWater,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SCRUBBED = AllOf(Strokes("sponge", "cutting_board"), GripperFar("sponge", 0.15))

SCRUB_CUTTING_BOARD = Task(
    name="ScrubCuttingBoard",
    summary="The held sponge has rubbed the board at 5 places or more over 10 cm, and the gripper has let it go.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="sponge"),
    objects=(
        ObjectSpec(
            "cutting_board", ("cutting_board",), on_counter("sink", (0.5, 0.5), loc="left_right", rotation=(0.0, 0.0))
        ),
        ObjectSpec(
            "sponge",
            ("sponge",),
            Placement("counter", reuse_region_from="cutting_board", size=(0.3, 0.3), pos=(0.0, -1.0)),
            graspable=True,
        ),
    ),
    goal=_SCRUBBED,
    stages=(
        Stage("pick_place", "pick", "counter", object="sponge"),
        Stage(
            "pick_place",
            "wipe",
            "cutting_board",
            object="sponge",
            until=_SCRUBBED,
            text="scrub the cutting board with the sponge and let go of it",
        ),
    ),
    instruction="Pick up the sponge, rub the cutting board with it in several places and release the sponge.",
    paraphrases=(
        "Scrub the cutting board with the sponge from the counter, then let the sponge go.",
        "The cutting board is dirty: wipe it all along with the sponge, and leave the sponge.",
        "Clean the board with the sponge that lies on the counter.",
        "Use the sponge to scrub over the board, and put the sponge down when you are done.",
    ),
)

_STRAIGHT = (0.0, 0.0)


def _off(name: str) -> Stage:
    gone = AllOf(Not(ObjectOn(name, "cutting_board")), ObjectTouches(name, "counter"), GripperFar(name))
    return Stage("pick_place", "place", "counter", object=name, until=gone)


REMOVE_CUTTING_BOARD_ITEMS = Task(
    name="RemoveCuttingBoardItems",
    summary="Neither the vegetable nor the meat is on the cutting board, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="cutting_board"),
    objects=(
        ObjectSpec(
            "cutting_board", ("cutting_board",), on_counter("sink", (0.5, 0.5), loc="left_right", rotation=_STRAIGHT)
        ),
        ObjectSpec("vegetable", ("vegetable",), Placement(object="cutting_board"), graspable=True),
        ObjectSpec("meat", ("meat",), Placement(object="cutting_board"), graspable=True),
    ),
    goal=AllOf(
        Not(ObjectOn("vegetable", "cutting_board")),
        Not(ObjectOn("meat", "cutting_board")),
        GripperFar("vegetable"),
        GripperFar("meat"),
    ),
    stages=(_off("vegetable"), _off("meat")),
    instruction="Take the {vegetable} and the {meat} off the cutting board.",
    paraphrases=(
        "The cutting board must be free: move {vegetable} and {meat} aside.",
        "Before the board can be cleaned, the {vegetable} and the {meat} have to leave it.",
        "Put the {vegetable}, and then the {meat}, from the board on the counter.",
        "Nothing should lie on the cutting board any more, neither {vegetable} nor {meat}.",
    ),
)


def _by_board(name: str) -> AllOf:
    return AllOf(Near(name, "cutting_board", 0.35), ObjectTouchesAnyCounter(name), GripperFar(name))


def _beside_board(name: str) -> Stage:
    text = f"put the {{{name}}} on the counter beside the cutting board"
    return Stage("pick_place", "place", "counter_cab", object=name, until=_by_board(name), text=text)


SANITIZE_PREP_CUTTING_BOARD = Task(
    name="SanitizePrepCuttingBoard",
    summary="Spray and dish brush are on the counter, 35 cm from the cutting board at most, the gripper away.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet", name="counter_cab"),
        counter_near("sink", name="counter_sink"),
    ),
    robot_start=RobotStart("counter_cab", at_object="cutting_board"),
    objects=(
        ObjectSpec(
            "cutting_board",
            ("cutting_board",),
            on_counter("cabinet", (0.5, 0.5), counter="counter_cab", rotation=_STRAIGHT),
        ),
        ObjectSpec("spray", ("spray",), in_cabinet("cabinet", (0.3, 0.3)), graspable=True),
        ObjectSpec(
            "dish_brush",
            ("dish_brush",),
            on_counter("sink", (0.3, 0.5), loc="left_right", counter="counter_sink"),
            graspable=True,
            scale=(1.0, 1.0, 1.2),
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_by_board("spray").parts, *_by_board("dish_brush").parts, ObjectTouchesAnyCounter("cutting_board")),
    stages=(
        _beside_board("spray"),
        Stage("navigation", "drive", "dish_brush"),
        Stage("pick_place", "pick", "counter_sink", object="dish_brush"),
        Stage("navigation", "drive", "cutting_board", object="dish_brush"),
        _beside_board("dish_brush"),
    ),
    instruction="Put the spray from the cabinet, then the dish brush from beside the sink, next to the cutting board.",
    paraphrases=(
        "The cutting board will be cleaned: spray and dish brush should lie ready beside it.",
        "Bring the cabinet's spray and the sink's dish brush to the cutting board.",
        "Next to the cutting board there should be the spray out of the cabinet and the dish brush.",
        "Collect two things at the cutting board, the spray first and the dish brush after it.",
    ),
)

_RINSED = StepsWhile(
    AllOf(UnderWater("cutting_board", "sink"), PartWithin("sink", "handle_temp", low=0.6, label="hot")),
    100,
    label="cutting_board_rinsed",
)

RINSE_CUTTING_BOARD = Task(
    name="RinseCuttingBoard",
    summary="Hot water has run over the cutting board for 100 steps, and runs no more.",
    fixtures=(FixtureSpec("sink", "sink"),),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "cutting_board",
            ("cutting_board",),
            Placement("sink", size=(1.0, 0.7), pos=(0.0, 1.0), rotation=(np.pi / 2, np.pi / 2)),
            properties=("washable",),
            scale=(1.0, 1.0, 1.5),
        ),
    ),
    goal=AllOf(_RINSED, StateIs("sink", "water_on", value=False)),
    stages=(
        Stage("levers", "hot", "sink", part="handle", until=_RINSED),
        Stage("levers", "off", "sink", part="handle"),
    ),
    instruction="Let hot water run over the cutting board in the sink for five seconds, then turn it off.",
    paraphrases=(
        "Rinse the cutting board with hot water, and close the faucet after a while.",
        "The board in the sink needs hot water over it; when it is rinsed, stop the water.",
        "Open the faucet, set it to hot, leave it running over the board, then shut it.",
        "Hot water should clean the cutting board. No water must run in the end.",
    ),
)

TASKS = (REMOVE_CUTTING_BOARD_ITEMS, RINSE_CUTTING_BOARD, SANITIZE_PREP_CUTTING_BOARD, SCRUB_CUTTING_BOARD)
