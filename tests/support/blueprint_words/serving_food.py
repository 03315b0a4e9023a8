"""Serving food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, GripperTouches, Never, ObjectOn, ObjectTouches, OnBurner

UNTOUCHED = Never(GripperTouches("vegetable"))

OURS = {
    "PanTransfer": Ours(
        goal={
            "vegetable in/on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn(
                "vegetable", "plate"
            ),
            "vegetable_container in contact with stove": ObjectTouches("vegetable_container", "stove"),
            "vegetable_container within 0.08 m (xy centres) of a burner centre (any burner)": OnBurner(
                "vegetable_container", "stove", within=0.08
            ),
            "gripper > 0.25 m from vegetable_container": GripperFar("vegetable_container", 0.25),
            "gripper never touched vegetable in the episode": UNTOUCHED,
        },
        initial={"pan with vegetable on a burner chosen at random": "vegetable_container"},
        order=UNTOUCHED,
        turned={"vegetable_container": (np.pi / 4, 3 * np.pi / 4)},
    ),
}
