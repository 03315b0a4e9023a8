"""Adding ice to beverages: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AnyOf, GripperFar, ObjectOn


def in_glass(name: str) -> ObjectOn:
    return ObjectOn(name, "glass_cup", within=0.06)  # half a metre would leave it to the contact alone


OURS = {
    "MakeIceLemonade": Ours(
        goal={
            "lemon_wedge in glass_cup (contact; centre xy < 0.5 m)": in_glass("lemon_wedge"),
            "OR(ice_cube1 in glass_cup (contact; xy < 0.5 m), ice_cube2 in glass_cup (contact; xy < 0.5 m))": AnyOf(
                in_glass("ice_cube1"), in_glass("ice_cube2")
            ),
            "gripper > 0.15 m from lemon_wedge": GripperFar("lemon_wedge", 0.15),
            "gripper > 0.15 m from ice_cube1": GripperFar("ice_cube1", 0.15),
            "gripper > 0.15 m from ice_cube2": GripperFar("ice_cube2", 0.15),
        },
        initial={"fridge doors closed": None, "glass_cup holds lemonade (visual liquid)": "glass_cup"},
    ),
}
