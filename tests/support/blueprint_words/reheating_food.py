"""Reheating food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFarFromPart, ObjectInside, ObjectOn, StateIs

RUNS = StateIs("microwave", "on")

OURS = {
    "WaffleReheat": Ours(
        goal={
            f"waffle in waffle_container {NEAR_THE_MIDDLE.format('waffle_container')}": ObjectOn(
                "waffle", "waffle_container"
            ),
            "waffle_container inside microwave (all 8 bbox corners in interior region, tol 0.05)": ObjectInside(
                "waffle_container", "microwave", margin=0.05
            ),
            "microwave on": RUNS,
        },
        initial={"microwave door closed and off": None},
        order=RUNS,
        # It would also run while the door is ajar.
        besides=frozenset({DoorsClosed("microwave"), GripperFarFromPart("microwave", "start_button")}),
    ),
}
