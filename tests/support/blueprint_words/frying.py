"""Frying: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn, OnBurner
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

LIT = OnBurner("pan", "stove", burner="{burner}", lit=True, within=0.15)

OURS = {
    "SearingMeat": Ours(
        goal={
            "pan on chosen burner {burner} (contact with stove; centre xy < 0.15 m; knob in [0.35, 2pi-0.35])": LIT,
            "meat in pan (contact; centre xy < 0.07 m)": ObjectOn("meat", "pan", within=0.07),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
        },
        initial={
            "burner chosen at random among those with knobs": None,
            "chosen burner knob off": BurnerAt("stove", "{burner}", "off"),
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
        },
        turned={"pan": (-0.2, 0.2)},  # across the cabinet, as theirs
    ),
}
