"""Serving beverages: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Beside,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectUpright,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

BOTTLES = ("wine_bottle", "juice_bottle")


def at_side(cup: str, plate: str) -> Beside:
    return Beside(cup, plate, plate.replace("plate", "stool"), across=0.25, along=0.15)


OURS = {
    "DeliverStraw": Ours(
        goal={
            # Half a metre would leave it to the contact alone.
            "straw in glass_cup (contact; centre xy < 0.5 m)": ObjectOn("straw", "glass_cup", within=0.06),
            "gripper > 0.25 m from straw": GripperFar("straw", 0.25),
        },
        initial={"drawer closed": None},
    ),
    "PrepareDrinkStation": Ours(
        goal={
            "cup on tray (contact; centre xy < 0.7*tray radius)": ObjectOn("cup", "tray"),
            "mug on tray (contact; centre xy < 0.7*tray radius)": ObjectOn("mug", "tray"),
            "xy distance pitcher to tray centre <= 0.3 m": Near("pitcher", "tray", 0.3),
            **away("cup", "mug", "pitcher"),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "PrepareCocktailStation": Ours(
        goal={
            "lemon_wedge in bowl (contact; centre xy < 0.7*bowl radius)": ObjectOn("lemon_wedge", "bowl"),
            "liquor in contact with dining_counter": ObjectTouches("liquor", "dining_counter"),
            "xy distance liquor to bowl <= 0.35 m": Near("liquor", "bowl", 0.35),
            "glass_cup in contact with dining_counter": ObjectTouches("glass_cup", "dining_counter"),
            "xy distance glass_cup to bowl <= 0.35 m": Near("glass_cup", "bowl", 0.35),
            **away("lemon_wedge", "liquor", "glass_cup"),
        },
        initial={"fridge doors closed": None, "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "MatchCupAndDrink": Ours(
        goal={
            "xy distance wine_bottle to wine_glass <= 0.25 m": Near("wine_bottle", "wine_glass", 0.25),
            "xy distance juice_bottle to glass_cup <= 0.25 m": Near("juice_bottle", "glass_cup", 0.25),
            "gripper > 0.25 m from wine_bottle": GripperFar("wine_bottle", 0.25),
            "gripper > 0.25 m from juice_bottle": GripperFar("juice_bottle", 0.25),
        },
        initial={
            "robot base centred on wine_bottle": "wine_bottle",
        },
        besides=frozenset({*(ObjectTouches(name, "dining_counter") for name in BOTTLES), *map(ObjectUpright, BOTTLES)}),
    ),
    "SetupSodaBowl": Ours(
        goal={
            "soda1 in ice_bowl (contact; centre xy < 0.7*ice_bowl radius)": ObjectOn("soda1", "ice_bowl"),
            "soda2 in ice_bowl (contact; centre xy < 0.7*ice_bowl radius)": ObjectOn("soda2", "ice_bowl"),
            "ice_bowl in contact with dining_counter": ObjectTouches("ice_bowl", "dining_counter"),
            "gripper > 0.15 m from soda1": GripperFar("soda1", 0.15),
            "gripper > 0.15 m from soda2": GripperFar("soda2", 0.15),
            "gripper > 0.15 m from ice_bowl": GripperFar("ice_bowl", 0.15),
        },
        initial={
            "fridge doors closed": None,
        },
    ),
    "ServeMealJuice": Ours(
        goal={
            "cup1 and cup2 matched to different plates (cup1 first takes the plate with least |dx|+|dy|, "
            "cup2 the other); for each pair in the frame of that plate's stool: lateral < 0.25 m AND "
            "forward < 0.15 m": AnyOf(
                AllOf(at_side("cup1", "plate1"), at_side("cup2", "plate2")),
                AllOf(at_side("cup1", "plate2"), at_side("cup2", "plate1")),
            ),
            "cup1 in contact with dining_counter": ObjectTouches("cup1", "dining_counter"),
            "cup2 in contact with dining_counter": ObjectTouches("cup2", "dining_counter"),
            "gripper > 0.25 m from cup1": GripperFar("cup1", 0.25),
            "gripper > 0.25 m from cup2": GripperFar("cup2", 0.25),
        },
        initial={
            "both cups hold orange juice (visual liquid)": None,
            "robot base centred on cup1": "cup1",
        },
    ),
}
