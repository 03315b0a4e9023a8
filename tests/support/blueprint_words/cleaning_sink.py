"""Cleaning the sink: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, Goal, Once, StateIs
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water

LEFT, RIGHT = StateIs("sink", "left"), StateIs("sink", "right")


def rinsed(side: str, *there: Goal) -> Once:
    return Once(AllOf(StateIs("sink", "water_on"), *there), label=f"{side}_rinsed")


MIDDLE = rinsed("center", StateIs("sink", "left", value=False), StateIs("sink", "right", value=False))

OURS = {
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
