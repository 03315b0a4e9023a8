"""Serving beverages: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn

OURS = {
    "DeliverStraw": Ours(
        goal={
            # Half a metre would leave it to the contact alone.
            "straw in glass_cup (contact; centre xy < 0.5 m)": ObjectOn("straw", "glass_cup", within=0.06),
            "gripper > 0.25 m from straw": GripperFar("straw", 0.25),
        },
        initial={"drawer closed": None},
    ),
}
