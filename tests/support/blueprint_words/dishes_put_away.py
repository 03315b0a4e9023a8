"""Washing dishes, and what goes where for it: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    Goal,
    NearFixture,
    Not,
    ObjectInside,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OverBasin,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OPEN = {"cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)}
DRY = {"faucet off": Water("sink", on=False)}
MARGIN = "(bbox, margin 0.05 m)"
TWO = {"sink": "sink_with_two_basins"}
RINSED = StepsWhile(UnderWater("obj", "sink"), 100, label="teapot_rinsed")

CLEAN = ("clean_item1", "clean_item2")


def by_sink(names: tuple[str, ...], counter: str, metres: float) -> dict[str, Goal]:
    near = {f"{name} bbox within {metres:.2f} m of sink": NearFixture(name, "sink", metres) for name in names}
    touch = {f"{name} touching {counter}": ObjectTouches(name, counter) for name in names}
    return {**near, **touch, **away(*names)}


def over(name: str, side: str) -> dict[str, Goal]:
    return {f"{name} centre over {side} basin (xy)": OverBasin(name, "sink", {"left": "basin0"}.get(side, "basin1"))}


OURS = {
    "CollectWashingSupplies": Ours(goal=by_sink(("supply1", "supply2"), "counter", 0.2), initial=OPEN),
    "PlaceDishesBySink": Ours(goal=by_sink(("dish0", "dish1"), "counter_sink", 0.15), initial=DRY),
    "DivideBasins": Ours(
        goal={**over("obj_to_wash", "left"), **over("obj_drying", "right"), **away("obj_to_wash", "obj_drying")},
        initial={
            **DRY,
            "obj_drying starts in a random basin": "obj_drying",
            "two different categories drawn for the two items": None,
        },
        kinds=TWO,
    ),
    "PreRinseStation": Ours(
        goal={**over("left_obj", "left"), **over("right_obj", "right"), **away("left_obj", "right_obj")},
        initial={**DRY, "random which of the two items goes left, the other goes right": "left_obj"},
        kinds=TWO,
    ),
    "PlaceOnDishRack": Ours(
        goal={
            **{f"{name} touching dish_rack": ObjectTouches(name, "dish_rack") for name in CLEAN},
            **{f"{name} NOT touching any counter": Not(ObjectTouchesAnyCounter(name)) for name in CLEAN},
            **over("dirty_item1", "left"),
            **over("dirty_item2", "left"),
            **away(*CLEAN, "dirty_item1", "dirty_item2"),
        },
        initial=DRY,
        kinds=TWO,
    ),
    "ReturnWashingSupplies": Ours(
        goal={
            **{
                f"{name} inside cabinet {MARGIN}": ObjectInside(name, "cabinet", margin=0.05)
                for name in ("supply1", "supply2")
            },
            "cabinet door(s) closed (<= 0.005 of range; always true for open cabinet)": DoorsClosed("cabinet", 0.005),
        },
        initial=OPEN,
    ),
    "RinseFragileItem": Ours(
        goal={
            "teapot under running water >= 100 steps (xy dist to stream < teapot radius, below stream top, faucet "
            "on)": RINSED,
            **away("obj"),
            "obj inside dish_rack (bbox, margin 0.02 m)": ObjectInside("obj", "dish_rack", margin=0.02),
        },
        initial={"faucet on": Water("sink", on=True)},
        order=RINSED,
    ),
    "SortingCleanup": Ours(
        goal={
            f"mug inside sink {MARGIN}": ObjectInside("mug", "sink", margin=0.05),
            f"bowl inside cabinet {MARGIN}": ObjectInside("bowl", "cabinet", margin=0.05),
            "cabinet door(s) closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
            **away("mug"),
        },
        initial=OPEN,
    ),
    "DryDrinkware": Ours(
        goal={
            **away("mug"),
            "mug upside down (|roll| > 3 rad)": ObjectTilt("mug", low=float(np.deg2rad(170.0)), label="upside_down"),
            "mug touching cabinet": ObjectTouches("mug", "cabinet"),
        },
        initial=OPEN,
    ),
}
