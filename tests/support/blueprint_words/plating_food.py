"""Plating food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn


def on(receptacle: str, *names: str) -> dict[str, ObjectOn]:
    return {
        f"{name} on {receptacle} {NEAR_THE_MIDDLE.format(receptacle)}": ObjectOn(name, receptacle) for name in names
    }


OURS = {
    "BalancedMealPrep": Ours(
        goal={**on("plate", "meat", "vegetable"), **away("meat", "vegetable")},
        initial={},
        turned={"meat_container": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "PlateSteakMeal": Ours(
        goal={
            **on("plate", "steak", "asparagus"),
            **on("tray", "random_food"),
            **away("steak", "asparagus", "random_food"),
        },
        initial={},
    ),
}
