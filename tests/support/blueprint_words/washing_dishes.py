"""Washing dishes: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectInside, StateIs
from robocasa_lerobot.envs.scene.initial_states import Water

OURS = {
    "PreSoakPan": Ours(
        goal={
            "faucet on (handle angle in (0.40, pi))": StateIs("sink", "water_on"),
            "obj1 inside sink (bbox, margin 0.05 m)": ObjectInside("obj1", "sink", margin=0.05),
            "obj2 inside sink (bbox, margin 0.05 m)": ObjectInside("obj2", "sink", margin=0.05),
            "gripper > 0.25 m from obj1": GripperFar("obj1", 0.25),
            "gripper > 0.25 m from obj2": GripperFar("obj2", 0.25),
        },
        initial={"faucet off": Water("sink", on=False)},
        turned={"obj1": (np.pi / 4, 3 * np.pi / 4)},
    ),
}
