"""Cleaning appliances: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectInBasin, ObjectTouches, ObjectTouchesAnyCounter, OnShelf
from robocasa_lerobot.envs.scene.spec import InitialOpenness

STORED = ("fruit", "vegetable", "meat")

OURS = {
    "CleanBlenderJug": Ours(
        goal={
            "blender_jug inside sink (all bbox corners within one interior region, tol 0.05)": ObjectInBasin(
                "blender_jug", "sink"
            ),
            **away("blender_jug"),
        },
        initial={"robot base centred on blender_jug": "blender_jug"},
    ),
    "PrepFridgeForCleaning": Ours(
        goal={
            **{f"{name} in contact with any counter": ObjectTouchesAnyCounter(name) for name in STORED},
            **away(*STORED),
        },
        initial={"fridge doors closed": None},
        kinds={"counter": "counter"},
        near={"counter": "fridge"},
    ),
    "PrepSinkForCleaning": Ours(
        goal={
            "food_item_container (bowl) inside fridge shelf region, any shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("food_item_container", "fridge"),
            "cup in contact with cabinet": ObjectTouches("cup", "cabinet"),
            **away("food_item_container", "cup"),
        },
        initial={
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
            "fridge doors open": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
    ),
}
