"""Tidying cabinets and drawers: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    DrawerClosed,
    GripperFar,
    NearFixture,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

PARTLY_OUT = InitialOpenness("drawer", 0.49, 0.55)  # of the slide's range, of which full travel is 0.55

OURS = {
    "OrganizeCleaningSupplies": Ours(
        goal={
            "cleaner in contact with counter": ObjectTouches("cleaner", "counter"),
            "cleaner centre < 0.35 m (3D) from nearest corner of sink outer bbox": NearFixture(
                "cleaner", "sink", 0.35, to_corner=True
            ),
            "cab doors closed (every door joint <= 0.005 of range)": DoorsClosed("cab", 0.005),
            **away("cleaner"),
        },
        initial={"cab doors closed": None},
    ),
    "DrawerUtensilSort": Ours(
        goal={
            "utensil1 inside drawer (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "utensil1", "drawer", margin=0.05
            ),
            "utensil1 touches no counter": Not(ObjectTouchesAnyCounter("utensil1")),
            "utensil2 inside drawer (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "utensil2", "drawer", margin=0.05
            ),
            "utensil2 touches no counter": Not(ObjectTouchesAnyCounter("utensil2")),
            "gripper > 0.25 m from utensil1": GripperFar("utensil1", 0.25),
            "gripper > 0.25 m from utensil2": GripperFar("utensil2", 0.25),
        },
        initial={
            "drawer closed": None,
            "robot base beside the drawer (left or right at random among free sides, offset half drawer "
            "width + 0.20 m); {drawer_side} = side of the drawer seen from robot": None,
        },
    ),
    "PlaceBreakfastItemsAway": Ours(
        goal={
            "breakfast_item1 inside cabinet (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "breakfast_item1", "cabinet", margin=0.05
            ),
            "breakfast_item2 inside cabinet (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "breakfast_item2", "cabinet", margin=0.05
            ),
            "gripper > 0.25 m from breakfast_item1": GripperFar("breakfast_item1", 0.25),
            "gripper > 0.25 m from breakfast_item2": GripperFar("breakfast_item2", 0.25),
        },
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "two different item categories drawn at random from cereal, jam, syrup_bottle, honey_bottle": None,
            "robot base in front of breakfast_item1": "breakfast_item1",
        },
    ),
    "SnackSorting": Ours(
        goal={
            "bar in/on bowl (contact AND xy centre distance < 0.7 x bowl horizontal radius)": ObjectOn("bar", "bowl"),
            "drawer closed (slide <= 0.05 of 0.55 x drawer depth)": DrawerClosed("drawer", at_most=0.05),
        },
        initial={
            "drawer partly open (0.27-0.30 of slide range)": PARTLY_OUT,
            "robot base beside the drawer (left or right at random among free sides, offset half drawer "
            "width + 0.20 m); {drawer_side} = side of the drawer seen from robot": None,
        },
    ),
    "UtensilShuffle": Ours(
        goal={
            "utensil1 inside drawer (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "utensil1", "drawer", margin=0.05
            ),
            "utensil2 inside drawer (all bbox corners in an interior region, tolerance 0.05)": ObjectInside(
                "utensil2", "drawer", margin=0.05
            ),
            "NOT condiment inside drawer": Not(ObjectInside("condiment", "drawer", margin=0.05)),
            "utensil1 touches no counter": Not(ObjectTouchesAnyCounter("utensil1")),
            "utensil2 touches no counter": Not(ObjectTouchesAnyCounter("utensil2")),
            "gripper > 0.25 m from utensil1": GripperFar("utensil1", 0.25),
            "gripper > 0.25 m from utensil2": GripperFar("utensil2", 0.25),
        },
        initial={
            "cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0),
            "drawer partly open (0.27-0.30 of slide range)": PARTLY_OUT,
        },
    ),
}
