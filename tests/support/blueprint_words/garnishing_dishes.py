"""Garnishing dishes: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn, ObjectTouches

ON_TOP = "(contact AND xy centre distance < 0.7 x {} horizontal radius)"

OURS = {
    "GarnishPancake": Ours(
        goal={
            f"strawberry in/on pancake {ON_TOP.format('pancake')}": ObjectOn("strawberry", "pancake"),
            f"pancake in/on pancake_container {ON_TOP.format('pancake_container')}": ObjectOn(
                "pancake", "pancake_container"
            ),
            "pancake_container in contact with dining_counter": ObjectTouches("pancake_container", "dining_counter"),
            "gripper > 0.25 m from strawberry": GripperFar("strawberry", 0.25),
        },
        initial={"fridge doors closed": None},
    ),
}
