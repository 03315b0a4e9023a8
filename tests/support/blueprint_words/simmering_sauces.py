"""Simmering sauces: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, Goal, Never, Not, StateIs, StepsWhile, When
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

STEPS = ("460", "480", "500")
OFF = StateIs("stove", "{knob}_on", value=False)


def simmered(steps: str) -> Goal:
    return StepsWhile(StateIs("stove", "{knob}_on"), int(steps), label=f"sauce_simmered_for_{steps}_steps")


NOT_BEFORE = When(
    "steps",
    {steps: Never(AllOf(OFF, Not(simmered(steps))), label=f"never_off_before_{steps}_steps") for steps in STEPS},
)

OURS = {
    "TurnOffSimmeredSauceHeat": Ours(
        goal={
            "{knob} burner off (knob angle < 0.35 or > 2pi-0.35)": OFF,
            "elapsed steps > simmer time": When("steps", {steps: simmered(steps) for steps in STEPS}),
            "burner never off before simmer time": NOT_BEFORE,
        },
        initial={
            "burner {knob} chosen at random among burners that have a knob": None,
            "{knob} burner on": BurnerAt("stove", "{knob}", "on"),
            "simmer time drawn uniformly from 450-500 steps": None,
            "sauce colour starts at rgba (255,120,60,100)/255": "saucepan",
        },
        order=NOT_BEFORE,
        turned={"saucepan": HANDLE_TO_FRONT},
    ),
}
