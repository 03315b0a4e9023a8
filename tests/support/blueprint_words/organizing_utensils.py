"""Organizing utensils: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import Not, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_ITS_PLACE = {
    "wooden_spoon": "cabinet",
    "wooden_spoon_2": "cabinet",
    "metallic_utensil": "drawer",
    "metallic_utensil_2": "drawer",
}
INSIDE = "(all 8 bbox corners in interior region, slack 0.05)"

OURS = {
    "ArrangeUtensilsByType": Ours(
        goal={
            sentence: goal
            for name, fixture in IN_ITS_PLACE.items()
            for sentence, goal in (
                (f"{name} inside {fixture} {INSIDE}", ObjectInside(name, fixture, margin=0.05)),
                (f"NOT {name} touching counter", Not(ObjectTouches(name, "counter"))),
            )
        }
        | dict(away(*IN_ITS_PLACE)),
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            # Of the slide's range, of which full travel is 0.55.
            "drawer open (0.27-0.30 of range (partial open))": InitialOpenness("drawer", 0.49, 0.55),
        },
    ),
}
