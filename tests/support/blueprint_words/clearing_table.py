"""Clearing the table: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import GripperFar, ObjectInBasin, ObjectInside, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

DISHES = ("receptacle1", "receptacle2")

OURS = {
    "ClearReceptaclesForCleaning": Ours(
        goal={
            **{
                f"{name} inside sink (all 8 bbox corners in interior region, slack 0.05)": ObjectInBasin(name, "sink")
                for name in DISHES
            },
            "sink water on (handle angle in (0.40, pi) rad)": StateIs("sink", "water_on"),
        },
        initial={"sink faucet off": Water("sink", on=False)},
        besides=frozenset(map(GripperFar, DISHES)),
    ),
    "CondimentCollection": Ours(
        goal={
            **{
                f"{name} inside cabinet (all 8 bbox corners in interior region, slack 0.05)": ObjectInside(
                    name, "cabinet", margin=0.05
                )
                for name in ("condiment1", "condiment2")
            },
            **away("condiment1", "condiment2"),
        },
        initial={"cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "DessertAssembly": Ours(
        goal={
            f"dessert1 in dessert1_container {ON_ITS_MIDDLE.format('dessert1_container')}": ObjectOn(
                "dessert1", "dessert1_container"
            ),
            f"dessert1_container on receptacle {ON_ITS_MIDDLE.format('receptacle')}": ObjectOn(
                "dessert1_container", "receptacle"
            ),
            f"dessert2 on receptacle {ON_ITS_MIDDLE.format('receptacle')}": ObjectOn("dessert2", "receptacle"),
            **away("receptacle"),
        },
        initial={},
    ),
}
