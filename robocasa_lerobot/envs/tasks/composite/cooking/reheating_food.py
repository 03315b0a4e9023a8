"""Warm food up again."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    OnBurner,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

WAFFLE_REHEAT = Task(
    name="WaffleReheat",
    summary="The waffle is in the bowl, the bowl in the microwave, shut and running, the gripper off its button.",
    fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave")),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec("waffle_container", ("bowl",), on_counter("microwave", (0.3, 0.3)), graspable=True),
        # It leans on the wall of a bowl that is narrower than itself.
        ObjectSpec("waffle", ("waffle",), Placement(object="waffle_container", ensure_inside=False)),
    ),
    goal=AllOf(
        ObjectOn("waffle", "waffle_container"),
        ObjectInside("waffle_container", "microwave"),
        StateIs("microwave", "on"),
        DoorsClosed("microwave"),
        GripperFarFromPart("microwave", "start_button"),
    ),
    stages=(
        Stage("doors", "open", "microwave"),
        Stage("pick_place", "place", "microwave", object="waffle_container"),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction="Open the microwave, put the bowl with the waffle in, close the door and press the start button.",
    paraphrases=(
        "Reheat the waffle in its bowl in the microwave.",
        "The waffle is cold: the bowl goes into the microwave, the door is shut, the microwave started.",
        "Warm up the waffle on the counter with the microwave.",
        "Let the microwave run with the bowl and its waffle behind the closed door.",
    ),
)

HEAT_MUG = Task(
    name="HeatMug",
    summary="The mug is in the microwave, which is shut, the gripper away from the mug.",
    fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave")),
    robot_start=RobotStart("counter", at_object="obj"),
    objects=(
        ObjectSpec("obj", ("mug",), on_counter("microwave", (0.5, 0.2)), graspable=True, filled="coffee"),
        ObjectSpec("distr_counter", ("any",), on_counter("microwave", (1.0, 0.4))),
    ),
    initial=(InitialOpenness("microwave", 0.9, 1.0),),
    goal=AllOf(ObjectInside("obj", "microwave"), GripperFar("obj"), DoorsClosed("microwave")),
    stages=(*fetch("obj", "counter", "microwave"), Stage("doors", "close", "microwave")),
    instruction="Take the mug from the counter, put it into the open microwave and shut the door.",
    paraphrases=(
        "The drink in the mug is cold: into the microwave with it, and close that.",
        "Shut the mug that stands on the counter in the microwave.",
        "Get the mug ready to be heated, in the microwave behind its closed door.",
        "Place the filled mug inside the microwave and close it.",
    ),
)

_BOARD = "cutting_board"

MAKE_LOADED_POTATO = Task(
    name="MakeLoadedPotato",
    summary="Potato, cheese and condiment are on the cutting board, the gripper away from each.",
    fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave", size=(0.6, 0.6))),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec(
            "potato",
            ("potato",),
            Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False, try_to_place_in="plate"),
            graspable=True,
        ),
        ObjectSpec(
            _BOARD,
            ("cutting_board",),
            Placement(
                "counter",
                region=SampleRegion(ref="microwave", loc="nn", top_size=(0.6, 0.6)),
                size=(0.05, 0.05),
                pos=(0.0, 0.0),
                rotation=(np.pi / 2, np.pi / 2),
                ensure_inside=False,
            ),
        ),
        ObjectSpec(
            "condiment",
            ("condiment",),
            on_counter("microwave", (0.6, 0.5), pos=(0.0, -1.0), reuse_region_from=_BOARD),
            graspable=True,
        ),
        ObjectSpec(
            "cheese",
            ("cheese",),
            on_counter("microwave", (0.6, 0.5), pos=(0.0, -1.0), reuse_region_from=_BOARD),
            graspable=True,
        ),
    ),
    goal=AllOf(
        *(ObjectOn(name, _BOARD) for name in ("potato", "condiment", "cheese")),
        *(GripperFar(name) for name in ("potato", "condiment", "cheese")),
    ),
    stages=(
        Stage("doors", "open", "microwave"),
        *fetch("potato", "microwave", _BOARD),
        Stage("pick_place", "place", _BOARD, object="cheese"),
        Stage("pick_place", "place", _BOARD, object="condiment"),
    ),
    instruction=(
        "Open the microwave, put the potato from it on the cutting board, and add the {cheese} and the {condiment}."
    ),
    paraphrases=(
        "Make a loaded potato on the board: the one in the microwave, with {cheese} and {condiment} beside it.",
        "The potato in the closed microwave is hot; it goes on the cutting board, then {cheese} and {condiment} too.",
        "Bring together on the board: the microwave's potato, the {cheese}, the {condiment}.",
        "On the cutting board there should be the potato out of the microwave, the {condiment} and the {cheese}.",
    ),
)

_LIT = StateIs("stove", "{knob}_on")
_LIGHT = Stage("knobs", "on", "stove", part="knob_{knob}")

WARM_CROISSANT = Task(
    name="WarmCroissant",
    summary="The croissant lies in the pan, the burner below is on, the gripper away from the croissant.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "croissant",
            ("croissant",),
            on_counter("stove", (0.3, 0.3), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
        ObjectSpec("pan", ("pan",), on_burner()),
    ),
    goal=AllOf(_LIT, ObjectOn("croissant", "pan"), GripperFar("croissant")),
    stages=(Stage("pick_place", "place", "pan", object="croissant"), _LIGHT),
    instruction="Put the croissant from its plate into the pan on the stove and turn on the burner under the pan.",
    paraphrases=(
        "Warm the croissant up in the pan: into it, then light the {knob} burner.",
        "The croissant on the plate should be warmed in the pan on the {knob} burner.",
        "Lay the croissant in the pan and switch on the burner below it.",
        "With the croissant in the pan, turn the {knob} burner's knob on.",
    ),
)

_STRAIGHT_TO_FRONT = (1.45, 1.69)  # radians; our pans are as long as the place is deep
_ON_KNOB = OnBurner("pan", "stove", burner="{knob}", within=0.08)


def _beside_stove(name: str, along: float) -> ObjectSpec:
    return ObjectSpec(
        name, (name,), on_counter("stove", (0.35, 0.2), loc="left_right", pos=("ref", along)), graspable=True
    )


SIMMERING_SAUCE = Task(
    name="SimmeringSauce",
    summary="The pan stands on the burner that is named, which is on, with tomato and onion in it.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.5, 0.4))),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "pan",
            ("pan",),
            Placement(
                "counter",
                region=SampleRegion(ref="stove", loc="left_right", top_size=(0.5, 0.4)),
                size=(0.4, 0.5),
                pos=("ref", -1.0),
                margin=0.01,
                rotation=_STRAIGHT_TO_FRONT,
            ),
            graspable=True,
        ),
        _beside_stove("tomato", -1.0),
        _beside_stove("onion", 0.0),
    ),
    goal=AllOf(_ON_KNOB, ObjectOn("tomato", "pan"), ObjectOn("onion", "pan"), _LIT),
    stages=(
        Stage("pick_place", "place", "stove", object="pan", part="{knob}", until=AllOf(_ON_KNOB, GripperFar("pan"))),
        Stage("pick_place", "place", "pan", object="tomato"),
        Stage("pick_place", "place", "pan", object="onion"),
        _LIGHT,
    ),
    instruction=(
        "Put the pan on the {knob} burner, the tomato and the onion into the pan, and turn the {knob} burner on."
    ),
    paraphrases=(
        "Let a sauce of tomato and onion simmer in the pan on the {knob} burner.",
        "Stand the pan over the {knob} burner, add the onion and the tomato, then light it.",
        "The {knob} burner heats the pan; tomato and onion go into that.",
        "Move the pan beside the stove to the {knob} burner, fill it with tomato and onion, and switch that burner on.",
    ),
)

REHEAT_MEAT_ON_STOVE = Task(
    name="ReheatMeatOnStove",
    summary="The meat lies in the pan, the pan over the burner that is named, which is on; the gripper away.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="plate"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec("plate", ("plate",), before_stool((0.3, 0.3))),
        ObjectSpec("meat", ("meat",), Placement(object="plate"), graspable=True, exclude=("shrimp",)),
        ObjectSpec("distr_food", ("vegetable", "fruit"), Placement(object="plate", heaped=True), graspable=True),
        ObjectSpec("pan", ("pan",), on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT)),
    ),
    initial=(BurnerAt("stove", "{knob}", "low"),),
    goal=AllOf(ObjectOn("meat", "pan"), OnBurner("pan", "stove", burner="{knob}"), _LIT, GripperFar("meat")),
    stages=fetch("meat", "dining_counter", "pan"),
    instruction="Carry the {meat} from the plate on the dining counter to the stove and put it into the hot pan.",
    paraphrases=(
        "Reheat the cold {meat} from the dining counter in the pan that is on the stove.",
        "The {meat} on the plate should be warm: bring it to the pan over the low flame.",
        "Take only the {meat} off the plate, and lay it in the pan on the lit burner.",
        "From the dining counter's plate into the stove's pan with the {meat}.",
    ),
)

TASKS = (HEAT_MUG, MAKE_LOADED_POTATO, REHEAT_MEAT_ON_STOVE, SIMMERING_SAUCE, WAFFLE_REHEAT, WARM_CROISSANT)
