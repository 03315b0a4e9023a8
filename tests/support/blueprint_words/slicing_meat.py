"""Slicing meat: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_BOARD = f"on receptacle {NEAR_THE_MIDDLE.format('receptacle')}"

OURS = {
    "RetrieveMeat": Ours(
        goal={f"meat {ON_BOARD}": ObjectOn("meat", "receptacle"), **away("meat")},
        initial={"fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
        called={"cutting": "receptacle"},
    ),
    "SetUpCuttingStation": Ours(
        goal={
            f"meat {ON_BOARD}": ObjectOn("meat", "receptacle"),
            f"knife {ON_BOARD}": ObjectOn("knife", "receptacle"),
            "gripper > 0.25 m from knife": GripperFar("knife", 0.25),
            "gripper > 0.25 m from receptacle": GripperFar("receptacle", 0.25),
        },
        initial={"drawer open (0.90-1.0)": InitialOpenness("drawer", 0.9, 1.0)},
    ),
}
