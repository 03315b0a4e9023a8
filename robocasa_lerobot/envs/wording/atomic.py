"""The wording of every atomic task that does not carry its own."""

from __future__ import annotations

from robocasa_lerobot.envs.wording.controls import KNOBS_LEVERS_BUTTONS
from robocasa_lerobot.envs.wording.doors import DOORS
from robocasa_lerobot.envs.wording.pick_place import PICK_AND_PLACE
from robocasa_lerobot.envs.wording.racks import DRAWERS_AND_RACKS
from robocasa_lerobot.envs.wording.words import Wording, say

NAVIGATION = {
    "NavigateKitchen": say(
        "Go to the {target}.",
        "Drive to the {target} and stop in front of it.",
        "I need you at the {target}.",
        "Move your base until you face the {target}.",
        "The {target} is where you should stand.",
    ),
}

WORDING: dict[str, Wording] = {**DOORS, **DRAWERS_AND_RACKS, **KNOBS_LEVERS_BUTTONS, **PICK_AND_PLACE, **NAVIGATION}
