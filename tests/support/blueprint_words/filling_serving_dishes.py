"""Filling serving dishes: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_ITS_PLATE = NEAR_THE_MIDDLE.format("appetizer_plate")

OURS = {
    "BuildAppetizerPlate": Ours(
        goal={
            f"cheese on appetizer_plate {ON_ITS_PLATE}": ObjectOn("cheese", "appetizer_plate"),
            f"meat on appetizer_plate {ON_ITS_PLATE}": ObjectOn("meat", "appetizer_plate"),
            f"vegetable on appetizer_plate {ON_ITS_PLATE}": ObjectOn("vegetable", "appetizer_plate"),
            "appetizer_plate touches dining_table (contact)": ObjectTouches("appetizer_plate", "dining_table"),
            "gripper > 0.25 m from cheese": GripperFar("cheese", 0.25),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
            "gripper > 0.25 m from vegetable": GripperFar("vegetable", 0.25),
        },
        initial={"fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0)},
    ),
}
