"""Managing freezer space: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectOn, ObjectTouches, OnShelf
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task

ON_A_SHELF = "bbox in region (tol 0.05), origin z within lower 90% of region"

ANY_SHELF = "inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m)"
FREEZER_OPEN = {"freezer door open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="freezer")}

SHUT = DoorsClosed("fridge", 0.005, part="freezer")
FREEZER = InitialOpenness("fridge", 0.9, 1.0, part="freezer")
BOTH = InitialOpenness("fridge", 0.9, 1.0)

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
    "ClearFreezer": Ours(
        goal={
            "item1 in bowl (contact AND centre xy distance < 0.7 x bowl radius)": ObjectOn("item1", "bowl"),
            "item2 in bowl (contact AND centre xy distance < 0.7 x bowl radius)": ObjectOn("item2", "bowl"),
            "item3 in bowl (contact AND centre xy distance < 0.7 x bowl radius)": ObjectOn("item3", "bowl"),
            "bowl touches counter (contact)": ObjectTouches("bowl", "counter"),
            "gripper > 0.25 m from item1": GripperFar("item1", 0.25),
            "gripper > 0.25 m from item2": GripperFar("item2", 0.25),
            "gripper > 0.25 m from item3": GripperFar("item3", 0.25),
        },
        initial={
            "freezer door open (0.90-1.0)": FREEZER,
        },
    ),
    "FreezeIceTray": Ours(
        goal={
            "ice_tray inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m): bbox in "
            "region (tol 0.05), origin z within lower 90% of region": OnShelf(
                "ice_tray", "fridge", compartment="freezer"
            ),
            "freezer door closed (every joint <= 0.005 of range)": SHUT,
        },
        initial={
            "freezer door open (0.90-1.0)": FREEZER,
        },
        scales={"ice_tray": (1.0, 0.75, 1.0)},
    ),
    "MaximizeFreezerSpace": Ours(
        goal={
            "item1 inside target rack (up: highest freezer shelf; down: second highest): bbox in region "
            "(tol 0.05), origin z within lower 90% of region": OnShelf("item1", "fridge", "{_to}", "freezer"),
            "item2 inside target rack (up: highest freezer shelf; down: second highest): bbox in region "
            "(tol 0.05), origin z within lower 90% of region": OnShelf("item2", "fridge", "{_to}", "freezer"),
            "item3 inside target rack (up: highest freezer shelf; down: second highest): bbox in region "
            "(tol 0.05), origin z within lower 90% of region": OnShelf("item3", "fridge", "{_to}", "freezer"),
            "item4 inside target rack (up: highest freezer shelf; down: second highest): bbox in region "
            "(tol 0.05), origin z within lower 90% of region": OnShelf("item4", "fridge", "{_to}", "freezer"),
            "freezer door closed (every joint <= 0.005 of range)": SHUT,
        },
        initial={
            "freezer door open (0.90-1.0)": FREEZER,
            "direction up or down at random: up = source second highest rack, target highest; down = reverse": None,
        },
        placed={
            each.name: each.start for each in get_task("MaximizeFreezerSpace").objects
        },  # the halves of our freezers' fronts
    ),
    "MoveFridgeToFreezer": Ours(
        goal={
            "refrigerated_item inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m): "
            "bbox in region (tol 0.05), origin z within lower 90% of region": OnShelf(
                "refrigerated_item", "fridge", compartment="freezer"
            ),
            "freezer door closed (every joint <= 0.005 of range)": SHUT,
            "fridge door closed (every joint <= 0.005 of range)": DoorsClosed("fridge", 0.005, part="fridge"),
            "fridge_distractor inside any fridge shelf (region bottom z 0.5-1.5 m, height >= 0.20 m): "
            "bbox in region (tol 0.05), origin z within lower 90% of region": OnShelf("fridge_distractor", "fridge"),
            "freezer_distractor inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m): "
            "bbox in region (tol 0.05), origin z within lower 90% of region": OnShelf(
                "freezer_distractor", "fridge", compartment="freezer"
            ),
        },
        initial={
            "freezer door open (0.90-1.0)": BOTH,
            "fridge door(s) open (0.90-1.0)": BOTH,
        },
    ),
    "ReorganizeFrozenVegetables": Ours(
        goal={
            "vegetable1 in tupperware (contact AND centre xy distance < 0.7 x tupperware radius)": ObjectOn(
                "vegetable1", "tupperware"
            ),
            "vegetable2 in tupperware (contact AND centre xy distance < 0.7 x tupperware radius)": ObjectOn(
                "vegetable2", "tupperware"
            ),
            "tupperware inside any freezer shelf (region bottom z 0.5-1.5 m, height >= 0.20 m): bbox in "
            "region (tol 0.05), origin z within lower 90% of region": OnShelf(
                "tupperware", "fridge", compartment="freezer"
            ),
            "gripper > 0.25 m from vegetable1": GripperFar("vegetable1", 0.25),
            "gripper > 0.25 m from vegetable2": GripperFar("vegetable2", 0.25),
            "gripper > 0.25 m from tupperware": GripperFar("tupperware", 0.25),
        },
        initial={
            "freezer door open (0.90-1.0)": FREEZER,
        },
    ),
}
