"""Freezer drawers: our words for their blueprint."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectInside
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_DRAWER = "inside highest freezer drawer: bbox in region (tol 0.05), origin z within region height"

OURS = {
    "MoveToFreezerDrawer": Ours(
        goal={
            **{
                f"{name} {IN_DRAWER}": ObjectInside(name, "fridge", region="freezer_drawer1", margin=0.05)
                for name in ("obj1", "obj2")
            },
            **away("obj1", "obj2"),
        },
        initial={
            "fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0),
            "freezer door open (0.90-1.0)": None,  # with all doors
            "highest freezer drawer open (0.90-1.0)": PartAt("fridge", "freezer_drawer1", (0.9, 1.0)),
        },
    ),
}
