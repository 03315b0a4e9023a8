"""Filling serving dishes: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, GripperFar, ObjectOn, ObjectTouches
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
        initial={"fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
    ),
    "MixedFruitPlatter": Ours(
        goal={
            "OR(fruit1 on plate1_container AND fruit2 on plate2_container, fruit1 on plate2_container AND fruit2 on "
            "plate1_container) (contact AND centre xy distance < 0.7 x plate radius)": AnyOf(
                AllOf(ObjectOn("fruit1", "plate1_container"), ObjectOn("fruit2", "plate2_container")),
                AllOf(ObjectOn("fruit1", "plate2_container"), ObjectOn("fruit2", "plate1_container")),
            ),
            "plate1_container touches dining_table (contact)": ObjectTouches("plate1_container", "dining_table"),
            "plate2_container touches dining_table (contact)": ObjectTouches("plate2_container", "dining_table"),
            **away("fruit1", "fruit2"),
        },
        initial={"fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
    ),
    "MeatSkewerAssembly": Ours(
        goal={
            f"skewer1 on oven_tray {NEAR_THE_MIDDLE.format('oven_tray')}": ObjectOn("skewer1", "oven_tray"),
            f"skewer2 on oven_tray {NEAR_THE_MIDDLE.format('oven_tray')}": ObjectOn("skewer2", "oven_tray"),
            "oven_tray touches dining_counter (contact)": ObjectTouches("oven_tray", "dining_counter"),
            **away("skewer1", "skewer2"),
        },
        initial={},
    ),
    "DisplayMeatVariety": Ours(
        goal={
            "chicken on serving_tray (contact AND centre xy distance < 0.7 x serving_tray radius)": ObjectOn(
                "chicken", "serving_tray"
            ),
            "shrimp on serving_tray (contact AND centre xy distance < 0.7 x serving_tray radius)": ObjectOn(
                "shrimp", "serving_tray"
            ),
            "beef on serving_tray (contact AND centre xy distance < 0.7 x serving_tray radius)": ObjectOn(
                "beef", "serving_tray"
            ),
            "serving_tray touches dining_table (contact)": ObjectTouches("serving_tray", "dining_table"),
            "gripper > 0.25 m from chicken": GripperFar("chicken", 0.25),
            "gripper > 0.25 m from shrimp": GripperFar("shrimp", 0.25),
            "gripper > 0.25 m from beef": GripperFar("beef", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
        turned={"serving_tray": (0.0, 0.0)},
    ),
}
