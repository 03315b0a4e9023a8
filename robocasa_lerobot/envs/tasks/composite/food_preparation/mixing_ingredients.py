"""Mix and blend ingredients."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Exactly,
    GripperFar,
    MovedSince,
    ObjectInside,
    ObjectOn,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, LidAside, PartAt
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
from robocasa_lerobot.envs.tasks.composite.common import BLENDER_ON, JAR_MOUTH_M, cover_and_blend, fetch, fetch_in_turn
from robocasa_lerobot.envs.tasks.task import Stage, Task

_LID = "{blender}_lid"
_SALSA = ("tomato", "chili_pepper", "onion")


def _blended(*names: str) -> AllOf:
    return AllOf(*(ObjectInside(name, "blender") for name in names), *BLENDER_ON.parts)


def _on_plate(name: str, kind: str, scale: float | tuple[float, float, float] = 1.0, **more: object) -> ObjectSpec:
    start = Placement(object="plate", heaped=True)
    return ObjectSpec(name, (kind,), start, scale=scale, **more)  # type: ignore[arg-type]


BLEND_SALSA_MIX = Task(
    name="BlendSalsaMix",
    summary="Tomato, chili pepper and onion are in the blender, which is covered and runs, the gripper away from it.",
    fixtures=(FixtureSpec("blender", "blender"), counter_near("blender")),
    robot_start=RobotStart("blender"),
    objects=(
        ObjectSpec("plate", ("plate",), on_counter("blender", (0.5, 0.3), loc="left_right"), scale=1.1),
        *(_on_plate(name, name, graspable=True) for name in _SALSA),
    ),
    goal=_blended(*_SALSA),
    stages=(
        Stage(
            "pick_place",
            "uncover",
            "blender",
            object=_LID,
            until=AllOf(ObjectTouchesAnyCounter(_LID), StateIs("blender", "lid", value=False), GripperFar(_LID, 0.15)),
        ),
        *(Stage("pick_place", "place", "blender", object=name) for name in _SALSA),
        *cover_and_blend(),
    ),
    instruction=(
        "Take the lid off the blender, put the tomato, the chili pepper and the onion from the plate into it, put the "
        "lid back on and switch the blender on."
    ),
    paraphrases=(
        "Blend a salsa: open the jar, add tomato, chili pepper and onion, close it and press the button.",
        "What is on the plate belongs in the blender; uncover it first, cover it afterwards, and let it run.",
        "Uncover the blender, fill it from the plate, cover it, and turn it on.",
        "Tomato, chili pepper and onion should be blended, with the lid on.",
    ),
)

BLEND_VEGETABLE_SAUCE = Task(
    name="BlendVegetableSauce",
    summary="The burner is off, the vegetable is in the blender, which is covered and runs, the gripper away from it.",
    fixtures=(FixtureSpec("blender", "blender"), counter_near("blender"), FixtureSpec("stove", "stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
            graspable=True,
            scale=(1.35, 1.35, 0.85),
            filled="water",
        ),
        ObjectSpec(
            "vegetable",
            ("bell_pepper", "carrot", "broccoli", "cucumber", "onion", "tomato"),
            Placement(object="saucepan"),
            graspable=True,
            max_size=JAR_MOUTH_M,
        ),
        ObjectSpec("sauce", ("mayonnaise", "ketchup", "vinegar"), on_counter("blender", (0.4, 0.4), loc="left_right")),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"), LidAside("blender")),
    goal=AllOf(StateIs("stove", "{knob}_on", value=False), *_blended("vegetable").parts),
    stages=(
        Stage("knobs", "off", "stove", part="knob_{knob}"),
        *fetch("vegetable", "stove", "blender"),
        *cover_and_blend(),
    ),
    instruction=(
        "Turn off the burner below the saucepan, put the {vegetable} from it into the blender, put the lid on and "
        "switch the blender on."
    ),
    paraphrases=(
        "The {vegetable} is soft: burner off, {vegetable} into the blender, lid on, and blend.",
        "Make a sauce of the boiled {vegetable} in the blender, once its burner is off.",
        "Switch the stove's burner off, carry the {vegetable} to the blender, cover the jar and start it.",
        "First no more heat under the saucepan, then blend the {vegetable} with the lid on.",
    ),
)

_CHEESE_STIRRED = StepsWhile(
    AllOf(
        ObjectOn("cheese", "pot"),
        OnBurner("pot", "stove", burner="{knob}", lit=True),
        ObjectTouches("spatula", "cheese"),
        MovedSince("cheese", "step", by_m=0.0015, across=True),
    ),
    3,
    label="cheese_stirred",
)

CHEESE_MIXING = Task(
    name="CheeseMixing",
    summary="With the cheese in the pot over the lit burner, the spatula has moved it in 3 steps in total.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("counter", at_object="cheese_plate"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "spatula",
            ("spatula",),
            on_counter("stove", (0.2, 0.4), loc="left_right", rotation=(np.pi / 2, np.pi / 2)),
            scale=(1.0, 1.0, 2.0),
        ),
        ObjectSpec(
            "cheese_plate", ("plate",), on_counter("stove", (0.4, 0.4), loc="left_right"), scale=(0.75, 0.75, 1.0)
        ),
        ObjectSpec("cheese", ("cheese",), Placement(object="cheese_plate"), graspable=True),
        ObjectSpec(
            "pot",
            ("pot",),
            Placement(
                "stove", region=SampleRegion(name="{knob}"), size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False
            ),
            filled="milk",
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=_CHEESE_STIRRED,
    stages=(
        Stage("pick_place", "place", "pot", object="cheese"),
        Stage(
            "pick_place",
            "stir",
            "pot",
            object="spatula",
            until=_CHEESE_STIRRED,
            text="stir in the pot with the spatula",
        ),
    ),
    instruction="Put the cheese into the pot of hot milk and stir it with the spatula.",
    paraphrases=(
        "Cheese into the milk on the stove, then stir with the spatula.",
        "The pot with the milk gets the cheese from the plate; use the spatula to mix.",
        "Mix cheese and milk in the pot: drop the cheese in, then move it about with the spatula.",
        "Take the cheese to the hot pot and stir it there with the spatula.",
    ),
)

_FILLING = ("butter", "sugar", "cream_cheese")
_MIXING, _HEAD_DOWN = (
    PartWithin("stand_mixer", "knob_speed", low=0.2, label="up"),
    PartWithin("stand_mixer", "head", high=0.05, label="down"),
)


def _in_mixer(name: str) -> ObjectInside:
    return ObjectInside(name, "stand_mixer", lower=0.5)


MAKE_CHEESECAKE_FILLING = Task(
    name="MakeCheesecakeFilling",
    summary="Butter, sugar and cream cheese are in the mixer's bowl, its head is down and its speed above 20 %.",
    fixtures=(FixtureSpec("stand_mixer", "stand_mixer"), counter_near("stand_mixer")),
    robot_start=RobotStart("stand_mixer"),
    objects=(
        ObjectSpec("plate", ("plate",), on_counter("stand_mixer", (0.45, 0.3), loc="left_right"), scale=1.1),
        _on_plate("butter", "butter_stick", (0.7, 0.7, 1.0), graspable=True),
        _on_plate("cream_cheese", "cream_cheese_stick", (0.7, 0.7, 1.75), graspable=True),
        _on_plate("sugar", "sugar_cube", 1.1, graspable=True),
    ),
    initial=(PartAt("stand_mixer", "head", (1.0, 1.0)), PartAt("stand_mixer", "knob_speed", (0.0, 0.0))),
    goal=AllOf(*map(_in_mixer, _FILLING), _MIXING, _HEAD_DOWN),
    stages=(
        *(
            Stage(
                "pick_place",
                "place",
                "stand_mixer",
                object=name,
                until=AllOf(_in_mixer(name), GripperFar(name)),
            )
            for name in _FILLING
        ),
        Stage("doors", "lower_head", "stand_mixer", until=_HEAD_DOWN),
        Stage("knobs", "raise", "stand_mixer", part="knob_speed", until=_MIXING),
    ),
    instruction=(
        "Put butter, sugar cube and cream cheese from the plate into the bowl of the stand mixer, lower its "
        "head and turn its speed up."
    ),
    paraphrases=(
        "Start a cheesecake filling: everything on the plate into the mixer, head down, speed up.",
        "Fill the stand mixer with butter, sugar and cream cheese, close it and let it mix.",
        "Butter, sugar cube and cream cheese belong in the mixing bowl; then bring the head down and set a speed.",
        "Load the mixer from the plate, tip its head down over the bowl and turn the speed knob.",
    ),
)

_CHOCOLATES = ("chocolate1", "chocolate2")


def _leans_in(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "glass_milk"), ObjectTilt(name, low=np.deg2rad(25.0)))


MAKE_CHOCOLATE_MILK = Task(
    name="MakeChocolateMilk",
    summary="The sugar cube and one of the two chocolates are in the glass of milk, the gripper away from it.",
    fixtures=(FixtureSpec("counter", "counter"),),
    robot_start=RobotStart("counter", at_object="plate"),
    objects=(
        ObjectSpec(
            "glass_milk",
            ("glass_cup",),
            Placement("counter", size=(0.3, 0.3), pos=(0.0, -1.0)),
            scale=(1.35, 1.35, 1.0),
            filled="milk",
        ),
        ObjectSpec(
            "plate",
            ("plate",),
            Placement("counter", size=(0.7, 0.35), pos=(0.0, -1.0), reuse_region_from="glass_milk"),
            scale=1.1,
        ),
        *(_on_plate(name, "chocolate", (1.0, 1.0, 2.0), repeats=True) for name in _CHOCOLATES),
        _on_plate("sugar_cube", "sugar_cube", 1.1, graspable=True),
    ),
    goal=AllOf(
        Exactly(1, *map(_leans_in, _CHOCOLATES)), ObjectOn("sugar_cube", "glass_milk"), GripperFar("glass_milk")
    ),
    stages=(
        Stage(
            "pick_place",
            "place",
            "glass_milk",
            object="chocolate2",  # lies on the other one
            until=AllOf(_leans_in("chocolate2"), GripperFar("glass_milk")),
        ),
        Stage("pick_place", "place", "glass_milk", object="sugar_cube"),
    ),
    instruction="Put one of the two chocolates and the sugar cube from the plate into the glass of milk.",
    paraphrases=(
        "Make chocolate milk: a chocolate and the sugar cube go into the glass, the other chocolate stays.",
        "The milk in the glass lacks sugar and a chocolate; both are on the plate.",
        "Drop a single chocolate and the sugar cube into the milk.",
        "From the plate into the glass: one chocolate, one sugar cube.",
    ),
)

_DIP = ("vegetable", "cream_cheese")
_DIP_SHELF = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))

PREPARE_VEGGIE_DIP = Task(
    name="PrepareVeggieDip",
    summary="Vegetable and cream cheese are in the blender, which is covered and runs, the gripper away from it.",
    fixtures=(FixtureSpec("blender", "blender"), counter_near("blender"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "cream_cheese",
            ("cream_cheese_stick",),
            Placement("fridge", region=_DIP_SHELF, size=(0.35, 0.3), pos=(0.0, -1.0)),
            graspable=True,
        ),
        ObjectSpec(
            "vegetable",
            ("bell_pepper", "carrot", "broccoli", "cucumber", "garlic", "onion", "tomato"),
            Placement("fridge", region=_DIP_SHELF, size=(0.5, 0.2), pos=(0.0, -1.0)),
            graspable=True,
            max_size=JAR_MOUTH_M,
        ),
        ObjectSpec(
            "distr",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.5, 0.3), pos=(0.0, 0.0)),
            exclude=("vegetable", "cream_cheese_stick"),
            properties=("fridgable",),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), LidAside("blender")),
    goal=_blended(*_DIP),
    stages=(*fetch_in_turn(_DIP, "fridge", "blender"), *cover_and_blend()),
    instruction=(
        "Put the {vegetable} and the cream cheese from the fridge into the blender, put its lid on and switch it on."
    ),
    paraphrases=(
        "Blend a dip of the fridge's {vegetable} and cream cheese, with the lid on the jar.",
        "Carry the {vegetable}, then the cream cheese, to the blender; cover it and press the button.",
        "The open blender gets {vegetable} and cream cheese; then it is closed and runs.",
        "For a dip, {vegetable} and cream cheese go from the fridge into the blender. Lid on, power on.",
    ),
)

TASKS = (
    BLEND_SALSA_MIX,
    BLEND_VEGETABLE_SAUCE,
    CHEESE_MIXING,
    MAKE_CHEESECAKE_FILLING,
    MAKE_CHOCOLATE_MILK,
    PREPARE_VEGGIE_DIP,
)
