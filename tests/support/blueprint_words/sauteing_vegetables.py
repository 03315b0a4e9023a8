"""Sauteing vegetables: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Grasped,
    MovedSince,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt

STIRRED = StepsWhile(
    AllOf(
        Grasped("spatula"),
        OnBurner("pot", "stove", burner="{knob}", lit=True, within=0.15),
        ObjectOn("veg1", "pot"),
        ObjectOn("veg2", "pot"),
        MovedSince("veg1", "step", by_m=0.0005, across=True),
        MovedSince("veg2", "step", by_m=0.0005, across=True),
        ObjectTouches("spatula", "veg1"),
    ),
    5,
    label="vegetables_stirred",
)

OURS = {
    "StirVegetables": Ours(
        goal={"stirred >= 5 steps": STIRRED},
        initial={
            "burner {knob} chosen at random among burners that have a knob": "pot",
            "{knob} burner on": BurnerAt("stove", "{knob}", "on"),
        },
        order=STIRRED,
    ),
}
