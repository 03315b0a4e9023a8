"""Plating food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, DoorsClosed, ObjectInside, ObjectOn
from robocasa_lerobot.envs.tasks.registry import get_task


def on(receptacle: str, *names: str) -> dict[str, ObjectOn]:
    return {
        f"{name} on {receptacle} {NEAR_THE_MIDDLE.format(receptacle)}": ObjectOn(name, receptacle) for name in names
    }


def served(plated: str, stored: str) -> AllOf:
    return AllOf(ObjectOn(plated, "plate"), ObjectOn(stored, "bowl"), ObjectInside(stored, "fridge", margin=0.05))


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
    "PlateStoreDinner": Ours(
        goal={
            "OR(meat1 on plate AND meat2 in bowl AND meat2 inside fridge, meat2 on plate AND meat1 in bowl AND meat1 "
            "inside fridge) (receptacle test: contact AND centre xy distance < 0.7 x radius; fridge test: bbox in any "
            "fridge or freezer region, tol 0.05)": AnyOf(served("meat1", "meat2"), served("meat2", "meat1")),
            **away("meat1", "meat2"),
        },
        initial={"fridge closed": None},
        besides=frozenset({ObjectInside("bowl", "fridge", region="fridge_shelf", lower=0.9), DoorsClosed("fridge")}),
        # Of two burners that are drawn, in whichever way round.
        placed={
            each.name: each.start
            for each in get_task("PlateStoreDinner").objects
            if each.name in ("meat1_container", "meat2_container", "meat2")
        },
    ),
}
