"""Setting the table: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Beside, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.typical import stages_of

SORTED = stages_of(get_task("SizeSorting"))  # of two or three, in one scene

CLOSE = "|dx| <= 0.25 m, |dy| <= 0.10 m"


def beside_plate(name: str, side: str) -> Beside:
    return Beside(name, "plate", "stool", across=0.25, along=0.1, side=side)


OURS = {
    "AlignSilverware": Ours(
        goal={
            f"fork left of plate in the sitter's frame (stool): fork x < plate x, {CLOSE}": beside_plate(
                "fork", "left"
            ),
            f"spoon right of plate in the sitter's frame: spoon x > plate x, {CLOSE}": beside_plate("spoon", "right"),
            "fork touching dining_counter (contact)": ObjectTouches("fork", "dining_counter"),
            "spoon touching dining_counter (contact)": ObjectTouches("spoon", "dining_counter"),
            **away("plate"),
        },
        initial={},
        besides=frozenset({GripperFar("fork"), GripperFar("spoon")}),
    ),
    "ArrangeBreadBasket": Ours(
        goal={
            "bread in basket (contact AND xy centre distance < 0.7 x basket horizontal radius)": ObjectOn(
                "bread", "basket"
            ),
            "basket touching dining_table (contact)": ObjectTouches("basket", "dining_table"),
            "gripper > 0.25 m from basket": GripperFar("basket", 0.25),
        },
        initial={"cabinet doors closed": None},
    ),
    "DateNight": Ours(
        goal={
            "decoration touching dining_table (contact)": ObjectTouches("decoration", "dining_table"),
            "alcohol touching dining_table (contact)": ObjectTouches("alcohol", "dining_table"),
            **away("decoration", "alcohol"),
        },
        initial={"cabinet doors closed": None},
    ),
    "SetBowlsForSoup": Ours(
        goal={
            "OR(bowl1 on plate1 AND bowl2 on plate2, bowl1 on plate2 AND bowl2 on plate1); on = contact AND xy centre "
            "distance < 0.7 x plate horizontal radius": AnyOf(
                AllOf(ObjectOn("bowl1", "plate1"), ObjectOn("bowl2", "plate2")),
                AllOf(ObjectOn("bowl1", "plate2"), ObjectOn("bowl2", "plate1")),
            ),
            **away("bowl1", "bowl2"),
        },
        initial={"cabinet doors closed": None},
    ),
    "SeasoningSpiceSetup": Ours(
        goal={
            "condiment1 touching dining_table (contact)": ObjectTouches("condiment1", "dining_table"),
            "condiment2 touching dining_table (contact)": ObjectTouches("condiment2", "dining_table"),
            **away("condiment1", "condiment2"),
        },
        initial={"cabinet doors closed": None},
    ),
    "SetupFruitBowl": Ours(
        goal={
            "fruit1 in bowl (contact AND xy centre distance < 0.7 x bowl horizontal radius)": ObjectOn(
                "fruit1", "bowl"
            ),
            "fruit2 in bowl (contact AND xy centre distance < 0.7 x bowl horizontal radius)": ObjectOn(
                "fruit2", "bowl"
            ),
            "bowl touching dining_counter (contact)": ObjectTouches("bowl", "dining_counter"),
            **away("bowl"),
        },
        initial={"fridge doors closed (default)": None, "two different fruit categories drawn at random": "fruit2"},
    ),
    "SizeSorting": Ours(
        goal={
            "for every i >= 1: obj_i in obj_{i-1} (contact AND xy centre distance < 0.7 x obj_{i-1} horizontal "
            "radius)": AllOf(*(ObjectOn(stage.object, stage.target) for stage in SORTED)),
            "gripper > 0.25 m from obj_0": GripperFar("obj_0", 0.25),
        },
        initial={"category cup or bowl at random": None, "number of objects 2 or 3 at random": None},
        placed={"obj": get_task("SizeSorting").objects[0].start},  # cups and bowls in one strip
        scales={"obj": (1.0, 1.0, 1.0)},  # of the largest; the others follow by 0.8
    ),
}
