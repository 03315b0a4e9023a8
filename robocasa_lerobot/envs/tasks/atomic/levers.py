"""Levers: the faucet of a sink, the switch of a kettle, a toaster."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    PartWithin,
    StateIs,
    When,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SINK = (FixtureSpec("sink", "sink"), counter_near("sink"))

_SINK_OBJECTS = (
    ObjectSpec(
        "distr_counter",
        ("any",),
        on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.1)),
        count=(1, 3),
    ),
    ObjectSpec("distr_sink", ("any",), Placement("sink", size=(0.3, 0.4), pos=(0.0, -1.0)), properties=("washable",)),
)


def _sink(
    name: str,
    summary: str,
    initial: tuple[Water | PartAt, ...],
    goal: StateIs | When | AllOf,
    verb: str,
    part: str,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
    choices: tuple[Choice, ...] = (),
    cluttered: bool = True,
    to: str = "",
    text: str = "",
) -> Task:
    return Task(
        name=name,
        summary=summary,
        fixtures=_SINK if cluttered else _SINK[:1],
        robot_start=RobotStart("sink"),
        choices=choices,
        objects=_SINK_OBJECTS if cluttered else (),
        initial=initial,
        goal=goal,
        stages=(Stage("levers", verb, "sink", part=part, to=to, text=text),),
        instruction=instruction,
        paraphrases=paraphrases,
    )


SINK = (
    _sink(
        "TurnOnSinkFaucet",
        "Water runs.",
        (Water("sink", False),),
        StateIs("sink", "water_on"),
        "on",
        "handle",
        instruction="Turn on the faucet of the sink.",
        paraphrases=(
            "Let water run into the sink.",
            "I need running water at the sink.",
            "Open the tap.",
            "Use the sink's handle so that water flows.",
        ),
    ),
    _sink(
        "TurnOffSinkFaucet",
        "No water runs.",
        (Water("sink", True),),
        StateIs("sink", "water_on", value=False),
        "off",
        "handle",
        instruction="Turn off the faucet of the sink.",
        paraphrases=(
            "Stop the water in the sink.",
            "No more water should run at the sink.",
            "Close the tap.",
            "Use the sink's handle so that the water stops.",
        ),
    ),
    _sink(
        "TurnSinkSpout",
        "The spout points to the side that the instruction names.",
        (Water("sink", None), PartAt("sink", "spout", (0.5, 0.5))),
        When("direction", {"left": StateIs("sink", "left"), "right": StateIs("sink", "right")}),
        "turn",
        "spout",
        choices=(Choice("direction", {"left": {}, "right": {}}),),
        to="{direction}",
        instruction="Turn the spout of the faucet to the {direction}.",
        paraphrases=(
            "The sink's spout should point {direction}.",
            "Rotate the faucet's spout {direction}.",
            "Push the spout over the {direction} half of the sink.",
            "Get the spout of the tap to the {direction} side.",
        ),
    ),
    _sink(
        "AdjustWaterTemperature",
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
        to="other than {start}",
        text="make the running water {target}",
        cluttered=False,
        instruction="Make the running water {target} with the sink's handle.",
        paraphrases=(
            "The {start} water should become {target} while it keeps running.",
            "Move the temperature lever of the faucet from {start} to {target}.",
            "Change the tap from {start} to {target} water without closing it.",
            "I want {target} water instead of {start} water.",
        ),
    ),
)

LEVERS = (
    Task(
        name="TurnOnElectricKettle",
        summary="The kettle's switch is down, and it heats.",
        fixtures=(FixtureSpec("electric_kettle", "electric_kettle"),),
        robot_start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (0.0, 0.0)),),
        goal=PartWithin("electric_kettle", "switch", low=0.95, label="down"),
        stages=(Stage("levers", "press", "electric_kettle", part="switch"),),
        instruction="Switch on the electric kettle.",
        paraphrases=(
            "Push the kettle's switch down.",
            "Make the electric kettle boil.",
            "The kettle should be heating.",
            "Start the electric kettle with its lever.",
        ),
    ),
    Task(
        name="TurnOnToaster",
        summary="The lever of the slots that hold the bread is down.",
        fixtures=(FixtureSpec("toaster", "toaster"),),
        robot_start=RobotStart("toaster"),
        choices=(Choice("slot", of="toaster"),),
        objects=(
            ObjectSpec(
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
        instruction="Push the lever of the toaster down.",
        paraphrases=(
            "Toast the bread that is in the toaster.",
            "The bread should go down into the toaster.",
            "Start the toaster.",
            "Press down the toaster's lever on the side with the bread.",
        ),
    ),
)

TASKS = (*SINK, *LEVERS)
