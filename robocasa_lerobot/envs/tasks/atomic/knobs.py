"""Knobs: burners of a stove, temperature and timer of ovens."""

from robocasa_lerobot.envs.predicates import (
    BurnerLevel,
    PartTurned,
    PartWithin,
    StateIs,
    When,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import on_burner
from robocasa_lerobot.envs.tasks.task import Stage, Task

KNOB = Choice("knob", of="stove")

_KETTLE = ObjectSpec(
    "kettle",
    ("kettle_non_electric",),
    Placement("stove", region=SampleRegion(name="{knob}"), size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False),
)
# In half of the scenes it stands on the burner that is meant.
_COOKWARE = ObjectSpec(
    "cookware",
    ("pan", "pot", "saucepan", "kettle_non_electric"),
    on_burner(SampleRegion(name="{knob}|any", height=(0.7, 1.2))),
)


def _stove(
    name: str,
    summary: str,
    start: str,
    goal: StateIs | BurnerLevel,
    verb: str,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
    cookware: ObjectSpec = _COOKWARE,
) -> Task:
    return Task(
        name=name,
        summary=summary,
        fixtures=(FixtureSpec("stove", "stove"),),
        robot_start=RobotStart("stove"),
        choices=(KNOB,),
        objects=(cookware,),
        initial=(BurnerAt("stove", "{knob}", start),),
        goal=goal,
        stages=(Stage("knobs", verb, "stove", part="knob_{knob}"),),
        instruction=instruction,
        paraphrases=paraphrases,
    )


STOVE = (
    _stove(
        "TurnOnStove",
        "The burner named by the instruction is on.",
        "off",
        StateIs("stove", "{knob}_on"),
        "on",
        instruction="Turn on the {knob} burner of the stove.",
        paraphrases=(
            "The {knob} burner should be burning.",
            "Use the knob of the {knob} burner to light it.",
            "Get heat from the {knob} burner.",
            "Ignite the stove at the {knob} position.",
        ),
    ),
    _stove(
        "TurnOffStove",
        "The burner named by the instruction is off.",
        "on",
        StateIs("stove", "{knob}_on", value=False),
        "off",
        instruction="Turn off the {knob} burner of the stove.",
        paraphrases=(
            "The {knob} burner should no longer burn.",
            "Use the knob of the {knob} burner to put it out.",
            "No more heat from the {knob} burner, please.",
            "Switch the stove off at the {knob} position.",
        ),
    ),
    _stove(
        "LowerHeat",
        "The burner under the kettle is on low: not off.",
        "high",
        BurnerLevel("stove", "{knob}", "low"),
        "low",
        instruction="Turn the burner under the kettle down to low.",
        paraphrases=(
            "The kettle should simmer: less heat, but do not switch it off.",
            "Set the burner below the kettle to a low flame.",
            "Take the heat under the kettle back to low.",
            "Let the kettle keep warm on a small flame.",
        ),
        cookware=_KETTLE,
    ),
)

OVENS = (
    Task(
        name="PreheatOven",
        summary="The temperature knob is at 25 % of its range or more.",
        fixtures=(FixtureSpec("oven", "oven"),),
        robot_start=RobotStart("oven"),
        initial=(PartAt("oven", "knob_temp", (0.0, 0.0)),),
        goal=PartWithin("oven", "knob_temp", low=0.25, label="raised"),
        stages=(Stage("knobs", "raise", "oven", part="knob_temp"),),
        instruction="Turn the temperature knob of the oven up to preheat it.",
        paraphrases=(
            "Start heating the oven with its temperature dial.",
            "The oven should get hot; set its temperature.",
            "Preheat the oven.",
            "Twist the oven's heat control up from zero.",
        ),
        needs=("oven",),
    ),
    Task(
        name="TurnOnToasterOven",
        summary="The timer knob is at 10 % of its range or more; it runs down with time.",
        fixtures=(FixtureSpec("toaster_oven", "toaster_oven"),),
        robot_start=RobotStart("toaster_oven"),
        initial=(PartAt("toaster_oven", "knob_time", (0.0, 0.0)),),
        goal=PartWithin("toaster_oven", "knob_time", low=0.10, label="set"),
        stages=(Stage("knobs", "raise", "toaster_oven", part="knob_time"),),
        instruction="Start the toaster oven with its timer knob.",
        paraphrases=(
            "Set some time on the toaster oven.",
            "The toaster oven should run: turn its timer.",
            "Wind up the timer dial on the toaster oven.",
            "Switch the toaster oven on by its timer.",
        ),
    ),
    Task(
        name="AdjustToasterOvenTemperature",
        summary="The temperature knob has gone by 15 % of its range from where it was, up or down as asked for.",
        fixtures=(FixtureSpec("toaster_oven", "toaster_oven"),),
        robot_start=RobotStart("toaster_oven"),
        choices=(
            Choice(
                "direction",
                {
                    "increase": {"verb": "Raise", "comparative": "hotter", "sense": "up"},
                    "decrease": {"verb": "Lower", "comparative": "cooler", "sense": "down"},
                },
            ),
        ),
        initial=(PartAt("toaster_oven", "knob_temp", {"increase": (0.0, 0.5), "decrease": (0.5, 1.0)}, "direction"),),
        goal=When(
            "direction",
            {
                "increase": PartTurned("toaster_oven", "knob_temp", 0.15, label="raised"),
                "decrease": PartTurned("toaster_oven", "knob_temp", -0.15, label="lowered"),
            },
        ),
        stages=(Stage("knobs", "turn", "toaster_oven", part="knob_temp", to="{direction}"),),
        instruction="{verb} the temperature of the toaster oven.",
        paraphrases=(
            "{verb} the heat at the toaster oven's temperature dial.",
            "The toaster oven should be {comparative}.",
            "Make the toaster oven {comparative} with its temperature knob.",
            "The temperature set on the toaster oven must go {sense}.",
        ),
    ),
)

TASKS = (*STOVE, *OVENS)
