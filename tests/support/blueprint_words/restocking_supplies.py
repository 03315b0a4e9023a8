"""Restocking supplies: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    NearerThan,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnShelf,
    When,
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
    "FreshProduceOrganization": Ours(
        goal={
            "food inside fridge shelf region, shelf holding its own kind (origin z between shelf floor "
            "and 90% of shelf height; bbox corners inside, tol 0.05)": When(
                "kind",
                {
                    "fruit": OnShelf("food", "fridge", "{fruit_shelf}"),
                    "vegetable": OnShelf("food", "fridge", "{_vegetable_shelf}"),
                },
            ),
            "vegetable_fridge inside fridge shelf region, vegetable shelf (origin z between shelf floor "
            "and 90% of shelf height; bbox corners inside, tol 0.05)": OnShelf(
                "vegetable_fridge", "fridge", "{_vegetable_shelf}"
            ),
            "fruit_fridge inside fridge shelf region, fruit shelf (origin z between shelf floor and 90% "
            "of shelf height; bbox corners inside, tol 0.05)": OnShelf("fruit_fridge", "fridge", "{fruit_shelf}"),
            "fridge doors closed (<= 0.005 of range)": DoorsClosed("fridge", 0.005, part="fridge"),
            "gripper > 0.25 m from vegetable_fridge": GripperFar("vegetable_fridge", 0.25),
            "gripper > 0.25 m from fruit_fridge": GripperFar("fruit_fridge", 0.25),
            "gripper > 0.25 m from food": GripperFar("food", 0.25),
        },
        initial={
            "fridge doors open": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "food is a fruit or a vegetable at random": "food",
            "fruit shelf is the top shelf (-1) or the second (-2) at random; vegetable shelf is the other": None,
            "robot base centred on food": "food",
        },
    ),
    "StockingBreakfastFoods": Ours(
        goal={
            "obj1 inside cabinet1 (all bbox corners within one interior region, tol 0.05)": ObjectInside(
                "obj1", "cabinet1", margin=0.05
            ),
            "obj2 inside cabinet2 (all bbox corners within one interior region, tol 0.05)": ObjectInside(
                "obj2", "cabinet2", margin=0.05
            ),
            "gripper > 0.25 m from obj1": GripperFar("obj1", 0.25),
            "gripper > 0.25 m from obj2": GripperFar("obj2", 0.25),
        },
        initial={
            "both cabinets' doors open": InitialOpenness("cabinet1", 0.9, 1.0),
        },
        more_initial=frozenset({InitialOpenness("cabinet2", 0.9, 1.0)}),
    ),
}
