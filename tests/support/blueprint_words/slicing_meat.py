"""Slicing meat: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import GripperFar, ObjectInside, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_BOARD = f"on receptacle {NEAR_THE_MIDDLE.format('receptacle')}"

IN_SINK = "inside sink (all 8 bbox corners in interior region, tol 0.05)"

OURS = {
    "CleanBoard": Ours(
        goal={
            f"knife {IN_SINK}": ObjectInside("knife", "sink", margin=0.05),
            f"receptacle {IN_SINK}": ObjectInside("receptacle", "sink", margin=0.05),
            "spray touches counter (contact)": ObjectTouches("spray", "counter"),
            **away("knife", "receptacle", "spray"),
        },
        initial={"cabinet door(s) open (0.90-1.0)": InitialOpenness("cabinet", 0.9, 1.0)},
        scales={"receptacle": (1.0, 1.0, 1.5), "knife": (1.5, 1.5, 2.0)},  # neither is of a kind that is graspable
    ),
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
