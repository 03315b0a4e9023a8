"""Steaming food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    OnBurner,
    Once,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

RUNS = StateIs("microwave", "on")

WATER = StateIs("sink", "water_on")
RINSED = Once(AllOf(ObjectInside("vegetable1", "sink", margin=0.05), WATER), label="vegetable1_rinsed")

OURS = {
    "SteamFish": Ours(
        goal={
            "pan touching stove and within 0.15 m (xy) of the {knob} burner site, that burner on": OnBurner(
                "pan", "stove", burner="{knob}", lit=True, within=0.15
            ),
            "fish in pan (contact; xy dist < 0.7 x pan radius)": ObjectOn("fish", "pan"),
            "{knob} burner on (knob angle in [0.35, 2pi-0.35])": StateIs("stove", "{knob}_on"),
            **away("fish", "pan"),
        },
        initial={
            "burner {knob} chosen at random among burners that have a knob": None,
            "all burners off": None,
            "pan shows dark sauce liquid rgba (0.28,0.12,0.05,0.6)": "pan",
        },
        turned={"pan": HANDLE_TO_FRONT},
    ),
    "MultistepSteaming": Ours(
        goal={
            "water was on at some step": Once(WATER, label="water_was_on"),
            "vegetable1 was inside sink (bbox, margin 0.05 m) while water was on at some step": RINSED,
            "faucet off now (handle angle not in (0.40, pi))": StateIs("sink", "water_on", value=False),
            "pot touching stove and within 0.08 m (xy) of the {knob} burner site": OnBurner(
                "pot", "stove", burner="{knob}", within=0.08
            ),
            "vegetable1 in pot (contact; xy dist < 0.7 x pot radius)": ObjectOn("vegetable1", "pot"),
        },
        initial={
            "faucet off": Water("sink", on=False),
            "burner {knob} chosen at random among burners that have a knob": None,
            "{knob} burner off": None,
        },
        order=RINSED,
    ),
    "SteamInMicrowave": Ours(
        goal={
            "vegetable in bowl (contact; xy dist < 0.7 x bowl radius)": ObjectOn("vegetable", "bowl"),
            "bowl inside microwave (bbox, margin 0.05 m)": ObjectInside("bowl", "microwave", margin=0.05),
            "microwave door closed (<= 0.005 of range)": DoorsClosed("microwave", 0.005),
            "microwave on (start button pressed)": RUNS,
        },
        initial={
            "faucet off": Water("sink", on=False),
            "microwave door open (0.90-1.0 of range) and off": InitialOpenness("microwave", 0.9, 1.0),
        },
        order=RUNS,
        besides=frozenset({GripperFarFromPart("microwave", "start_button")}),
    ),
}
