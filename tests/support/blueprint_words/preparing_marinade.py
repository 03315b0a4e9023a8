"""Preparing marinade: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import Near, ObjectOn, ObjectTouches, ObjectTouchesAnyCounter
from robocasa_lerobot.envs.scene.spec import InitialOpenness

BESIDE = ("oil_or_vinegar_bottle", "shaker")

OURS = {
    "GatherMarinadeIngredients": Ours(
        goal={
            "garlic in mixing_bowl (contact AND xy centre distance < 0.7 x mixing_bowl horizontal radius)": ObjectOn(
                "garlic", "mixing_bowl"
            ),
            **{f"{name} touching any counter": ObjectTouchesAnyCounter(name) for name in BESIDE},
            **{f"{name} within 0.3 m (xy) of mixing_bowl": Near(name, "mixing_bowl", 0.3) for name in BESIDE},
            "mixing_bowl touching counter (contact)": ObjectTouches("mixing_bowl", "counter"),
            **away("garlic", *BESIDE),
        },
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
    ),
}
