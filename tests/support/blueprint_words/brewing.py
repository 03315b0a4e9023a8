"""Brewing: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, OnBurner

LIT = OnBurner("obj", "stove", lit=True, within=0.15)  # it also asks that the object touches the stove

OURS = {
    "KettleBoiling": Ours(
        goal={
            "obj in contact with stove": LIT,
            "obj within 0.15 m (xy) of a burner centre": LIT,
            "knob of that same burner in [0.35, 2pi-0.35]": LIT,
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"all stove knobs off": None, "pan or pot on a burner chosen at random": "stove_distr"},
    ),
}
