"""Loading the dishwasher: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, DoorsOpen, ObjectTouches, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "LoadDishwasher": Ours(
        goal={
            "dish0 touching dishwasher top rack (contact)": ObjectTouches("dish0", "dishwasher", part="rack1"),
            "dish1 touching dishwasher top rack (contact)": ObjectTouches("dish1", "dishwasher", part="rack1"),
            "dishwasher door closed (<= 0.05 of range)": DoorsClosed("dishwasher", 0.05),
        },
        initial={
            "dishwasher door open (0.90-1.0 of range)": InitialOpenness("dishwasher", 0.9, 1.0),
            "top rack slid out (1.0)": PartAt("dishwasher", "rack1", (1.0, 1.0)),
            "robot base beside the dishwasher, left or right at random where free (lateral half width + 0.25 m, back "
            "0.15 m)": None,
        },
    ),
    "PrepareDishwasher": Ours(
        goal={
            "dishwasher door open (>= 0.70 of range)": DoorsOpen("dishwasher", 0.7),
            "dishwasher top rack pulled out (>= 0.50 of range)": PartWithin(
                "dishwasher", "rack1", low=0.5, label="out"
            ),
        },
        initial={
            "dishwasher door closed, rack in (default)": None,
            "robot base beside the dishwasher, left or right at random where free (lateral half width + 0.275 m, back "
            "0.10 m)": None,
        },
    ),
}
