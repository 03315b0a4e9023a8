"""Clearing away: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    ForEach,
    GripperFar,
    Near,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_A_REGION = "(all 8 bbox corners in interior region, slack 0.05)"
OPEN = {"cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)}
CLUSTER = ("anchor_item", "item1", "item2")


def each_inside(name: str) -> ForEach:
    return ForEach(name, lambda one: ObjectInside(one, "cabinet", margin=0.05))


OURS = {
    "BowlAndCup": Ours(
        goal={
            f"cup in bowl {ON_ITS_MIDDLE.format('bowl')}": ObjectOn("cup", "bowl"),
            "bowl touching any counter other than dining_table": AllOf(
                ObjectTouchesAnyCounter("bowl"), Not(ObjectTouches("bowl", "dining_table"))
            ),
            **away("bowl"),
        },
        initial={},
        kinds={"counter": "counter"},
    ),
    "CandleCleanup": Ours(
        goal={
            f"obj1 inside cabinet {IN_A_REGION}": ObjectInside("obj1", "cabinet", margin=0.05),
            f"obj2 inside cabinet {IN_A_REGION}": ObjectInside("obj2", "cabinet", margin=0.05),
            "cabinet door closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
        },
        initial=OPEN,
    ),
    "ClusterItemsForClearing": Ours(
        goal={
            "anchor_item, item1 and item2 each touching dining_table": AllOf(
                *(ObjectTouches(name, "dining_table") for name in CLUSTER)
            ),
            "each of the 3 objects has its nearest other one within 0.3 m (xy)": AllOf(
                *(Near(name, tuple(other for other in CLUSTER if other != name), 0.3) for name in CLUSTER)
            ),
            **away(*CLUSTER, metres=0.15),
        },
        initial={"anchor side left (-1) or right (+1) at random": "anchor_item"},
    ),
    "DrinkwareConsolidation": Ours(
        goal={
            f"every obj_i inside cabinet {IN_A_REGION}": each_inside("obj"),
            "gripper > 0.25 m from every obj_i": ForEach("obj", lambda name: GripperFar(name, 0.25)),
        },
        initial={**OPEN, "number of drinks 1, 2 or 3 at random": None},
    ),
    "FoodCleanup": Ours(
        goal={
            f"every food_i inside cabinet {IN_A_REGION}": each_inside("food"),
            "gripper > 0.25 m from every food_i": ForEach("food", lambda name: GripperFar(name, 0.25)),
            "cabinet closed (<= 0.005 of range; always true for a shelf without doors)": DoorsClosed("cabinet", 0.005),
        },
        initial={**OPEN, "number of foods 1, 2 or 3 at random": None},
    ),
}
