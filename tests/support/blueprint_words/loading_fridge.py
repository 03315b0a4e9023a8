"""Loading the fridge: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn, OnShelf
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_BOWLS = {"vegetable1": "veg_bowl", "vegetable2": "veg_bowl", "meat1": "meat_bowl", "meat2": "meat_bowl"}
ON_A_SHELF = "(bbox inside region, margin 0.05 m; height <= 90% of region)"

OURS = {
    "LoadFridgeByType": Ours(
        goal={
            **{
                f"{name} in {bowl} (contact; xy dist < 0.7 x {bowl} radius)": ObjectOn(name, bowl)
                for name, bowl in IN_BOWLS.items()
            },
            f"veg_bowl on fridge {{veg_shelf}} {ON_A_SHELF}": OnShelf("veg_bowl", "fridge", "{veg_shelf}"),
            f"meat_bowl on fridge {{meat_shelf}} {ON_A_SHELF}": OnShelf("meat_bowl", "fridge", "{_meat_shelf}"),
            **away("veg_bowl", "meat_bowl"),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "random which of top / second highest shelf is for meat, the other for vegetables": None,
        },
    ),
}
