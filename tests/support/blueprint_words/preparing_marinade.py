"""Preparing marinade: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    GripperFar,
    GripperFarFromPart,
    Near,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside
from robocasa_lerobot.envs.scene.spec import InitialOpenness

BESIDE = ("oil_or_vinegar_bottle", "shaker")

OURS = {
    "GatherMarinadeIngredients": Ours(
        goal={
            "garlic in mixing_bowl (contact AND xy centre distance < 0.7 x mixing_bowl horizontal radius)": ObjectOn(
                "garlic", "mixing_bowl"
            ),
            **{f"{name} touching any counter": ObjectTouchesAnyCounter(name) for name in BESIDE},
            **{f"{name} within 0.3 m (xy) of mixing_bowl": Near(name, "mixing_bowl", 0.3) for name in BESIDE},
            "mixing_bowl touching counter (contact)": ObjectTouches("mixing_bowl", "counter"),
            **away("garlic", *BESIDE),
        },
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
    ),
    "BlendMarinade": Ours(
        goal={
            "marinade_veg1 inside blender (slack 0.01)": ObjectInside("marinade_veg1", "blender"),
            "marinade_veg2 inside blender (slack 0.01)": ObjectInside("marinade_veg2", "blender"),
            "blender on (lid within 0.04 m of closed pose and upright within 7 deg; power button pressed "
            "and released)": StateIs("blender", "on"),
        },
        initial={
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "blender lid off, lying free on the counter beside the blender": LidAside("blender"),
            "blender off": None,
        },
        order=StateIs("blender", "on"),
        besides=frozenset({GripperFarFromPart("blender", "button")}),
    ),
    "PlaceMeatInMarinade": Ours(
        goal={
            "meat in pan (contact AND xy centre distance < 0.7 x pan horizontal radius)": ObjectOn("meat", "pan"),
            "pan touching stove (contact)": ObjectTouches("pan", "stove"),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
        },
        initial={
            "fridge doors closed (default)": None,
            "burner chosen at random among burners with a knob": "pan",
            "pan shows marinade (visual liquid)": None,
        },
        turned={"pan": (np.pi / 4, 3 * np.pi / 4)},
    ),
}
