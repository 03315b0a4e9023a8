"""Organizing recycling: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Near, ObjectOn, ObjectTouches, RestsOn, When

PLASTIC, GLASS = ("bottle_plastic1", "bottle_plastic2"), ("bottle_glass1", "bottle_glass2")
BOTTLES = (*PLASTIC, *GLASS, "bottle_plastic_middle", "bottle_glass_middle", "mystery_middle")

STACK = (("yogurt_container2", "yogurt_container1"), ("yogurt_container3", "yogurt_container2"))

OURS = {
    "RecycleStackedYogurt": Ours(
        goal={
            **{f"{name} in/on {other} {ON_ITS_MIDDLE.format(other)}": ObjectOn(name, other) for name, other in STACK},
            **{f"{name} z > {other} z + 0.04 m": RestsOn(name, other, higher=0.04) for name, other in STACK},
            **away("yogurt_container1", "yogurt_container2", "yogurt_container3"),
        },
        initial={},
        # The gripper opens by 8 cm.
        scales={"yogurt_container2": (1.1, 1.1, 1.1), "yogurt_container3": (0.8, 0.8, 0.8)},
    ),
    "RecycleBottlesByType": Ours(
        goal={
            "bottle_plastic_middle within 0.30 m (xy centres) of OR(bottle_plastic1, bottle_plastic2)": Near(
                "bottle_plastic_middle", PLASTIC, 0.3
            ),
            "bottle_glass_middle within 0.30 m (xy centres) of OR(bottle_glass1, bottle_glass2)": Near(
                "bottle_glass_middle", GLASS, 0.3
            ),
            "mystery_middle within 0.30 m (xy centres) of a sample bottle of its own kind (alcohol = glass, "
            "bottled_water = plastic)": When(
                "mystery",
                {"plastic": Near("mystery_middle", PLASTIC, 0.3), "glass": Near("mystery_middle", GLASS, 0.3)},
            ),
            "all 7 bottles in contact with dining_counter": AllOf(
                *(ObjectTouches(name, "dining_counter") for name in BOTTLES)
            ),
            "gripper > 0.25 m from all 7 bottles": AllOf(*(GripperFar(name, 0.25) for name in BOTTLES)),
        },
        initial={
            "plastic end and glass end (stool1/stool3) assigned at random": None,
            "mystery bottle is plastic or glass at random": "mystery_middle",
        },
        drawn={"end_ref_plastic": "plastic_end", "end_ref_glass": "_glass_end"},
        kinds={
            "stool1": "stool_at_end_of_three",
            "stool2": "stool_amid_three",
            "stool3": "stool_at_end_of_three",
        },
    ),
}
