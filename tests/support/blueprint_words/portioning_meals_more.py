"""Portioning meals more: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, Beside, GripperFar, ObjectOn, ObjectTouchesAnyCounter, StepsWhile
from robocasa_lerobot.envs.scene.spec import InitialOpenness

WEIGHED = StepsWhile(
    AllOf(ObjectOn("meat", "digital_scale"), GripperFar("meat", 0.1)), 50, label="meat_weighed_for_50_steps"
)

OURS = {
    "PortionOnSize": Ours(
        goal={
            "bowl_small next to plate_small in stool1 frame: lateral < 0.3 m, forward < 0.05 m": Beside(
                "bowl_small", "plate_small", "stool1", across=0.3, along=0.05
            ),
            "bowl_large next to plate_large in stool2 frame: lateral < 0.4 m, forward < 0.1 m": Beside(
                "bowl_large", "plate_large", "stool2", across=0.4, along=0.1
            ),
            "bowl_small in contact with any counter": ObjectTouchesAnyCounter("bowl_small"),
            "bowl_large in contact with any counter": ObjectTouchesAnyCounter("bowl_large"),
            "gripper > 0.25 m from bowl_small": GripperFar("bowl_small", 0.25),
            "gripper > 0.25 m from bowl_large": GripperFar("bowl_large", 0.25),
        },
        initial={
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
            "which bowl is at left and which at right in cabinet is random": "bowl_small",
        },
    ),
    "ScalePortioning": Ours(
        goal={
            "meat on plate (contact; centre xy < 0.7*plate radius)": ObjectOn("meat", "plate"),
            "scale_wait_complete latched": WEIGHED,
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
        },
        initial={
            "fridge doors open": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
        order=WEIGHED,
    ),
}
