"""Sorting ingredients: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, Near, ObjectOn, ObjectTouches, When
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "SeparateRawIngredients": Ours(
        goal={
            "meat_ingredient on cutting_board (contact AND xy centre distance < 0.7 x cutting_board "
            "horizontal radius)": ObjectOn("meat_ingredient", "cutting_board"),
            "vegetable_ingredient in vegetable_bowl (contact AND xy centre distance < 0.7 x "
            "vegetable_bowl horizontal radius)": ObjectOn("vegetable_ingredient", "vegetable_bowl"),
            "OR(random type meat AND random_ingredient on cutting_board, random type vegetable AND "
            "random_ingredient in vegetable_bowl), same contact/radius rule": When(
                "kind",
                {
                    "meat": ObjectOn("random_ingredient", "cutting_board"),
                    "vegetable": ObjectOn("random_ingredient", "vegetable_bowl"),
                },
            ),
            "gripper > 0.25 m from meat_ingredient": GripperFar("meat_ingredient", 0.25),
            "gripper > 0.25 m from vegetable_ingredient": GripperFar("vegetable_ingredient", 0.25),
            "gripper > 0.25 m from random_ingredient": GripperFar("random_ingredient", 0.25),
        },
        initial={
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "type of the third ingredient meat or vegetable at random": "random_ingredient",
        },
    ),
    "SortBreakfastIngredients": Ours(
        goal={
            "jam within 0.3 m (xy) of bread_plate": Near("jam", "bread_plate", 0.3),
            "cereal within 0.3 m (xy) of milk": Near("cereal", "milk", 0.3),
            "jam touching any counter": ObjectTouches("jam", "dining_counter"),
            "cereal touching any counter": ObjectTouches("cereal", "dining_counter"),
            "gripper > 0.25 m from jam": GripperFar("jam", 0.25),
            "gripper > 0.25 m from cereal": GripperFar("cereal", 0.25),
        },
        initial={},
    ),
}
