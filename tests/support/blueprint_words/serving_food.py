"""Serving food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    GripperTouches,
    Never,
    ObjectOn,
    ObjectTouches,
    OnBurner,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

UNTOUCHED = Never(GripperTouches("vegetable"))

OURS = {
    "DessertUpgrade": Ours(
        goal={
            **{
                f"{name} in/on receptacle {ON_ITS_MIDDLE.format('receptacle')}": ObjectOn(name, "receptacle")
                for name in ("dessert1", "dessert2")
            },
            **away("receptacle"),
        },
        initial={"robot base in front of tray": "receptacle"},
        called={"tray": "receptacle"},
        turned={"receptacle": (0.0, 0.0)},
    ),
    "PlaceFoodInBowls": Ours(
        goal={
            "OR(food1 on receptacle1 AND food2 on receptacle2, food1 on receptacle2 AND food2 on receptacle1); 'on' = "
            "contact AND xy centre distance < 0.7 x bowl horizontal radius": AnyOf(
                AllOf(ObjectOn("food1", "receptacle1"), ObjectOn("food2", "receptacle2")),
                AllOf(ObjectOn("food1", "receptacle2"), ObjectOn("food2", "receptacle1")),
            ),
            "receptacle1 in contact with counter": ObjectTouches("receptacle1", "counter"),
            "receptacle2 in contact with counter": ObjectTouches("receptacle2", "counter"),
            **away("food1", "food2"),
        },
        initial={"cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0)},
    ),
    "ServeSteak": Ours(
        goal={
            "obj in/on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn(
                "obj", "plate"
            ),
            "obj_container in contact with dining_table": ObjectTouches("obj_container", "dining_table"),
            **away("obj"),
        },
        initial={"pan with steak on a burner chosen at random": "obj_container"},
        turned={"obj_container": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "PanTransfer": Ours(
        goal={
            "vegetable in/on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn(
                "vegetable", "plate"
            ),
            "vegetable_container in contact with stove": ObjectTouches("vegetable_container", "stove"),
            "vegetable_container within 0.08 m (xy centres) of a burner centre (any burner)": OnBurner(
                "vegetable_container", "stove", within=0.08
            ),
            "gripper > 0.25 m from vegetable_container": GripperFar("vegetable_container", 0.25),
            "gripper never touched vegetable in the episode": UNTOUCHED,
        },
        initial={"pan with vegetable on a burner chosen at random": "vegetable_container"},
        order=UNTOUCHED,
        turned={"vegetable_container": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "AlcoholServingPrep": Ours(
        goal={
            "alcohol in contact with dining_table": ObjectTouches("alcohol", "dining_table"),
            "cup in contact with dining_table": ObjectTouches("cup", "dining_table"),
            "gripper > 0.25 m from alcohol": GripperFar("alcohol", 0.25),
            "gripper > 0.25 m from cup": GripperFar("cup", 0.25),
        },
        initial={
            "cab doors closed": None,
        },
    ),
    "PrepareSoupServing": Ours(
        goal={
            "ladle in/on pot (contact AND xy centre distance < 0.7 x pot horizontal radius)": ObjectOn("ladle", "pot"),
            "cab doors closed (every door joint <= 0.005 of range)": DoorsClosed("cab", 0.005),
        },
        initial={
            "cab doors closed": None,
            "pot on a burner chosen at random": "pot",
        },
        turned={"ladle": (-np.pi / 8, np.pi / 8)},
    ),
}
