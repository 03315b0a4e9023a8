"""Preparing sandwiches: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    Near,
    NearFixture,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

TIMER = PartWithin("toaster_oven", "knob_time", low=0.1, label="set")

BOWL = "ingredient_bowl"
SLICES = ("tomato_slice", "pickle_slice", "turkey_slice")


def kept_in_bowl(name: str) -> AnyOf:
    others = (other for other in SLICES if other != name)
    on_others = (AllOf(ObjectTouches(name, other), ObjectOn(other, BOWL)) for other in others)
    return AnyOf(ObjectOn(name, BOWL), *on_others)


OURS = {
    "GatherVegetables": Ours(
        goal={
            **{
                f"{name} on cutting_board (contact; xy dist < 0.7 x cutting_board radius)": ObjectOn(
                    name, "cutting_board"
                )
                for name in ("veg1", "veg2")
            },
            **away("veg1", "veg2"),
        },
        initial={"faucet off": Water("sink", on=False)},
        turned={"cutting_board": (np.pi / 2, np.pi / 2)},
    ),
    "HotDogSetup": Ours(
        goal={
            "hotdog_bun on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("hotdog_bun", "plate"),
            "sausage on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("sausage", "plate"),
            "plate touching dining_counter": ObjectTouches("plate", "dining_counter"),
            "condiment within 0.35 m (xy) of plate": Near("condiment", "plate", 0.35),
            "condiment touching dining_counter": ObjectTouches("condiment", "dining_counter"),
            **away("hotdog_bun", "sausage", "condiment", "plate"),
        },
        initial={
            "cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "fridge door(s) closed": None,
        },
    ),
    "HeatKebabSandwich": Ours(
        goal={
            "baguette touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "baguette", "toaster_oven", part="{rack}"
            ),
            "kebab touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "kebab", "toaster_oven", part="{rack}"
            ),
            "toaster_oven door NOT open (< 0.90 of range)": DoorsClosed("toaster_oven"),
            "toaster_oven time knob >= 0.1 of range": TIMER,
        },
        initial={
            "toaster_oven door fully open (1.0)": InitialOpenness("toaster_oven", 1.0, 1.0),
            "timer at 0": PartAt("toaster_oven", "knob_time", (0.0, 0.0)),
        },
        order=TIMER,
        besides=frozenset({GripperFar("baguette"), GripperFar("kebab")}),
    ),
    "PrepareSausageCheese": Ours(
        goal={
            **{
                f"{name} on baguette_container (contact; xy dist < 0.7 x baguette_container radius)": ObjectOn(
                    name, "baguette_container"
                )
                for name in ("sausage", "cheese")
            },
            **away("sausage", "cheese"),
        },
        initial={
            "fridge door(s) closed": None,
            "sausage on random one of top / second highest shelf, cheese on the other": "sausage",
        },
    ),
    "PrepareSandwichStation": Ours(
        goal={
            "each of tomato_slice, pickle_slice, turkey_slice: OR(in ingredient_bowl (contact; xy dist < "
            "0.7 x radius); touching another slice that is in the bowl)": AllOf(*map(kept_in_bowl, SLICES)),
            "at least one slice in ingredient_bowl": AnyOf(*(ObjectOn(name, BOWL) for name in SLICES)),
            "ingredient_bowl touching any counter": ObjectTouchesAnyCounter(BOWL),
            "baguette touching any counter": ObjectTouchesAnyCounter("baguette"),
            "ingredient_bowl bbox within 0.35 m of toaster_oven": NearFixture(BOWL, "toaster_oven", 0.35),
            "baguette bbox within 0.35 m of toaster_oven": NearFixture("baguette", "toaster_oven", 0.35),
            "gripper > 0.25 m from ingredient_bowl": GripperFar("ingredient_bowl", 0.25),
            "gripper > 0.25 m from baguette": GripperFar("baguette", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "bowl on random one of top / second highest shelf, baguette on the other": BOWL,
        },
        kinds={"counter": "counter"},
        near={"counter": "toaster_oven"},
    ),
    "ToastHeatableIngredients": Ours(
        goal={
            "sausage touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "sausage", "toaster_oven", part="{rack}"
            ),
            "bread touching toaster_oven rack/tray (level 0 or 1)": ObjectTouches(
                "bread", "toaster_oven", part="{rack}"
            ),
            "tomato on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("tomato", "plate"),
            "onion on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("onion", "plate"),
            "gripper > 0.15 m from sausage": GripperFar("sausage", 0.15),
            "gripper > 0.15 m from bread": GripperFar("bread", 0.15),
            "gripper > 0.15 m from tomato": GripperFar("tomato", 0.15),
            "gripper > 0.15 m from onion": GripperFar("onion", 0.15),
            "gripper > 0.15 m from plate": GripperFar("plate", 0.15),
        },
        initial={
            "toaster_oven door closed": None,
        },
    ),
}
