"""Fry on the stove."""

import math
from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    MovedSince,
    Not,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    Once,
    StateIs,
    StepsWhile,
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
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, in_cabinet, on_counter
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


def _on_stove(burner: str) -> Placement:
    return Placement(
        "stove",
        region=SampleRegion(name=burner, height=(0.7, 1.2)),
        size=(0.05, 0.05),
        pos=(0.0, 0.0),
        rotation=HANDLE_TO_FRONT,
        ensure_inside=False,
    )


ASSEMBLE_COOKING_ARRAY = Task(
    name="AssembleCookingArray",
    summary="The meat lies in the pan, condiment and vegetable are on the counter, the gripper away from each.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        counter_near("stove", size=(0.3, 0.4)),
        FixtureSpec("cabinet", "cabinet", near="counter"),
    ),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec("pan", ("pan",), _on_stove("any")),
        ObjectSpec(
            "meat",
            ("meat",),
            on_counter("stove", (0.3, 0.3), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
        ObjectSpec("condiment", ("condiment",), in_cabinet("cabinet", (0.5, 0.2), pos=(-1.0, -1.0)), graspable=True),
        ObjectSpec("vegetable", ("vegetable",), in_cabinet("cabinet", (0.5, 0.2), pos=(1.0, -1.0)), graspable=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        _IN_PAN,
        ObjectTouches("vegetable", "counter"),
        ObjectTouches("condiment", "counter"),
        *(GripperFar(name) for name in ("vegetable", "condiment", "meat")),
    ),
    stages=(
        Stage("pick_place", "place", "pan", object="meat", until=AllOf(_IN_PAN, GripperFar("meat"))),
        Stage("navigation", "drive", "cabinet"),
        Stage("pick_place", "place", "counter", object="condiment"),
        Stage("pick_place", "place", "counter", object="vegetable"),
    ),
    instruction=(
        "Put the {meat} into the pan, then take the {condiment} and the {vegetable} out of the cabinet and put them on "
        "the counter."
    ),
    paraphrases=(
        "Get ready to cook: the {meat} in the pan, {condiment} and {vegetable} from the cabinet on the counter.",
        "The counter by the stove gets the cabinet's {condiment} and {vegetable}, the pan the {meat}.",
        "Lay the {meat} in the pan first; then fetch {condiment} and {vegetable} from the open cabinet.",
        "Have everything at hand: {meat} in the pan on the stove, {vegetable} and {condiment} on the counter.",
    ),
)

_ELSEWHERE = Not(OnBurner("obj", "stove", burner="{start_burner}"))

FRYING_PAN_ADJUSTMENT = Task(
    name="FryingPanAdjustment",
    summary="The pan stands on another burner than at the start, and that burner is on.",
    fixtures=(FixtureSpec("stove", "stove"),),
    robot_start=RobotStart("stove"),
    choices=(Choice("start_burner", of="stove"),),
    objects=(ObjectSpec("obj", ("pan",), _on_stove("{start_burner}"), graspable=True),),
    initial=(BurnerAt("stove", "{start_burner}", "on"),),
    goal=AllOf(
        OnBurner("obj", "stove", within=0.08),
        OnBurner("obj", "stove", lit=True, within=0.08),
        _ELSEWHERE,
    ),
    stages=(
        Stage(
            "pick_place",
            "place",
            "stove",
            object="obj",
            until=AllOf(OnBurner("obj", "stove", within=0.08), _ELSEWHERE, GripperFar("obj")),
            text="move the pan to another burner of the stove",
        ),
        Stage("knobs", "on", "stove", object="obj"),
    ),
    instruction="Move the pan from the {start_burner} burner to another one and turn that one on.",
    paraphrases=(
        "The pan should heat on any burner but the {start_burner} one, where it is now.",
        "Shift the pan to a different burner, and light the burner it comes to stand on.",
        "Pan off the {start_burner} burner, onto one that is free; then switch on the new one.",
        "Choose another burner for the pan, put it there, and use that burner's knob.",
    ),
)

_PANS, _STEAKS = ("full_pan", "empty_pan"), ("steak1", "steak2")
_WITHIN_M = 0.08


def _steaks(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("steak1", first), ObjectOn("steak2", second))


# All stoves have these two burners.
DISTRIBUTE_STEAK_ON_PANS = Task(
    name="DistributeSteakOnPans",
    summary="Either pan stands on a lit burner of its own with a steak in it, the gripper away from both steaks.",
    fixtures=(FixtureSpec("stove", "stove"),),
    robot_start=RobotStart("stove"),
    choices=(
        Choice(
            "full",
            {
                "front_left": {"_empty": "front_right", "full_side": "left", "empty_side": "right"},
                "front_right": {"_empty": "front_left", "full_side": "right", "empty_side": "left"},
            },
        ),
    ),
    objects=(
        ObjectSpec("full_pan", ("pan",), _on_stove("{full}")),
        ObjectSpec("empty_pan", ("pan",), _on_stove("{_empty}"), repeats=True),
        ObjectSpec("steak1", ("steak",), Placement(object="full_pan"), graspable=True),
        ObjectSpec("steak2", ("steak",), Placement(object="full_pan", heaped=True), graspable=True, repeats=True),
    ),
    initial=(BurnerAt("stove", "{full}", "on"), BurnerAt("stove", "{_empty}", "off")),
    goal=AllOf(
        AllOf(
            *(OnBurner(pan, "stove", lit=True, within=_WITHIN_M) for pan in _PANS),
            OnBurner("full_pan", "stove", within=_WITHIN_M, other_than="empty_pan"),
        ),
        StateIs("stove", "{full}_on"),
        StateIs("stove", "{_empty}_on"),
        AnyOf(_steaks(*_PANS), _steaks(*reversed(_PANS))),
        *(GripperFar(name) for name in _STEAKS),
    ),
    stages=(
        Stage(
            "knobs",
            "on",
            "stove",
            part="knob_{_empty}",
            text="turn on the front {empty_side} burner of the stove",
        ),
        Stage("pick_place", "place", "empty_pan", object="steak2", text="put one of the steaks into the empty pan"),
    ),
    instruction="Turn on the burner under the empty pan and move one of the two steaks into that pan.",
    paraphrases=(
        "Share out the steaks, one for each pan, with both burners lit.",
        "The pan on the front {empty_side} burner is empty: light that burner, give the pan one of the steaks.",
        "One steak stays in the {full_side} pan, the other goes into the {empty_side} one, which is to be heated too.",
        "Fry the two steaks in two pans: burner on under the second pan, and a steak into it.",
    ),
)

_PAN_HEATS = OnBurner("pan", "stove", lit=True)


def _in_front_of_cabinet(name: str) -> ObjectSpec:
    return ObjectSpec(name, ("any",), on_counter("cabinet", (0.5, 0.5), pos=(0.0, -1.0)))


SETUP_FRYING = Task(
    name="SetupFrying",
    summary="The pan stands on a burner that is on, the gripper away from it.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("cabinet", "cabinet_double_door", near="stove"),
        counter_near("cabinet"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        # It lies across the cabinet, which is not as deep as the pan is long.
        ObjectSpec(
            "pan", ("pan",), in_cabinet("cabinet", (1.0, 0.5), pos=(0.0, 0.0), rotation=(-0.2, 0.2)), graspable=True
        ),
        _in_front_of_cabinet("distr_counter_0"),
        _in_front_of_cabinet("distr_counter_1"),
        ObjectSpec(
            "distr_stove",
            ("kettle_non_electric",),
            replace(_on_stove("any"), size=(0.02, 0.02), rotation=Placement().rotation),
        ),
    ),
    goal=AllOf(_PAN_HEATS, GripperFar("pan")),
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "stove", object="pan"),
        Stage("knobs", "on", "stove", object="pan"),
    ),
    instruction="Open the cabinet, put the pan from it on a burner of the stove and turn that burner on.",
    paraphrases=(
        "Set up for frying: the pan out of the closed cabinet, on the stove, over a burner that is on.",
        "Get the pan from the cabinet onto a free burner and light it.",
        "The cabinet holds the pan; it should be heating on the stove.",
        "Fetch the pan out of the cabinet, stand it on the stove and switch on the burner below.",
    ),
)

# Lifting it by its handle tips it: that alone is no turn.
_TURNED = MovedSince("meat_container", "reset", by_rad=math.radians(15.0), about_vertical=True)
_ROTATED = Once(_TURNED, label="pan_rotated")
_ON_STOVE = AllOf(ObjectTouches("meat_container", "stove"), ObjectOn("meat", "meat_container"))

ROTATE_PAN = Task(
    name="RotatePan",
    summary="The pan was turned by more than 15 degrees; it is on the stove, the meat in it, the gripper away from it.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("burner", of="stove"),),
    objects=(
        ObjectSpec("meat_container", ("pan",), _on_stove("{burner}"), graspable=True),
        ObjectSpec("meat", ("meat",), Placement(object="meat_container"), graspable=True, properties=("cookable",)),
    ),
    initial=(BurnerAt("stove", "{burner}", "on"),),
    goal=AllOf(*_ON_STOVE.parts, _ROTATED, GripperFar("meat_container")),
    stages=(
        Stage("pick_place", "pick", "stove", object="meat_container"),
        Stage(
            "pick_place",
            "turn",
            "stove",
            object="meat_container",
            until=AllOf(_ROTATED, *_ON_STOVE.parts, GripperFar("meat_container")),
            text="turn the pan on its burner and let go",
        ),
    ),
    instruction="Turn the pan by its handle clearly to one side on its burner, with the {meat} in it, and let go.",
    paraphrases=(
        "Rotate the pan on the {burner} burner, without losing the {meat}.",
        "The handle of the pan should point another way; the {meat} stays in the pan, the pan on the stove.",
        "Take the pan's handle and swing it round a little. The pan remains where it is.",
        "Give the pan with the {meat} a turn on the burner.",
    ),
)

_PRESSED = StepsWhile(ObjectTouches("spatula", "chicken"), 25, consecutive=True, label="chicken_pressed")

PRESS_CHICKEN = Task(
    name="PressChicken",
    summary="The spatula has touched the chicken for 25 steps in a row, the gripper is away from the chicken.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("burner", of="stove"),),
    objects=(
        ObjectSpec("chicken_container", ("pan",), _on_stove("{burner}")),
        ObjectSpec(
            "chicken",
            ("chicken_drumstick",),
            Placement(object="chicken_container"),
            graspable=True,
            properties=("cookable",),
            scale=1.15,
        ),
        ObjectSpec("spatula", ("spatula",), on_counter("stove", (0.5, 0.3), loc="left_right"), scale=(1.0, 1.0, 3.0)),
    ),
    initial=(BurnerAt("stove", "{burner}", "on"),),
    goal=AllOf(_PRESSED, GripperFar("chicken")),
    stages=(
        Stage("pick_place", "pick", "counter", object="spatula"),
        Stage(
            "pick_place",
            "press_with",
            "chicken",
            object="spatula",
            until=AllOf(_PRESSED, GripperFar("chicken")),
            text="press the spatula onto the chicken for two seconds and back off",
        ),
    ),
    instruction="Take the spatula, press it onto the chicken in the pan for a few seconds and move away.",
    paraphrases=(
        "Press the chicken in the pan with the spatula for a while, so that it browns.",
        "With the spatula in hand, hold the drumstick down in the pan for some seconds; then back off.",
        "The chicken should feel the spatula on it for a few seconds.",
        "Get the spatula, push it down on the chicken, wait a little, and take the hand away.",
    ),
)

TASKS = (
    ASSEMBLE_COOKING_ARRAY,
    PRESS_CHICKEN,
    DISTRIBUTE_STEAK_ON_PANS,
    FRYING_PAN_ADJUSTMENT,
    ROTATE_PAN,
    SEARING_MEAT,
    SETUP_FRYING,
)
