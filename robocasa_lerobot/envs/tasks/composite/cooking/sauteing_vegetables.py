"""Saute vegetables on the stove."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Grasped,
    GripperFar,
    MovedSince,
    Near,
    Not,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_burner, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_STIRRED = StepsWhile(
    AllOf(
        Grasped("spatula"),
        OnBurner("pot", "stove", burner="{knob}", lit=True),
        ObjectOn("veg1", "pot"),
        ObjectOn("veg2", "pot"),
        MovedSince("veg1", "step", by_m=0.0005, across=True),
        MovedSince("veg2", "step", by_m=0.0005, across=True),
        ObjectTouches("spatula", "veg1"),
    ),
    5,
    label="vegetables_stirred",
)

STIR_VEGETABLES = Task(
    name="StirVegetables",
    summary="With both in the pot over the lit burner, the held spatula has moved the vegetables in 5 steps in total.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec("spatula", ("spatula",), on_counter("stove", (0.5, 0.5)), scale=(1.0, 1.0, 2.0)),
        ObjectSpec(
            "pot",
            ("pot",),
            Placement(
                "stove",
                region=SampleRegion(name="{knob}"),
                size=(0.05, 0.05),
                pos=(0.0, 0.0),
                ensure_inside=False,
            ),
        ),
        ObjectSpec(
            "veg1",
            ("vegetable",),
            Placement(
                "counter",
                region=SampleRegion(ref="stove", loc="left_right", top_size=(0.3, 0.3)),
                size=(0.3, 0.3),
                pos=("ref", -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "veg2",
            ("vegetable",),
            Placement(
                "counter",
                region=SampleRegion(ref="stove", loc="left_right", top_size=(0.3, 0.3)),
                size=(0.3, 0.3),
                pos=("ref", -0.7),
            ),
            graspable=True,
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=_STIRRED,
    stages=(
        Stage("pick_place", "place", "pot", object="veg1"),
        Stage("pick_place", "place", "pot", object="veg2"),
        Stage("pick_place", "pick", "counter", object="spatula"),
        Stage("pick_place", "stir", "pot", object="spatula", until=_STIRRED, text="stir in the pot with the spatula"),
    ),
    instruction="Put the {veg1} and the {veg2} into the pot on the stove, then stir them with the spatula.",
    paraphrases=(
        "Saute the {veg1} and the {veg2} in the hot pot, and stir with the spatula.",
        "Both the {veg1} and the {veg2} go into the pot on the lit burner; use the spatula to stir.",
        "Cook the {veg1} with the {veg2}: into the pot with them, then move them about with the spatula.",
        "Take the spatula and stir, once the {veg1} and the {veg2} are in the pot.",
    ),
)

_KNOB = Choice("knob", of="stove")
_LIGHT = Stage("knobs", "on", "stove", part="knob_{knob}")
_LIT = StateIs("stove", "{knob}_on")


def _on_knob(rotation: tuple[float, float] = HANDLE_TO_FRONT) -> Placement:
    return on_burner(size_m=0.05, rotation=rotation)


_OVER_FLAME = OnBurner("pan", "stove", burner="{knob}", lit=True)
# A quarter to three quarters of half a turn, of the turn and a half quarters that a knob has.
_MEDIUM = PartWithin("stove", "knob_{knob}", low=1 / 6, high=1 / 2, label="medium")


def _vegetable(name: str) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("vegetable",),
        on_counter("stove", (0.3, 0.35), loc="left_right"),
        graspable=True,
        properties=("cookable",),
    )


ADJUST_HEAT = Task(
    name="AdjustHeat",
    summary="Both vegetables are in the pan, which stands over the burner that is named, set to a medium flame.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.5, 0.4))),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=(
        ObjectSpec("pan", ("pan",), _on_knob(), graspable=True, properties=("washable",)),
        _vegetable("veg1"),
        _vegetable("veg2"),
    ),
    goal=AllOf(_OVER_FLAME, _MEDIUM, ObjectOn("veg1", "pan"), ObjectOn("veg2", "pan")),
    stages=(
        Stage("pick_place", "place", "pan", object="veg1"),
        Stage("pick_place", "place", "pan", object="veg2"),
        Stage("knobs", "medium", "stove", part="knob_{knob}", until=_MEDIUM),
    ),
    instruction="Put the {veg1} and the {veg2} into the pan and turn the {knob} burner to a medium flame.",
    paraphrases=(
        "Saute {veg1} and {veg2} in the pan, at medium heat of the {knob} burner.",
        "Into the pan with the {veg1} and the {veg2}; then give them a medium flame.",
        "The pan on the {knob} burner gets the {veg1}, the {veg2} and a middling heat.",
        "Fill the pan with both vegetables and set the knob of the {knob} burner to the middle.",
    ),
)

BUTTER_ON_PAN = Task(
    name="ButterOnPan",
    summary="The butter is in the pan, which stands over the lit burner.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=(
        ObjectSpec("pan", ("pan",), _on_knob()),
        ObjectSpec(
            "butter",
            ("butter_stick",),
            on_counter("stove", (0.35, 0.35), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
    ),
    goal=AllOf(ObjectOn("butter", "pan"), _OVER_FLAME, _LIT),
    stages=(Stage("pick_place", "place", "pan", object="butter"), _LIGHT),
    instruction="Put the butter from its plate into the pan and turn on the {knob} burner under it.",
    paraphrases=(
        "Melt the butter in the pan: in with it, then light the burner.",
        "The butter on the plate goes into the pan on the stove, whose {knob} burner is to be lit.",
        "Lay the stick of butter in the pan and heat that with the {knob} burner.",
        "Start with butter in the pan and the burner below it on.",
    ),
)

_GAP_M = 0.06


def _spread(name: str, along: float) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("vegetable",),
        Placement(
            "counter",
            region=SampleRegion(ref="stove", loc="left_right", top_size=(0.3, 0.3)),
            size=(0.25, 0.25),
            pos=("ref", along),
        ),
        graspable=True,
        properties=("cookable",),
    )


_APART = Not(Near("veg2", "veg1", _GAP_M))

PLACE_VEGETABLES_EVENLY = Task(
    name="PlaceVegetablesEvenly",
    summary="Both vegetables are in the pan, 6 cm apart and not touching each other, the gripper away from both.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=(ObjectSpec("pan", ("pan",), _on_knob()), _spread("veg1", -0.4), _spread("veg2", -0.6)),
    goal=AllOf(
        ObjectOn("veg1", "pan"),
        ObjectOn("veg2", "pan"),
        Not(ObjectTouches("veg1", "veg2")),
        _APART,
        GripperFar("veg1"),
        GripperFar("veg2"),
    ),
    stages=(
        Stage("pick_place", "place", "pan", object="veg1"),
        Stage(
            "pick_place",
            "place",
            "pan",
            object="veg2",
            until=AllOf(ObjectOn("veg2", "pan"), _APART, Not(ObjectTouches("veg1", "veg2")), GripperFar("veg2")),
        ),
    ),
    instruction="Put the {veg1} and the {veg2} into the pan side by side, with some room between them.",
    paraphrases=(
        "Spread {veg1} and {veg2} in the pan so that they do not touch.",
        "The {veg1} and the {veg2} should lie apart from each other in the pan.",
        "Lay the {veg1} in the pan and the {veg2} beside it, not on top and not against it.",
        "Both go into the pan, {veg1} here and {veg2} there, with a gap.",
    ),
)

_PREHEATED = StepsWhile(
    AllOf(OnBurner("pot", "stove", burner="{knob}", lit=True), Not(ObjectOn("vegetable", "pot"))),
    500,
    label="pot_preheated",
)

PREHEAT_POT = Task(
    name="PreheatPot",
    summary="The pot has stood over the lit burner for 500 steps (25 s) without the vegetable, which is in it now.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=(
        ObjectSpec("pot", ("pot",), _on_knob(Placement().rotation)),
        ObjectSpec(
            "vegetable",
            ("vegetable",),
            on_counter("stove", (0.15, 0.15), loc="left_right", pos=("ref", -0.3), ensure_inside=False),
            graspable=True,
            properties=("cookable",),
        ),
    ),
    goal=AllOf(OnBurner("pot", "stove", burner="{knob}", lit=True), _LIT, _PREHEATED, ObjectOn("vegetable", "pot")),
    stages=(
        Stage(
            "knobs",
            "on",
            "stove",
            part="knob_{knob}",
            until=AllOf(_LIT, _PREHEATED),
            text="turn on the {knob} burner and let the pot heat for twenty-five seconds",
        ),
        Stage("pick_place", "place", "pot", object="vegetable"),
    ),
    instruction=(
        "Turn on the burner under the pot, let the empty pot heat for 25 seconds, then put the {vegetable} into it."
    ),
    paraphrases=(
        "Preheat the pot for 25 seconds on its burner before the {vegetable} goes in.",
        "Light the {knob} burner, wait until the pot has been hot for 25 seconds, and add the {vegetable}.",
        "The {vegetable} should go into a hot pot: burner on, 25 seconds of patience, then in with it.",
        "First heat, for 25 seconds, under the empty pot; the {vegetable} after that.",
    ),
)

_BACK = OnBurner("obj_container", "stove", burner="{knob}", lit=True)
_VEGETABLE_IN = ObjectOn("obj", "obj_container")
_SHAKEN = StepsWhile(AllOf(_VEGETABLE_IN, MovedSince("obj_container", "step", by_m=0.001)), 25, label="pan_shaken")
_TILTED = StepsWhile(AllOf(_VEGETABLE_IN, MovedSince("obj_container", "reset", by_rad=0.3)), 12, label="pan_tilted")
_SET_BACK = Stage(
    "pick_place",
    "place",
    "stove",
    object="obj_container",
    part="{knob}",
    until=AllOf(_BACK, GripperFar("obj_container")),
)
_WITH_VEGETABLE = (
    ObjectSpec("obj_container", ("pan",), _on_knob(), graspable=True),
    ObjectSpec("obj", ("vegetable",), Placement(object="obj_container"), graspable=True, properties=("cookable",)),
)

SHAKE_PAN = Task(
    name="ShakePan",
    summary="The pan was moved in 25 steps with the vegetable in it, which it is still, and is on its lit burner.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=_WITH_VEGETABLE,
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=AllOf(_SHAKEN, _VEGETABLE_IN, _BACK),
    stages=(Stage("pick_place", "shake", "stove", object="obj_container", until=_SHAKEN), _SET_BACK),
    instruction="Pick up the pan, shake it so that the {obj} moves about in it, and put it back on its burner.",
    paraphrases=(
        "Saute the {obj}: shake the pan, then set it on the {knob} burner again.",
        "Take the pan by its handle and shake it without losing the {obj}; return it to where it stood.",
        "The {obj} should be tossed a little in the pan, which belongs back on its burner after that.",
        "Lift the pan, shake it to and fro, and stand it on the {knob} burner.",
    ),
)

TILT_PAN = Task(
    name="TiltPan",
    summary=(
        "The pan was turned by 0.3 rad in 12 steps with the vegetable in it, which it is still, and is on its lit "
        "burner."
    ),
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(_KNOB,),
    objects=_WITH_VEGETABLE,
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=AllOf(_TILTED, _BACK, _VEGETABLE_IN),
    stages=(Stage("pick_place", "tilt", "stove", object="obj_container", until=_TILTED), _SET_BACK),
    instruction="Pick up the pan, tilt it a little so that the {obj} slides in it, and put it back on its burner.",
    paraphrases=(
        "Let the {obj} slide to one side of the pan by tilting that; then the pan goes back on the {knob} burner.",
        "Take the pan by its handle, lean it without losing the {obj}, and return it to its burner.",
        "Tip the pan with the {obj} gently, then set it down where it stood.",
        "The pan should be lifted and tilted, and stand on the {knob} burner again with the {obj} in it.",
    ),
)

TASKS = (ADJUST_HEAT, BUTTER_ON_PAN, PLACE_VEGETABLES_EVENLY, PREHEAT_POT, SHAKE_PAN, STIR_VEGETABLES, TILT_PAN)
