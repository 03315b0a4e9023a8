"""Knobs, levers and buttons: stove, ovens, sink, kettle, toaster, microwave, coffee machine, blender."""

from robocasa_lerobot.envs.initial import BurnerAt, PartAt, SwitchedOn, Water
from robocasa_lerobot.envs.predicates import (
    AllOf,
    BurnerLevel,
    GripperFarFromPart,
    PartTurned,
    PartWithin,
    StateIs,
    When,
)
from robocasa_lerobot.envs.scene.wanted import (
    Choice,
    FixtureWanted,
    InitialOpenness,
    ObjectWanted,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.task import Stage, Task
from robocasa_lerobot.envs.tasks.atomic.common import (
    COMMON,
    SEEN,
    UNMULTIPLIED,
    atomic,
    counter_near,
    on_counter,
)

KNOB = Choice("knob", of="stove")
# Handles of cookware point away from the knobs by this much to either side, radians.
HANDLE_TURN = (0.785, 1.178)
_COOKWARE = ("pan", "pot", "saucepan", "kettle_non_electric")

_SINK = (FixtureWanted("sink", "sink"), counter_near("sink"))
_SINK_OBJECTS = (
    ObjectWanted(
        "distr_counter",
        ("any",),
        on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.1)),
        count=(1, 3),
    ),
    ObjectWanted("distr_sink", ("any",), Placement("sink", size=(0.3, 0.4), pos=(0.0, -1.0)), washable=True),
)
_HEATED = (
    ObjectWanted(
        "obj",
        ("any",),
        Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False, try_to_place_in="plate"),
        properties=("microwavable",),
    ),
)
_MUG_UNDER_SPOUT = ObjectWanted(
    "obj", ("mug",), Placement("coffee_machine", region=SampleRegion(name="cup"), rotation=(0.39, 0.79))
)


def _stove(
    name: str, horizon: int, summary: str, start: str, goal: StateIs | BurnerLevel, verb: str, sets: tuple[str, ...]
) -> Task:
    cookware, groups = ("kettle", _COOKWARE[-1:]) if name == "LowerHeat" else ("cookware", _COOKWARE)
    region = SampleRegion(name="{knob}" if name == "LowerHeat" else "{knob}|any")
    return atomic(
        name,
        horizon,
        summary,
        fixtures=(FixtureWanted("stove", "stove"),),
        start=RobotStart("stove"),
        choices=(KNOB,),
        objects=(
            ObjectWanted(
                cookware,
                groups,
                Placement(
                    "stove",
                    region=region,
                    size=(0.02, 0.02),
                    pos=(0.0, 0.0),
                    rotation=HANDLE_TURN,
                    ensure_inside=False,
                ),
            ),
        ),
        initial=(BurnerAt("stove", "{knob}", start),),
        goal=goal,
        stages=(Stage("knobs", verb, "stove", part="knob_{knob}"),),
        sets=sets,
    )


def _sink(
    name: str,
    horizon: int,
    summary: str,
    initial: tuple[Water | PartAt, ...],
    goal: StateIs | When | AllOf,
    verb: str,
    part: str,
    *,
    choices: tuple[Choice, ...] = (),
    cluttered: bool = True,
    sets: tuple[str, ...] = COMMON,
) -> Task:
    return atomic(
        name,
        horizon,
        summary,
        fixtures=_SINK if cluttered else _SINK[:1],
        start=RobotStart("sink"),
        choices=choices,
        objects=_SINK_OBJECTS if cluttered else (),
        initial=initial,
        goal=goal,
        stages=(Stage("levers", verb, "sink", part=part),),
        sets=sets,
    )


def _button(
    name: str,
    kind: str,
    horizon: int,
    summary: str,
    part: str,
    goal: AllOf | StateIs,
    *,
    objects: tuple[ObjectWanted, ...] = (),
    initial: tuple[SwitchedOn | InitialOpenness, ...] = (),
    counter: bool = False,
    sets: tuple[str, ...] = COMMON,
) -> Task:
    return atomic(
        name,
        horizon,
        summary,
        fixtures=(FixtureWanted(kind, kind), *([counter_near(kind)] if counter else [])),
        start=RobotStart(kind),
        objects=objects,
        initial=initial,
        goal=goal,
        stages=(Stage("buttons", "press", kind, part=part),),
        sets=sets,
    )


STOVE = (
    _stove(
        "TurnOnStove",
        450,
        "The burner named by the instruction is on.",
        "off",
        StateIs("stove", "{knob}_on"),
        "on",
        COMMON,
    ),
    _stove(
        "TurnOffStove",
        750,
        "The burner named by the instruction is off.",
        "on",
        StateIs("stove", "{knob}_on", value=False),
        "off",
        SEEN,
    ),
    _stove(
        "LowerHeat",
        750,
        "The burner under the kettle is on low: not off.",
        "high",
        BurnerLevel("stove", "{knob}", "low"),
        "low",
        UNMULTIPLIED,
    ),
)

OVENS = (
    atomic(
        "PreheatOven",
        450,
        "The temperature knob is at 25 % of its range or more.",
        fixtures=(FixtureWanted("oven", "oven"),),
        start=RobotStart("oven"),
        initial=(PartAt("oven", "knob_temp", (0.0, 0.0)),),
        goal=PartWithin("oven", "knob_temp", low=0.25, label="raised"),
        stages=(Stage("knobs", "raise", "oven", part="knob_temp"),),
        needs=("oven",),
    ),
    atomic(
        "TurnOnToasterOven",
        450,
        "The timer knob is at 10 % of its range or more; it runs down with time.",
        fixtures=(FixtureWanted("toaster_oven", "toaster_oven"),),
        start=RobotStart("toaster_oven"),
        initial=(PartAt("toaster_oven", "knob_time", (0.0, 0.0)),),
        goal=PartWithin("toaster_oven", "knob_time", low=0.10, label="set"),
        stages=(Stage("knobs", "raise", "toaster_oven", part="knob_time"),),
    ),
    atomic(
        "AdjustToasterOvenTemperature",
        450,
        "The temperature knob has gone by 15 % of its range from where it was, upwards or downwards as asked for.",
        fixtures=(FixtureWanted("toaster_oven", "toaster_oven"),),
        start=RobotStart("toaster_oven"),
        choices=(
            Choice(
                "direction",
                {
                    "increase": {"verb": "Raise", "comparative": "hotter", "way": "up"},
                    "decrease": {"verb": "Lower", "comparative": "cooler", "way": "down"},
                },
            ),
        ),
        # It starts in the half of its range that leaves room for the wanted way.
        initial=(PartAt("toaster_oven", "knob_temp", {"increase": (0.0, 0.5), "decrease": (0.5, 1.0)}, "direction"),),
        goal=When(
            "direction",
            {
                "increase": PartTurned("toaster_oven", "knob_temp", 0.15, label="raised"),
                "decrease": PartTurned("toaster_oven", "knob_temp", -0.15, label="lowered"),
            },
        ),
        stages=(Stage("knobs", "turn", "toaster_oven", part="knob_temp"),),
    ),
)

SINK = (
    _sink(
        "TurnOnSinkFaucet",
        600,
        "Water runs.",
        (Water("sink", False),),
        StateIs("sink", "water_on"),
        "on",
        "handle",
        sets=SEEN,
    ),
    _sink(
        "TurnOffSinkFaucet",
        300,
        "No water runs.",
        (Water("sink", True),),
        StateIs("sink", "water_on", value=False),
        "off",
        "handle",
    ),
    _sink(
        "TurnSinkSpout",
        300,
        "The spout points to the side that the instruction names.",
        (Water("sink", None), PartAt("sink", "spout", (0.5, 0.5))),
        When("direction", {"left": StateIs("sink", "left"), "right": StateIs("sink", "right")}),
        "turn",
        "spout",
        choices=(Choice("direction", {"left": {}, "right": {}}),),
    ),
    _sink(
        "AdjustWaterTemperature",
        450,
        "Water still runs, and its temperature handle has gone from one end to the other.",
        (
            Water("sink", True),
            PartAt("sink", "handle_temp", {"cold": (0.3, 0.4), "hot": (0.6, 0.7)}, "start"),
        ),
        When(
            "start",
            {
                "cold": AllOf(StateIs("sink", "water_on"), PartWithin("sink", "handle_temp", low=0.6, label="hot")),
                "hot": AllOf(StateIs("sink", "water_on"), PartWithin("sink", "handle_temp", high=0.4, label="cold")),
            },
        ),
        "turn",
        "handle_temp",
        choices=(Choice("start", {"cold": {"target": "hot"}, "hot": {"target": "cold"}}),),
        cluttered=False,
    ),
)

LEVERS = (
    atomic(
        "TurnOnElectricKettle",
        450,
        "The kettle's switch is down, and it heats.",
        fixtures=(FixtureWanted("electric_kettle", "electric_kettle"),),
        start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (0.0, 0.0)),),
        goal=PartWithin("electric_kettle", "switch", low=0.95, label="down"),
        stages=(Stage("levers", "press", "electric_kettle", part="switch"),),
        sets=SEEN,
    ),
    atomic(
        "TurnOnToaster",
        300,
        "The lever of the slots that hold the bread is down.",
        fixtures=(FixtureWanted("toaster", "toaster"),),
        start=RobotStart("toaster"),
        choices=(Choice("slot", of="toaster"),),
        objects=(
            ObjectWanted(
                "obj",
                ("sandwich_bread",),
                Placement(
                    "toaster", region=SampleRegion(name="slot{slot}"), rotation=(0.0, 0.0), margin=0.0, slot=True
                ),
                scale=0.85,
                upright=True,
            ),
        ),
        goal=PartWithin("toaster", "lever{_side}", low=0.90, label="down"),
        stages=(Stage("levers", "press", "toaster", part="lever{_side}"),),
    ),
)

BUTTONS = (
    _button(
        "TurnOnMicrowave",
        "microwave",
        450,
        "The microwave runs, and the gripper is 15 cm away from the button.",
        "start_button",
        AllOf(StateIs("microwave", "on"), GripperFarFromPart("microwave", "start_button")),
        objects=_HEATED,
        sets=SEEN,
    ),
    _button(
        "TurnOffMicrowave",
        "microwave",
        300,
        "The microwave is off, and the gripper is 15 cm away from the button.",
        "stop_button",
        AllOf(StateIs("microwave", "on", value=False), GripperFarFromPart("microwave", "stop_button")),
        objects=_HEATED,
        initial=(SwitchedOn("microwave"),),
    ),
    _button(
        "StartCoffeeMachine",
        "coffee_machine",
        300,
        "The machine brews, and the gripper is 15 cm away from the button.",
        "start_button",
        AllOf(StateIs("coffee_machine", "on"), GripperFarFromPart("coffee_machine", "start_button")),
        objects=(_MUG_UNDER_SPOUT,),
        counter=True,
    ),
    _button(
        "TurnOnBlender",
        "blender",
        300,
        "The blender runs, with its lid on.",
        "button",
        StateIs("blender", "on"),
        objects=(ObjectWanted("obj", ("fruit",), Placement("blender", size=(0.4, 0.4), margin=0.0), scale=0.8),),
    ),
)

TASKS = (*STOVE, *OVENS, *SINK, *LEVERS, *BUTTONS)
