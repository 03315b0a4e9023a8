"""Tidying cabinets and drawers: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import DoorsClosed, NearFixture, ObjectTouches

OURS = {
    "OrganizeCleaningSupplies": Ours(
        goal={
            "cleaner in contact with counter": ObjectTouches("cleaner", "counter"),
            "cleaner centre < 0.35 m (3D) from nearest corner of sink outer bbox": NearFixture(
                "cleaner", "sink", 0.35, to_corner=True
            ),
            "cab doors closed (every door joint <= 0.005 of range)": DoorsClosed("cab", 0.005),
            **away("cleaner"),
        },
        initial={"cab doors closed": None},
    ),
}
