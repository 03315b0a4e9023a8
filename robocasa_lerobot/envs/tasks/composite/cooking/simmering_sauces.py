"""Simmer sauces on the stove."""

from robocasa_lerobot.envs.predicates import AllOf, Goal, Never, Not, StateIs, StepsWhile, When
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, on_burner
from robocasa_lerobot.envs.tasks.task import Stage, Task

_STEPS = {"460": {"seconds": "twenty-three"}, "480": {"seconds": "twenty-four"}, "500": {"seconds": "twenty-five"}}
_OFF = StateIs("stove", "{knob}_on", value=False)


def _simmered(steps: str) -> Goal:
    return StepsWhile(StateIs("stove", "{knob}_on"), int(steps), label=f"sauce_simmered_for_{steps}_steps")


def _never_too_early(steps: str) -> Goal:
    return Never(AllOf(_OFF, Not(_simmered(steps))), label=f"never_off_before_{steps}_steps")


_SIMMERED = When("steps", {steps: _simmered(steps) for steps in _STEPS})

TURN_OFF_SIMMERED_SAUCE_HEAT = Task(
    name="TurnOffSimmeredSauceHeat",
    summary="The burner is off, after the sauce has simmered as long as the instruction says, and was not off before.",
    fixtures=(FixtureSpec("stove", "stove"),),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"), Choice("steps", _STEPS)),
    objects=(
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
            filled="tomato_sauce",
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=AllOf(
        _OFF,
        _SIMMERED,
        When("steps", {steps: _never_too_early(steps) for steps in _STEPS}),
    ),
    stages=(
        Stage(
            "knobs",
            "wait",
            "stove",
            part="knob_{knob}",
            until=_SIMMERED,
            text="wait until the sauce has simmered for {seconds} seconds",
        ),
        Stage("knobs", "off", "stove", part="knob_{knob}"),
    ),
    instruction="Let the tomato sauce simmer for {seconds} seconds, then turn off the burner under it.",
    paraphrases=(
        "The sauce needs {seconds} seconds more on the {knob} burner; switch that off then, not before.",
        "Wait {seconds} seconds, and turn the {knob} burner off.",
        "When the sauce has simmered for {seconds} seconds, take its heat away.",
        "After {seconds} seconds of simmering, the burner under the saucepan should be off.",
    ),
)

TASKS = (TURN_OFF_SIMMERED_SAUCE_HEAT,)
