"""Storing leftovers: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    Exactly,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    OnShelf,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

DUMPLINGS = ("dumpling1", "dumpling2", "dumpling3", "dumpling4")
OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")


def two_in(box: str) -> Exactly:
    return Exactly(2, *(ObjectOn(name, box) for name in DUMPLINGS))


OURS = {
    "StoreLeftoversInBowl": Ours(
        goal={
            "chicken_drumstick in bowl (contact; centre xy < 0.7*bowl radius)": ObjectOn("chicken_drumstick", "bowl"),
            "vegetable in bowl (contact; centre xy < 0.7*bowl radius)": ObjectOn("vegetable", "bowl"),
            "bowl inside fridge shelf region, any shelf (origin z between shelf floor and 90% of shelf height; bbox "
            "corners inside, tol 0.05)": OnShelf("bowl", "fridge"),
            "gripper > 0.25 m from bowl": GripperFar("bowl", 0.25),
        },
        initial={"fridge doors open": OPEN, "robot base centred on bowl": "bowl"},
    ),
    "FreezeCookedFood": Ours(
        goal={
            "cooked_food inside freezer shelf region, any shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("cooked_food", "fridge", compartment="freezer"),
            "freezer door closed (<= 0.005 of range)": DoorsClosed("fridge", 0.005, part="freezer"),
        },
        initial={
            "freezer door open": InitialOpenness("fridge", 0.9, 1.0, part="freezer"),
            "robot base centred on cooked_food": "cooked_food",
        },
    ),
    "PrepareStoringLeftovers": Ours(
        goal={
            "tupperware in contact with dining_counter": ObjectTouches("tupperware", "dining_counter"),
            "aluminum_foil in contact with dining_counter": ObjectTouches("aluminum_foil", "dining_counter"),
            "distance tupperware to plate < 0.3 m (3D)": Near("tupperware", "plate", 0.3, in_space=True),
            "distance aluminum_foil to plate < 0.3 m (3D)": Near("aluminum_foil", "plate", 0.3, in_space=True),
            "gripper > 0.25 m from tupperware": GripperFar("tupperware", 0.25),
            "gripper > 0.25 m from aluminum_foil": GripperFar("aluminum_foil", 0.25),
        },
        initial={
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
            "foil at left or right in cabinet at random, tupperware at the other side": "aluminum_foil",
        },
    ),
    "StoreDumplings": Ours(
        goal={
            "exactly 2 dumplings in tupperware1": two_in("tupperware1"),
            "exactly 2 dumplings in tupperware2 (in = contact, centre xy < 0.7*tupperware radius)": two_in(
                "tupperware2"
            ),
            "tupperware1 inside fridge shelf region, any shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("tupperware1", "fridge"),
            "tupperware2 inside fridge shelf region, any shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("tupperware2", "fridge"),
            "gripper > 0.25 m from dumpling1": GripperFar("dumpling1", 0.25),
            "gripper > 0.25 m from dumpling2": GripperFar("dumpling2", 0.25),
            "gripper > 0.25 m from dumpling3": GripperFar("dumpling3", 0.25),
            "gripper > 0.25 m from dumpling4": GripperFar("dumpling4", 0.25),
            "gripper > 0.25 m from tupperware1": GripperFar("tupperware1", 0.25),
            "gripper > 0.25 m from tupperware2": GripperFar("tupperware2", 0.25),
        },
        initial={
            "fridge doors open": OPEN,
            "dumpling3 and dumpling4 each on plate 1 or 2 at random": None,
        },
    ),
    "StoreLeftoversByType": Ours(
        goal={
            "meat_counter inside fridge shelf region, meat shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("meat_counter", "fridge", "{meat_shelf}"),
            "meat_fridge inside fridge shelf region, meat shelf (origin z between shelf floor and 90% of "
            "shelf height; bbox corners inside, tol 0.05)": OnShelf("meat_fridge", "fridge", "{meat_shelf}"),
            "vegetable_counter inside fridge shelf region, vegetable shelf (origin z between shelf floor "
            "and 90% of shelf height; bbox corners inside, tol 0.05)": OnShelf(
                "vegetable_counter", "fridge", "{_vegetable_shelf}"
            ),
            "vegetable_fridge inside fridge shelf region, vegetable shelf (origin z between shelf floor "
            "and 90% of shelf height; bbox corners inside, tol 0.05)": OnShelf(
                "vegetable_fridge", "fridge", "{_vegetable_shelf}"
            ),
            "gripper > 0.25 m from meat_counter": GripperFar("meat_counter", 0.25),
            "gripper > 0.25 m from vegetable_counter": GripperFar("vegetable_counter", 0.25),
        },
        initial={
            "fridge doors open": OPEN,
            "meat shelf is the top shelf (-1) or the second (-2) at random; vegetable shelf is the other": None,
        },
    ),
}
