"""Arranging a buffet: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn, ObjectTouches

ON_TRAY = "in/on tray (contact AND xy centre distance < 0.7 x tray horizontal radius)"

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
    ),
}
