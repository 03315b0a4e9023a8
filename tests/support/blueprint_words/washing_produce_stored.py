"""Washing what is stored elsewhere: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    GripperFar,
    ObjectInside,
    ObjectOn,
    StateIs,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

FRIDGE = {"fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")}
IN = "(contact AND centre xy distance < 0.7 x {} radius)"
WASHED = StepsWhile(UnderWater("vegetable", "sink"), 11, consecutive=True, label="vegetable_washed")


def both_in(vessel: str, *names: str) -> dict[str, ObjectOn]:
    return {f"{name} in {vessel} {IN.format(vessel)}": ObjectOn(name, vessel) for name in names}


def sorted_into(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn("food1", first), ObjectOn("food2", first), ObjectOn("food3", second))


SORTED = AnyOf(sorted_into("bowl1", "bowl2"), sorted_into("bowl2", "bowl1"))
SAID_SORTED = (
    "OR(food1 in bowl1 AND food2 in bowl1 AND food3 in bowl2, food1 in bowl2 AND food2 in bowl2 AND food3 in bowl1) "
    "(contact AND centre xy distance < 0.7 x bowl radius)"
)

OURS = {
    "GatherProduceWashing": Ours(
        goal={**both_in("bowl", "food0", "food1"), **away("food0", "food1")},
        initial=FRIDGE,
    ),
    "WashInSaucepan": Ours(
        goal={**both_in("saucepan", "vegetable0", "vegetable1"), **away("vegetable0", "vegetable1")},
        initial={**FRIDGE, "saucepan shows water": "saucepan"},
        turned={"saucepan": (np.pi, np.pi)},
    ),
    "PrepareVegetableRoasting": Ours(
        goal={
            "washed: vegetable under running water > 10 consecutive steps (centre xy within its radius of stream, "
            "below its top, faucet on)": WASHED,
            "vegetable on tray (contact AND centre xy distance < 0.7 x tray radius)": ObjectOn("vegetable", "tray"),
            **away("vegetable"),
        },
        initial={**FRIDGE, "faucet on": Water("sink", on=True)},
        order=WASHED,
    ),
    "PrewashFoodAssembly": Ours(
        goal={
            "gripper > 0.25 m from bowl": GripperFar("bowl", 0.25),
            **both_in("bowl", "food"),
            "bowl inside sink (all 8 bbox corners in interior region, tol 0.05)": ObjectInside(
                "bowl", "sink", margin=0.05
            ),
            "faucet on (handle joint in (0.40, pi) rad)": StateIs("sink", "water_on"),
        },
        initial={
            "cabinet door(s) open (0.90-1.0)": InitialOpenness("cab", 0.9, 1.0),
            "faucet off": Water("sink", on=False),
        },
    ),
    "PrewashFoodSorting": Ours(
        goal={SAID_SORTED: SORTED},
        initial={
            "cabinet door(s) open (0.90-1.0)": InitialOpenness("cabinet", 0.9, 1.0),
            "two different produce categories A, B drawn at random": "food3",
        },
    ),
}
