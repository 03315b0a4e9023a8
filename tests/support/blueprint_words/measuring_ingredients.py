"""Measuring ingredients: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Beside,
    DoorsClosed,
    GripperFar,
    HandlePoints,
    Not,
    ObjectOn,
    ObjectTilt,
    ObjectTouches,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

WANTED, OTHER = "measuring_cup_{size}", "measuring_cup_{_other}"

CUPS = ("measuring_cup_small", "measuring_cup_medium", "measuring_cup_large")


def right_of(name: str, other: str) -> Beside:
    return Beside(f"measuring_cup_{name}", f"measuring_cup_{other}", "counter", across=0.35, along=0.15, side="right")


OURS = {
    "ChooseMeasuringCup": Ours(
        goal={
            "target cup in contact with counter": ObjectTouches(WANTED, "counter"),
            "other cup NOT in contact with counter": Not(ObjectTouches(OTHER, "counter")),
            "gripper > 0.25 m from target cup": GripperFar(WANTED, 0.25),
        },
        initial={
            "drawer closed": None,
            "robot base to the left or right of drawer at random; {side} = side of drawer as seen by robot": None,
            "target size larger or smaller at random": None,
            "both cups are the same model at different scale": "measuring_cup_large",
        },
        called={"target": WANTED},
    ),
    "WeighIngredients": Ours(
        goal={
            "obj on digital_scale (contact; centre xy < 0.7*digital_scale radius)": ObjectOn("obj", "digital_scale"),
            "obj upright (tilt < 15 deg)": ObjectUpright("obj"),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
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
        near={"counter": "cabinet"},
        more={"cabinet"},
    ),
}
