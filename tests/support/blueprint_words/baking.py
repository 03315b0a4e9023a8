"""Baking: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    Goal,
    Near,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness


def in_mixer(name: str) -> Goal:
    return ObjectInside(name, "stand_mixer", lower=0.5)


def served(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("pastry1", first), ObjectOn("pastry2", second))


OURS = {
    "CookieDoughPrep": Ours(
        goal={
            **{f"{name} touches any counter (contact)": ObjectTouchesAnyCounter(name) for name in ("egg", "butter")},
            **{
                f"{name} xy distance to bowl < bowl radius + 0.25 m": Near(name, "bowl", 0.25, from_edge=True)
                for name in ("egg", "butter")
            },
            **away("egg", "butter", metres=0.15),
        },
        initial={
            "fridge door(s) open (0.90-1.0)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "cabinet door(s) open (0.90-1.0)": InitialOpenness("cabinet", 0.9, 1.0),
        },
    ),
    "CoolBakedCake": Ours(
        goal={
            "oven door closed (every joint <= 0.005 of range)": DoorsClosed("oven", 0.005),
            "cake on container (contact AND centre xy distance < 0.7 x container radius)": ObjectOn(
                "cake", "container"
            ),
            "container touches counter (contact)": ObjectTouches("container", "counter"),
            **away("cake"),
        },
        initial={"oven door closed": None, "oven rack in": None, "oven off": None},
    ),
    "CoolBakedCookies": Ours(
        goal={
            **{
                f"{name} on oven_tray (contact AND centre xy distance < 0.7 x oven_tray radius)": ObjectOn(
                    name, "oven_tray"
                )
                for name in ("cookie0", "cookie1")
            },
            "oven_tray touches any counter (contact)": ObjectTouchesAnyCounter("oven_tray"),
            **away("oven_tray"),
        },
        initial={
            "oven door closed": None,
            "oven temperature knob 0.5": PartAt("oven", "knob_temp", (0.5, 0.5)),
            "rack = top one if oven has two, else the only one": "oven_tray",
        },
        kinds={"counter": "counter"},  # any
    ),
    "CupcakeCleanup": Ours(
        goal={
            **away("cupcake", "bowl"),
            "bowl inside sink (all 8 bbox corners in interior region, tol 0.05)": ObjectInside(
                "bowl", "sink", margin=0.05
            ),
            "cupcake touches counter (contact)": ObjectTouches("cupcake", "counter"),
        },
        initial={},
        turned=dict.fromkeys(("cupcake", "cupcake_container"), (1.48, 1.66)),
    ),
    "MixCakeFrosting": Ours(
        goal={
            "butter inside mixer bowl (bbox in lower half of bowl region, tol 0.01)": in_mixer("butter"),
            "sugar_0 inside mixer bowl (same test)": in_mixer("sugar_0"),
            "sugar_1 inside mixer bowl (same test)": in_mixer("sugar_1"),
            "mixer speed knob > 0.3 of range": PartWithin("stand_mixer", "knob_speed", low=0.3, label="up"),
            "mixer head joint < 0.01 of range": PartWithin("stand_mixer", "head", high=0.01, label="down"),
        },
        initial={
            "stand mixer head open (1.0)": PartAt("stand_mixer", "head", (1.0, 1.0)),
            "mixer speed knob 0": PartAt("stand_mixer", "knob_speed", (0.0, 0.0)),
        },
    ),
    "OrganizeBakingIngredients": Ours(
        goal={
            **{
                f"{name} within 0.20 m of bowl (3D)": Near(name, "bowl", 0.20, in_space=True)
                for name in ("egg1", "egg2", "milk")
            },
            **away("bowl", "egg1", "egg2", "milk", metres=0.15),
        },
        initial={},
    ),
    "PastryDisplay": Ours(
        goal={
            **away("pastry1", "pastry2"),
            "OR(pastry1 on receptacle1 AND pastry2 on receptacle2, pastry1 on receptacle2 AND pastry2 on receptacle1) "
            "(contact AND centre xy distance < 0.7 x plate radius)": AnyOf(
                served("receptacle1", "receptacle2"), served("receptacle2", "receptacle1")
            ),
        },
        initial={},
    ),
}
