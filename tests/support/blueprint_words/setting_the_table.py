"""Setting the table: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn, ObjectTouches

OURS = {
    "ArrangeBreadBasket": Ours(
        goal={
            "bread in basket (contact AND xy centre distance < 0.7 x basket horizontal radius)": ObjectOn(
                "bread", "basket"
            ),
            "basket touching dining_table (contact)": ObjectTouches("basket", "dining_table"),
            "gripper > 0.25 m from basket": GripperFar("basket", 0.25),
        },
        initial={"cabinet doors closed": None},
    ),
}
