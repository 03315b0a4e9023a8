"""Washing produce: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    GripperFar,
    ObjectInBasin,
    ObjectOn,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water

UNDER = UnderWater("colander", "sink")
LOADED = ForEach("fruit", lambda name: ObjectOn(name, "colander"))

OURS = {
    "WashFruitColander": Ours(
        goal={
            "colander under running water (centre xy within colander radius of stream, below its top, "
            "faucet on)": UNDER,
            "every fruit{i} in colander (contact AND centre xy distance < 0.7 x colander radius)": LOADED,
        },
        initial={"faucet off": Water("sink", on=False), "number of fruits N = 1, 2 or 3 at random": None},
        besides=frozenset(
            {
                StepsWhile(AllOf(UNDER, LOADED), 25, label="fruit_washed"),  # a passing moment would count
                ObjectInBasin("colander", "sink"),
                GripperFar("colander"),
            }
        ),
    ),
}
