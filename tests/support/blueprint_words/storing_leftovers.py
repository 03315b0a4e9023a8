"""Storing leftovers: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectInside, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "StoreLeftoversInBowl": Ours(
        goal={
            "chicken_drumstick in bowl (contact; centre xy < 0.7*bowl radius)": ObjectOn("chicken_drumstick", "bowl"),
            "vegetable in bowl (contact; centre xy < 0.7*bowl radius)": ObjectOn("vegetable", "bowl"),
            "bowl inside fridge shelf region, any shelf (origin z between shelf floor and 90% of shelf height; bbox "
            "corners inside, tol 0.05)": ObjectInside("bowl", "fridge", region="fridge_shelf", margin=0.05, lower=0.9),
            "gripper > 0.25 m from bowl": GripperFar("bowl", 0.25),
        },
        initial={"fridge doors open": InitialOpenness("fridge", 0.9, 1.0), "robot base centred on bowl": "bowl"},
    ),
}
