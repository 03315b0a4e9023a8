"""Seasoning food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    Beside,
    GripperFar,
    NearFixture,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OPEN = {"cabinet door(s) open (0.90-1.0)": InitialOpenness("cabinet", 0.9, 1.0)}
SPICES = ("spice", "bottle", "shaker")
BESIDE = Beside("shaker", "steak", "stool", across=0.25, along=0.1)

OURS = {
    "SeasoningSteak": Ours(
        goal={
            "shaker within 0.10 m of steak along the seat-facing axis": BESIDE,
            "shaker within 0.25 m of steak sideways (axes relative to the stool side)": BESIDE,
            "shaker touches dining_counter (contact)": ObjectTouches("shaker", "dining_counter"),
            **away("steak"),
        },
        initial=OPEN,
    ),
    "SetUpSpiceStation": Ours(
        goal={
            **{
                f"{name} axis-aligned bbox distance to stove <= 0.20 m": NearFixture(name, "stove", 0.2)
                for name in SPICES
            },
            **{f"{name} touches any counter (contact)": ObjectTouchesAnyCounter(name) for name in SPICES},
            **away(*SPICES),
        },
        initial=OPEN,
    ),
    "LemonSeasoningFish": Ours(
        goal={
            "lemon on fish_container (contact AND centre xy distance < 0.7 x fish_container radius)": ObjectOn(
                "lemon", "fish_container"
            ),
            "gripper > 0.25 m from lemon": GripperFar("lemon", 0.25),
        },
        initial={
            "fridge closed": None,
        },
    ),
}
