"""Steaming vegetables: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import LEVEL, Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    NearFixture,
    ObjectOn,
    ObjectTouchesAnyCounter,
    OnBurner,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, Water
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

WASHED = StepsWhile(
    AllOf(UnderWater("colander", "sink"), ObjectOn("vegetable1", "colander"), ObjectOn("vegetable2", "colander")),
    50,
    label="vegetables_washed",
)
LIT = OnBurner("saucepan", "stove", burner="{knob}", lit=True, within=0.08)

OURS = {
    "PrepareVeggiesForSteaming": Ours(
        goal={
            "washed >= 50 steps in total, a step counts when: colander under running water (centre xy within colander "
            "radius of stream, below its top, faucet on) AND vegetable1 in colander AND vegetable2 in colander "
            "(contact AND centre xy distance < 0.7 x radius)": WASHED,
            "colander touches any counter (contact)": ObjectTouchesAnyCounter("colander"),
            "colander axis-aligned bbox distance to stove < 0.30 m": NearFixture("colander", "stove", 0.3),
            **away("colander"),
        },
        initial={
            "faucet on": Water("sink", on=True),
            "burner {knob} chosen at random among front burners": "saucepan",
        },
        order=WASHED,
        turned={"saucepan": HANDLE_TO_FRONT},
        more={"stove_counter"},  # where the goal wants it
    ),
    "RemoveSteamedVegetables": Ours(
        goal={
            **{
                f"{name} on serving_plate (contact AND centre xy distance < 0.7 x serving_plate radius)": ObjectOn(
                    name, "serving_plate"
                )
                for name in ("vegetable1", "vegetable2")
            },
            **away("serving_plate"),
        },
        initial={
            "burner {knob} on": BurnerAt("stove", "{knob}", "on"),
            "burner {knob} chosen at random among front burners": None,
            "saucepan shows water": "saucepan",
        },
    ),
    "SteamVeggiesWithWater": Ours(
        goal={
            **{
                f"{name} in saucepan (contact AND centre xy distance < 0.7 x saucepan radius)": ObjectOn(
                    name, "saucepan"
                )
                for name in ("vegetable1", "vegetable2")
            },
            "saucepan_auxiliary on saucepan (contact AND centre xy distance < 0.02 m)": ObjectOn(
                "saucepan_auxiliary", "saucepan", within=0.02
            ),
            "saucepan touches stove, within 0.08 m (xy) of burner {knob}": LIT,
            "burner {knob} on (knob in [0.35, 2pi-0.35])": LIT,
            **away("saucepan_auxiliary"),
        },
        initial={
            "burner {knob} on": BurnerAt("stove", "{knob}", "on"),
            "burner {knob} chosen at random among front burners": None,
            "saucepan shows water": "saucepan",
            "saucepan lid off, on counter": "saucepan_auxiliary",
        },
        besides=LEVEL,
    ),
}
