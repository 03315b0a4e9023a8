"""Mixing ingredients: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Exactly,
    GripperFar,
    GripperFarFromPart,
    MovedSince,
    ObjectInside,
    ObjectOn,
    ObjectTilt,
    ObjectTouches,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, LidAside, PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

RUNS = StateIs("blender", "on")
AWAY = frozenset({GripperFarFromPart("blender", "button")})
STIRRED = StepsWhile(
    AllOf(
        ObjectOn("cheese", "pot"),
        OnBurner("pot", "stove", burner="{knob}", lit=True, within=0.15),
        ObjectTouches("spatula", "cheese"),
        MovedSince("cheese", "step", by_m=0.0015, across=True),
    ),
    3,
    label="cheese_stirred",
)


def in_jar(name: str) -> ObjectInside:
    return ObjectInside(name, "blender")


def in_bowl(name: str) -> ObjectInside:
    return ObjectInside(name, "stand_mixer", lower=0.5)


def leans_in(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "glass_milk"), ObjectTilt(name, low=np.deg2rad(25.0)))


OURS = {
    "BlendSalsaMix": Ours(
        goal={
            "tomato inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("tomato"),
            "chili_pepper inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("chili_pepper"),
            "onion inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("onion"),
            "blender on": RUNS,
        },
        initial={
            "blender lid on": None,
            "blender off": None,
        },
        order=RUNS,
        besides=AWAY,
    ),
    "BlendVegetableSauce": Ours(
        goal={
            "burner {knob} off (knob not in [0.35, 2pi-0.35])": StateIs("stove", "{knob}_on", value=False),
            "vegetable inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("vegetable"),
            "blender on": RUNS,
        },
        initial={
            "burner {knob} on; knob chosen at random among non-rear burners": BurnerAt("stove", "{knob}", "on"),
            "blender lid off, lying on the blender counter": LidAside("blender"),
            "blender off": None,
            "saucepan shows water": "saucepan",
        },
        order=RUNS,
        besides=AWAY,
        turned={"saucepan": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "CheeseMixing": Ours(
        goal={
            "stirred on > 2 steps in total, a step counts when: cheese in pot (contact AND centre xy "
            "distance < 0.7 x pot radius) AND pot touches stove within 0.15 m (xy) of burner {knob} with "
            "that burner on AND spatula touches cheese AND cheese moved > 0.0015 m (xy) since last step": STIRRED,
        },
        initial={
            "burner {knob} on; knob chosen at random among non-rear burners": BurnerAt("stove", "{knob}", "on"),
            "pot shows white milk": "pot",
        },
        order=STIRRED,
        turned={"spatula": (np.pi / 2, np.pi / 2)},
    ),
    "MakeCheesecakeFilling": Ours(
        goal={
            "butter inside mixer bowl (bbox in lower half of bowl region, tol 0.01)": in_bowl("butter"),
            "sugar inside mixer bowl (same test)": in_bowl("sugar"),
            "cream_cheese inside mixer bowl (same test)": in_bowl("cream_cheese"),
            "mixer speed knob > 0.2 of range": PartWithin("stand_mixer", "knob_speed", low=0.2, label="up"),
            "mixer head joint < 0.05 of range": PartWithin("stand_mixer", "head", high=0.05, label="down"),
        },
        initial={
            "stand mixer head open (1.0)": PartAt("stand_mixer", "head", (1.0, 1.0)),
            "mixer speed knob 0": PartAt("stand_mixer", "knob_speed", (0.0, 0.0)),
        },
    ),
    "MakeChocolateMilk": Ours(
        goal={
            "exactly one of chocolate1, chocolate2 counts as in glass (contact AND centre xy distance < "
            "0.7 x glass radius AND its z axis tilted >= 25 deg from vertical)": Exactly(
                1, leans_in("chocolate1"), leans_in("chocolate2")
            ),
            "sugar_cube in glass_milk (contact AND centre xy distance < 0.7 x glass_milk radius)": ObjectOn(
                "sugar_cube", "glass_milk"
            ),
            "gripper > 0.25 m from glass_milk": GripperFar("glass_milk", 0.25),
        },
        initial={
            "glass shows milk": "glass_milk",
        },
        called={"one": "chocolate"},
    ),
    "PrepareVeggieDip": Ours(
        goal={
            "vegetable inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("vegetable"),
            "cream_cheese inside blender (all 8 bbox corners in interior region, tol 0.01)": in_jar("cream_cheese"),
            "blender on": RUNS,
        },
        initial={
            "fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "blender lid off, lying on the blender counter": LidAside("blender"),
            "blender off": None,
        },
        order=RUNS,
        besides=AWAY,
    ),
}
