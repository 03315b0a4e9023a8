"""Measuring ingredients: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectOn, ObjectUpright
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "WeighIngredients": Ours(
        goal={
            "obj on digital_scale (contact; centre xy < 0.7*digital_scale radius)": ObjectOn("obj", "digital_scale"),
            "obj upright (tilt < 15 deg)": ObjectUpright("obj"),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
}
