"""Preparing sandwiches: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectTouches, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

TIMER = PartWithin("toaster_oven", "knob_time", low=0.1, label="set")

OURS = {
    "HeatKebabSandwich": Ours(
        goal={
            "baguette touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "baguette", "toaster_oven", part="{rack}"
            ),
            "kebab touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "kebab", "toaster_oven", part="{rack}"
            ),
            "toaster_oven door NOT open (< 0.90 of range)": DoorsClosed("toaster_oven"),
            "toaster_oven time knob >= 0.1 of range": TIMER,
        },
        initial={
            "toaster_oven door fully open (1.0)": InitialOpenness("toaster_oven", 1.0, 1.0),
            "timer at 0": PartAt("toaster_oven", "knob_time", (0.0, 0.0)),
        },
        order=TIMER,
        besides=frozenset({GripperFar("baguette"), GripperFar("kebab")}),
    ),
}
