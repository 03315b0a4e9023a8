"""Restocking supplies: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, ObjectInside

IN_A_REGION = "(all bbox corners within one interior region, tol 0.05)"

OURS = {
    "RestockBowls": Ours(
        goal={
            f"obj1 inside cabinet {IN_A_REGION}": ObjectInside("obj1", "cabinet", margin=0.05),
            f"obj2 inside cabinet {IN_A_REGION}": ObjectInside("obj2", "cabinet", margin=0.05),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
        },
        initial={"cabinet doors closed": None},
    ),
}
