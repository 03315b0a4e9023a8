"""Mixing and blending: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn, ObjectTouches


def on(*names: str) -> dict[str, ObjectOn]:
    wording = "{} on receptacle (contact; xy dist < 0.7 x receptacle radius)"
    return {wording.format(name): ObjectOn(name, "receptacle") for name in names}


OURS = {
    "ColorfulSalsa": Ours(goal={**on("onion", "avocado", "tomato", "bell_pepper"), **away("receptacle")}, initial={}),
    "SpicyMarinade": Ours(
        goal={
            "bowl touching counter": ObjectTouches("bowl", "counter"),
            "condiment touching counter": ObjectTouches("condiment", "counter"),
            **on("lime", "garlic"),
            **away("receptacle", "bowl", "condiment"),
        },
        initial={"cabinet doors closed": None},
    ),
}
