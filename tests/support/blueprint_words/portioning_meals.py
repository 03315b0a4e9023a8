"""Portioning meals: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import Exactly, GripperFar, ObjectOn


def one_on(plate: str, name: str) -> Exactly:
    return Exactly(1, ObjectOn(f"{name}1", plate), ObjectOn(f"{name}2", plate))


FRUITS = ("fruit1", "fruit2", "fruit3", "fruit4")


YOGURTS = ("yogurt1", "yogurt2", "yogurt3", "yogurt4")


def two_on(plate: str) -> Exactly:
    return Exactly(2, *(ObjectOn(name, plate) for name in YOGURTS))


def two_in(bowl: str) -> Exactly:
    return Exactly(2, *(ObjectOn(name, bowl) for name in FRUITS))


OURS = {
    "PortionYogurt": Ours(
        goal={
            "exactly 2 yogurts on plate1": two_on("plate1"),
            "exactly 2 yogurts on plate2 (on = contact, centre xy < 0.7*plate radius)": two_on("plate2"),
            **away(*YOGURTS),
        },
        initial={"robot base centred on plate1": "plate1"},
    ),
    "PortionFruitBowl": Ours(
        goal={
            "exactly 2 fruits in bowl1": two_in("bowl1"),
            "exactly 2 fruits in bowl2 (in = contact, centre xy < 0.7*bowl radius)": two_in("bowl2"),
            **away(*FRUITS),
        },
        initial={"robot base centred on plate": "plate"},
    ),
    "PortionHotDogs": Ours(
        goal={
            "exactly 1 bun on plate1": one_on("plate1", "hotdog_bun"),
            "exactly 1 sausage on plate1": one_on("plate1", "sausage"),
            "exactly 1 bun on plate2": one_on("plate2", "hotdog_bun"),
            "exactly 1 sausage on plate2 (on = contact, centre xy < 0.7*plate radius)": one_on("plate2", "sausage"),
            "gripper > 0.25 m from hotdog_bun1": GripperFar("hotdog_bun1", 0.25),
            "gripper > 0.25 m from hotdog_bun2": GripperFar("hotdog_bun2", 0.25),
            "gripper > 0.25 m from sausage1": GripperFar("sausage1", 0.25),
            "gripper > 0.25 m from sausage2": GripperFar("sausage2", 0.25),
        },
        initial={"robot base centred on bowl": "bowl"},
    ),
    "DistributeChicken": Ours(
        goal={
            "exactly 1 drumstick on plate1": one_on("plate1", "chicken_drumstick"),
            "exactly 1 drumstick on plate2 (on = contact, centre xy < 0.7*plate radius)": one_on(
                "plate2", "chicken_drumstick"
            ),
            "gripper > 0.25 m from chicken_drumstick1": GripperFar("chicken_drumstick1", 0.25),
            "gripper > 0.25 m from chicken_drumstick2": GripperFar("chicken_drumstick2", 0.25),
        },
        initial={
            "pan burner chosen at random among those with knobs": "pan",
            "all burners off": None,
            "robot base centred on pan": "pan",
        },
        turned={"pan": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "PortionInTupperware": Ours(
        goal={
            "exactly 1 cooked_food in tupperware1": one_on("tupperware1", "cooked_food"),
            "exactly 1 vegetable in tupperware1": one_on("tupperware1", "vegetable"),
            "exactly 1 cooked_food in tupperware2": one_on("tupperware2", "cooked_food"),
            "exactly 1 vegetable in tupperware2 (in = contact, centre xy < 0.7*tupperware radius)": one_on(
                "tupperware2", "vegetable"
            ),
            "gripper > 0.25 m from cooked_food1": GripperFar("cooked_food1", 0.25),
            "gripper > 0.25 m from cooked_food2": GripperFar("cooked_food2", 0.25),
            "gripper > 0.25 m from vegetable1": GripperFar("vegetable1", 0.25),
            "gripper > 0.25 m from vegetable2": GripperFar("vegetable2", 0.25),
        },
        initial={
            "robot base centred on plate": "plate",
        },
    ),
}
