"""Managing freezer space: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectOn, OnShelf
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_A_SHELF = "bbox in region (tol 0.05), origin z within lower 90% of region"

ANY_SHELF = "inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m)"
FREEZER_OPEN = {"freezer door open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="freezer")}

OURS = {
    "FreezeBottledWaters": Ours(
        goal={
            **{
                f"{name} {ANY_SHELF}: {ON_A_SHELF}": OnShelf(name, "fridge", compartment="freezer")
                for name in ("bottle1", "bottle2")
            },
            "freezer door closed (every joint <= 0.005 of range)": DoorsClosed("fridge", 0.005, part="freezer"),
        },
        initial=FREEZER_OPEN,
    ),
    "SeparateFreezerRack": Ours(
        goal={
            f"meat in meat_tupperware {NEAR_THE_MIDDLE.format('meat_tupperware')}": ObjectOn("meat", "meat_tupperware"),
            f"vegetable1 in veg_tupperware {NEAR_THE_MIDDLE.format('veg_tupperware')}": ObjectOn(
                "vegetable1", "veg_tupperware"
            ),
            f"vegetable2 in veg_tupperware {NEAR_THE_MIDDLE.format('veg_tupperware')}": ObjectOn(
                "vegetable2", "veg_tupperware"
            ),
            f"veg_tupperware inside highest freezer shelf: {ON_A_SHELF}": OnShelf(
                "veg_tupperware", "fridge", "highest", "freezer"
            ),
            f"meat_tupperware inside second highest freezer shelf (highest if only one): {ON_A_SHELF}": OnShelf(
                "meat_tupperware", "fridge", "second_highest", "freezer"
            ),
            "gripper > 0.25 m from meat_tupperware": GripperFar("meat_tupperware", 0.25),
            "gripper > 0.25 m from veg_tupperware": GripperFar("veg_tupperware", 0.25),
        },
        initial={"freezer door open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="freezer")},
    ),
}
