"""Broiling fish: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_RACK, SHUT = ObjectTouches("obj", "oven", part="{rack}"), DoorsClosed("oven", 0.005)
SHUT_IN = StepsWhile(AllOf(ON_RACK, SHUT), 10, consecutive=True, label="fish_shut_in")
WASHED = StepsWhile(UnderWater("obj", "sink"), 25, label="fish_washed")

OURS = {
    "OvenBroilFish": Ours(
        goal={
            "obj touching oven rack of the chosen level (contact)": ON_RACK,
            "oven door closed (<= 0.005 of range)": SHUT,
            "both held for 10 consecutive steps": SHUT_IN,
        },
        initial={
            "oven door open (1.0)": InitialOpenness("oven", 1.0, 1.0),
            "rack at {rack_level} slid out (1.0)": PartAt("oven", "{rack}", (1.0, 1.0)),
            "rack_level 0 (bottom) or 1 (top) at random 50/50; falls back to 0 on single-rack ovens": None,
        },
        order=SHUT_IN,
        called={"its": "obj"},  # its container
    ),
    "PrepareBroilingStation": Ours(
        goal={
            "tongs within 0.30 m (xy, strict) of plate": Near("tongs", "plate", 0.3),
            "tongs touching any counter": ObjectTouchesAnyCounter("tongs"),
            "plate touching any counter": ObjectTouchesAnyCounter("plate"),
            **away("tongs"),
        },
        initial={"oven door open (1.0)": InitialOpenness("oven", 1.0, 1.0)},
    ),
    "RemoveBroiledFish": Ours(
        goal={
            "fish on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn("fish", "plate"),
            **away("fish"),
        },
        initial={
            "oven door closed": None,
            "robot base beside the oven, left or right at random where free (lateral half oven width + 0.20 m, "
            "back 0.10 m)": None,
        },
    ),
    "ToasterOvenBroilFish": Ours(
        goal={
            "obj touching toaster_oven rack/tray of the chosen level (contact)": ObjectTouches(
                "obj", "toaster_oven", part="{rack}"
            ),
            "toaster_oven door closed (<= 0.005 of range)": DoorsClosed("toaster_oven", 0.005),
            "toaster_oven temperature >= 0.95 of range": PartWithin(
                "toaster_oven", "knob_temp", low=0.95, label="highest"
            ),
        },
        initial={
            "toaster_oven door open (1.0)": InitialOpenness("toaster_oven", 1.0, 1.0),
            "rack or tray at {rack_level} slid out (1.0)": PartAt("toaster_oven", "{rack}", (1.0, 1.0)),
            "rack_level 0 (bottom) or 1 (top) at random 50/50; falls back to 0 if single level": None,
            "temperature knob at default (not set)": None,
        },
        called={"its": "obj"},  # its container
    ),
    "WashFish": Ours(
        goal={
            "obj washed >= 25 steps under running water (latched)": WASHED,
            "obj in tray (contact AND xy centre distance < 0.7 x tray horizontal radius)": ObjectOn("obj", "tray"),
            **away("obj"),
        },
        initial={
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "sink faucet on (handle 0.40-0.50 rad)": Water("sink", on=True),
        },
        order=WASHED,
    ),
}
