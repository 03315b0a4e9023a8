"""Making salads: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import StepsWhile, UnderWater
from robocasa_lerobot.envs.scene.initial_states import Water

WASHED = StepsWhile(UnderWater("lettuce", "sink"), 25)

OURS = {
    "WashLettuce": Ours(
        goal={"washed >= 25 steps in total under running water": WASHED},
        initial={"faucet off": Water("sink", on=False)},
        order=WASHED,
    ),
}
