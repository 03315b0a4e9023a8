"""Loading fridge drawers: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectInside, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "PlaceVeggiesInDrawer": Ours(
        goal={
            "vegetable1 inside highest fridge drawer (bbox, margin 0.05 m)": ObjectInside(
                "vegetable1", "fridge", region="{drawer}", margin=0.05
            ),
            "vegetable2 inside highest fridge drawer (bbox, margin 0.05 m)": ObjectInside(
                "vegetable2", "fridge", region="{drawer}", margin=0.05
            ),
            "gripper > 0.25 m from vegetable1": GripperFar("vegetable1", 0.25),
            "gripper > 0.25 m from vegetable2": GripperFar("vegetable2", 0.25),
            "highest fridge drawer closed (<= 0.02 of range)": PartWithin(
                "fridge", "{drawer}", high=0.02, label="closed"
            ),
        },
        initial={
            "fridge door(s) fully open (1.0)": InitialOpenness("fridge", 1.0, 1.0, part="fridge"),
            "highest fridge drawer open 0.5-0.8 of range": PartAt("fridge", "{drawer}", (0.5, 0.8)),
        },
        kinds={"fridge": "fridge_with_drawer"},
    ),
}
