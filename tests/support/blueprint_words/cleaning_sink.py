"""Cleaning the sink: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Goal,
    NearFixture,
    Not,
    ObjectOn,
    ObjectTouchesAnyCounter,
    Once,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water

LEFT, RIGHT = StateIs("sink", "left"), StateIs("sink", "right")


def rinsed(side: str, *there: Goal) -> Once:
    return Once(AllOf(StateIs("sink", "water_on"), *there), label=f"{side}_rinsed")


MIDDLE = rinsed("center", StateIs("sink", "left", value=False), StateIs("sink", "right", value=False))

AWAY = ("mug1", "mug2", "bowl")


def far(name: str) -> Not:
    return Not(NearFixture(name, "sink", 1.0))


OURS = {
    "ClearSinkArea": Ours(
        goal={
            "mug1 >= 1.0 m (3D centres) from food": far("mug1"),
            "mug2 >= 1.0 m (3D centres) from food": far("mug2"),
            "bowl >= 1.0 m (3D centres) from food (distances are to the food object, not the sink; no surface contact "
            "checked)": far("bowl"),
            **away("mug1", "mug2", "bowl"),
        },
        initial={},
        besides=frozenset(map(ObjectTouchesAnyCounter, AWAY)),
        more={"spot"},
    ),
    "ClearFoodWaste": Ours(
        goal={
            **{
                f"{name} in/on colander {ON_ITS_MIDDLE.format('colander')}": ObjectOn(name, "colander")
                for name in ("food_0", "food_1")
            },
            **away("food_0", "food_1"),
        },
        initial={"faucet off": Water("sink", on=False)},
    ),
    "RinseSinkBasin": Ours(
        goal={
            "water seen running with spout in left sector (spout angle mod 2pi in [pi, 2pi-pi/6])": rinsed(
                "left", LEFT
            ),
            "water seen running with spout in center sector (within pi/6 of 0)": MIDDLE,
            "water seen running with spout in right sector (in [pi/6, pi])": rinsed("right", RIGHT),
        },
        initial={
            "faucet off": Water("sink", on=False),
            "spout at default (center)": PartAt("sink", "spout", (0.5, 0.5)),
        },
        order=MIDDLE,
    ),
}
