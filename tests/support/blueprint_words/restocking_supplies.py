"""Restocking supplies: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    NearerThan,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_A_REGION = "(all bbox corners within one interior region, tol 0.05)"

OPEN = {"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)}
ALCOHOL, SOFT = ("alcohol1", "alcohol2"), ("non_alcohol1", "non_alcohol2")


def sorted_into(first: str, second: str) -> AllOf:
    stored = [ObjectInside(name, first) for name in ALCOHOL] + [ObjectInside(name, second) for name in SOFT]
    return AllOf(*stored)


OURS = {
    "BeverageSorting": Ours(
        goal={
            "OR(alcohol1 AND alcohol2 inside cabinet1 AND non_alcohol1 AND non_alcohol2 inside cabinet2, alcohol1 AND "
            "alcohol2 inside cabinet2 AND non_alcohol1 AND non_alcohol2 inside cabinet1); inside = all bbox corners "
            "within one interior region, tol 0.05": AnyOf(
                sorted_into("cabinet1", "cabinet2"), sorted_into("cabinet2", "cabinet1")
            ),
            **away(*ALCOHOL, *SOFT),
        },
        initial={
            "both cabinets' doors open": InitialOpenness("cabinet1", 0.9, 1.0),
            "robot base centred on alcohol1": "alcohol1",
        },
        more_initial=frozenset({InitialOpenness("cabinet2", 0.9, 1.0)}),
        called={"drink": ""},
    ),
    "RefillCondimentStation": Ours(
        goal={
            "condiment in contact with dining_counter": ObjectTouches("condiment", "dining_counter"),
            **away("condiment"),
        },
        initial={
            "cabinet doors closed": None,
            "condiment category chosen at random among graspable ones; the item on the dining counter is of the same "
            "category": "dining_table_condiment",
        },
    ),
    "RestockCannedFood": Ours(
        goal={
            f"canned_food_new inside cabinet {IN_A_REGION}": ObjectInside("canned_food_new", "cabinet", margin=0.05),
            "canned_food_old in contact with any counter": ObjectTouchesAnyCounter("canned_food_old"),
            **away("canned_food_old", "canned_food_new"),
        },
        initial=OPEN,
    ),
    "RestockPantry": Ours(
        goal={
            **{
                f"{name} inside cabinet {IN_A_REGION}": ObjectInside(name, "cabinet", margin=0.05)
                for name in ("obj1", "obj2")
            },
            **{
                f"2*dist({name}, cab_obj1) < dist({name}, cab_obj2)": NearerThan(
                    name, "cab_obj1", "cab_obj2", factor=2.0
                )
                for name in ("obj1", "obj2")
            },
            **away("obj1", "obj2"),
        },
        initial={
            "cabinet doors fully open (1.0)": InitialOpenness("cabinet", 1.0, 1.0),
            "side of cabinet that already holds a can is left or right at random": "cab_obj1",
        },
    ),
    "RestockBowls": Ours(
        goal={
            f"obj1 inside cabinet {IN_A_REGION}": ObjectInside("obj1", "cabinet", margin=0.05),
            f"obj2 inside cabinet {IN_A_REGION}": ObjectInside("obj2", "cabinet", margin=0.05),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
        },
        initial={"cabinet doors closed": None},
    ),
}
