"""Toasting bread: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches, Once, PartWithin, StateIs

IN_SLOT = ObjectTouches("obj", "toaster", part="lever{_side}")
TOASTING = Once(AllOf(IN_SLOT, StateIs("toaster", "on{_side}")), label="bread_toasted")
OFF, UP = StateIs("toaster", "on{_side}", value=False), PartWithin("toaster", "lever{_side}", high=0.3, label="up")

OURS = {
    "GetToastedBread": Ours(
        goal={
            "toaster was turned on while obj stood in a slot of that slot pair (latched)": TOASTING,
            "obj on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn("obj", "plate"),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"toaster off, lever up": None, "slot chosen at random": "obj"},
        order=TOASTING,
        besides=frozenset({Once(AllOf(TOASTING, IN_SLOT, OFF, UP), label="bread_popped_up")}),
        turned={"obj": (0.0, 0.0)},  # along its slot
    ),
}
