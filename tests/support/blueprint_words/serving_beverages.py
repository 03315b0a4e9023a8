"""Serving beverages: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

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
}
