"""Steaming food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFarFromPart, ObjectInside, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

RUNS = StateIs("microwave", "on")

OURS = {
    "SteamInMicrowave": Ours(
        goal={
            "vegetable in bowl (contact; xy dist < 0.7 x bowl radius)": ObjectOn("vegetable", "bowl"),
            "bowl inside microwave (bbox, margin 0.05 m)": ObjectInside("bowl", "microwave", margin=0.05),
            "microwave door closed (<= 0.005 of range)": DoorsClosed("microwave", 0.005),
            "microwave on (start button pressed)": RUNS,
        },
        initial={
            "faucet off": Water("sink", on=False),
            "microwave door open (0.90-1.0 of range) and off": InitialOpenness("microwave", 0.9, 1.0),
        },
        order=RUNS,
        besides=frozenset({GripperFarFromPart("microwave", "start_button")}),
    ),
}
