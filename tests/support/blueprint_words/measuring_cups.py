"""Measuring cups: our words for their blueprint."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, Beside, HandlePoints, ObjectTilt, ObjectTouches

CUPS = ("measuring_cup_small", "measuring_cup_medium", "measuring_cup_large")
TO_FRONT = np.pi / 2  # where the handles of our models point to the front


def right_of(name: str, other: str) -> Beside:
    return Beside(f"measuring_cup_{name}", f"measuring_cup_{other}", "counter", across=0.35, along=0.15, side="right")


OURS = {
    "OrganizeMeasuringCups": Ours(
        goal={
            # Of the two bounds of dy the lower one leaves out nothing.
            "in counter frame, small->medium: 0 < dx < 0.35 m AND 0 < |dy| < 0.15 m": right_of("medium", "small"),
            "medium->large: 0 < dx < 0.35 m AND 0 < |dy| < 0.15 m": right_of("large", "medium"),
            # Ours: by where the handles point.
            "each cup |yaw - counter yaw| < 30 deg": AllOf(
                *(HandlePoints(name, "counter", "front", float(np.deg2rad(30.0))) for name in CUPS)
            ),
            "each cup upright (tilt < 60 deg)": AllOf(
                *(ObjectTilt(name, high=float(np.deg2rad(60.0)), label="stands") for name in CUPS)
            ),
            "each cup in contact with counter": AllOf(*(ObjectTouches(name, "counter") for name in CUPS)),
            **away(*CUPS, metres=0.15),
        },
        initial={
            "each cup yawed 35-60 deg, left or right at random": None,
            "all three cups are the same model at scale 0.8 / 1.0 / 1.2": "measuring_cup_large",
            "robot base centred on measuring_cup_medium": None,
        },
        turned=dict.fromkeys(CUPS, (TO_FRONT + 0.611, TO_FRONT + 1.047)),
        near={"counter": "cabinet"},
        more={"cabinet"},
    ),
}
