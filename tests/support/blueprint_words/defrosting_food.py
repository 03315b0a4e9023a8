"""Defrosting food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectInside, StateIs

RUNS = StateIs("microwave", "on")

OURS = {
    "MicrowaveThawing": Ours(
        goal={
            "obj inside microwave (bbox, margin 0.05 m)": ObjectInside("obj", "microwave", margin=0.05),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
            "microwave on (start button pressed with door not open >= 0.90)": RUNS,
        },
        initial={"microwave door closed and off": None},
        order=RUNS,
        besides=frozenset({DoorsClosed("microwave")}),  # it would also run while the door is ajar
        same={"distractor_counter": "counter"},
    ),
}
