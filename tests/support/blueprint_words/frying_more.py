"""Frying in several pans: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, ObjectOn, OnBurner
from robocasa_lerobot.envs.tasks.registry import get_task

OURS = {
    "MealPrepStaging": Ours(
        goal={
            "pan1 on a burner (contact with stove; centre xy < 0.08 m)": OnBurner("pan1", "stove", within=0.08),
            "pan2 on a burner (contact with stove; centre xy < 0.08 m)": OnBurner("pan2", "stove", within=0.08),
            "burner of pan1 != burner of pan2": OnBurner("pan1", "stove", within=0.08, other_than="pan2"),
            "OR(vegetable in pan1 AND meat in pan2, vegetable in pan2 AND meat in pan1); in = contact, centre xy < "
            "0.7*pan radius": AnyOf(
                AllOf(ObjectOn("vegetable", "pan1"), ObjectOn("meat", "pan2")),
                AllOf(ObjectOn("vegetable", "pan2"), ObjectOn("meat", "pan1")),
            ),
        },
        initial={"all burners off": None},
        more={"right_counter"},
        placed={wanted.name: wanted.start for wanted in get_task("MealPrepStaging").objects},  # on either counter
    ),
}
