"""Arranging a buffet: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, GripperFar, Near, Not, ObjectOn, ObjectTouches

ON_TRAY = "in/on tray (contact AND xy centre distance < 0.7 x tray horizontal radius)"

MEAT, VEGETABLES = ("meat1", "meat2"), ("vegetable1", "vegetable2")
DRINKS = {
    "alcohol": ("juice", "bottled_water"),
    "juice": ("alcohol", "bottled_water"),
    "bottled_water": ("alcohol", "juice"),
}


def divided(meat_tray: str, vegetable_tray: str) -> AllOf:
    of_vegetables, of_meat = (VEGETABLES, vegetable_tray, meat_tray), (MEAT, meat_tray, vegetable_tray)
    return AllOf(
        *(ObjectOn(name, own) for names, own, _ in (of_vegetables, of_meat) for name in names),
        *(Not(ObjectOn(name, other)) for names, _, other in (of_vegetables, of_meat) for name in names),
    )


DIVIDED = AnyOf(divided("tray1_container", "tray2_container"), divided("tray2_container", "tray1_container"))

OURS = {
    "ArrangeBuffetDessert": Ours(
        goal={
            f"sweet1 {ON_TRAY}": ObjectOn("sweet1", "tray"),
            f"sweet2 {ON_TRAY}": ObjectOn("sweet2", "tray"),
            "tray in contact with dining_counter": ObjectTouches("tray", "dining_counter"),
            **away("sweet1", "sweet2", "tray", metres=0.15),
        },
        initial={
            "fridge doors closed": None,
            "one empty tray on dining_counter; other trays hold distractor food": "tray",
        },
        turned={"tray": (0.0, 0.0)},
    ),
    "CutBuffetPizza": Ours(
        goal={
            "pizza_cutter in contact with dining_counter": ObjectTouches("pizza_cutter", "dining_counter"),
            "pizza in contact with dining_counter": ObjectTouches("pizza", "dining_counter"),
            "gripper > 0.15 m from pizza_cutter": GripperFar("pizza_cutter", 0.15),
            "gripper > 0.15 m from pizza": GripperFar("pizza", 0.15),
        },
        initial={
            "drawer closed": None,
            "robot base beside the drawer (left or right at random among free sides, offset half drawer "
            "width + 0.20 m); {drawer_side} = side of the drawer seen from robot": None,
        },
        near={"drawer": "dining_counter"},
    ),
    "TongBuffetSetup": Ours(
        goal={
            "tongs in contact with dining_counter": ObjectTouches("tongs", "dining_counter"),
            "food_container in contact with dining_counter": ObjectTouches("food_container", "dining_counter"),
            "tongs within 0.5 m (xy centres) of food_container": Near("tongs", "food_container", 0.5),
            "gripper > 0.15 m from tongs": GripperFar("tongs", 0.15),
            "gripper > 0.15 m from food_container": GripperFar("food_container", 0.15),
        },
        initial={
            "drawer closed": None,
            "robot base beside the drawer (left or right at random among free sides, offset half drawer "
            "width + 0.20 m); {drawer_side} = side of the drawer seen from robot": None,
        },
        turned={"food_container": (0.0, 0.0)},
    ),
    "PlaceBeveragesTogether": Ours(
        goal={
            "alcohol in contact with dining_counter": ObjectTouches("alcohol", "dining_counter"),
            "juice in contact with dining_counter": ObjectTouches("juice", "dining_counter"),
            "bottled_water in contact with dining_counter": ObjectTouches("bottled_water", "dining_counter"),
            "each drink within 0.25 m (xy centres) of at least one other drink": AllOf(
                *(Near(name, others, 0.25) for name, others in DRINKS.items())
            ),
            "gripper > 0.15 m from alcohol": GripperFar("alcohol", 0.15),
            "gripper > 0.15 m from juice": GripperFar("juice", 0.15),
            "gripper > 0.15 m from bottled_water": GripperFar("bottled_water", 0.15),
        },
        initial={
            "robot base in front of juice": "juice",
        },
    ),
    "DivideBuffetTrays": Ours(
        goal={
            "OR(meat1 and meat2 on tray1_container AND vegetable1 and vegetable2 on tray2_container, "
            "meat1 and meat2 on tray2_container AND vegetable1 and vegetable2 on tray1_container); each "
            "'on' = contact AND xy centre distance < 0.7 x tray horizontal radius": DIVIDED,
            "no vegetable on the meat tray": DIVIDED,
            "no meat on the vegetable tray": DIVIDED,
            "gripper > 0.25 m from vegetable1": GripperFar("vegetable1", 0.25),
            "gripper > 0.25 m from vegetable2": GripperFar("vegetable2", 0.25),
            "gripper > 0.25 m from meat1": GripperFar("meat1", 0.25),
            "gripper > 0.25 m from meat2": GripperFar("meat2", 0.25),
            "gripper > 0.25 m from tray1_container": GripperFar("tray1_container", 0.25),
            "gripper > 0.25 m from tray2_container": GripperFar("tray2_container", 0.25),
        },
        initial={
            "fridge doors closed": None,
            "meats on one of the two highest fridge shelves and vegetables on the other, which one at random": "meat1",
            "each tray holds one pair of tongs": None,
        },
        turned=dict.fromkeys(("tray1_container", "tray2_container"), (0.0, 0.0)),
    ),
}
