"""Frying: our words for its blueprints."""

from __future__ import annotations

import math

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    MovedSince,
    Not,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    Once,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

TURNED = MovedSince("meat_container", "reset", by_rad=math.radians(15.0), about_vertical=True)
ROTATED = Once(TURNED, label="pan_rotated")
PRESSED = StepsWhile(ObjectTouches("spatula", "chicken"), 25, consecutive=True, label="chicken_pressed")
LIT = OnBurner("pan", "stove", burner="{burner}", lit=True, within=0.15)


def steaks(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("steak1", first), ObjectOn("steak2", second))


OURS = {
    "AssembleCookingArray": Ours(
        goal={
            "meat in pan (contact; centre xy < 0.07 m)": ObjectOn("meat", "pan", within=0.07),
            "vegetable in contact with counter": ObjectTouches("vegetable", "counter"),
            "condiment in contact with counter": ObjectTouches("condiment", "counter"),
            **away("vegetable", "condiment", "meat"),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0), "pan on random burner": "pan"},
        turned={"pan": HANDLE_TO_FRONT},
    ),
    "DistributeSteakOnPans": Ours(
        goal={
            "full_pan and empty_pan each on a lit burner (contact with stove; xy < 0.08 m; knob in [0.35, 2pi-0.35]) "
            "AND on different burners": AllOf(
                OnBurner("full_pan", "stove", lit=True, within=0.08),
                OnBurner("empty_pan", "stove", lit=True, within=0.08),
                OnBurner("full_pan", "stove", within=0.08, other_than="empty_pan"),
            ),
            "knob of full pan's start burner on": StateIs("stove", "{full}_on"),
            "knob of empty pan's start burner on": StateIs("stove", "{_empty}_on"),
            "OR(steak1 in full_pan AND steak2 in empty_pan, steak1 in empty_pan AND steak2 in full_pan); in = contact, "
            "centre xy < 0.7*pan radius": AnyOf(steaks("full_pan", "empty_pan"), steaks("empty_pan", "full_pan")),
            **away("steak1", "steak2"),
        },
        initial={
            "uses the first two burners with knobs in order front_left, front_center, front_right, center, left, "
            "right; which one holds the full pan is random": None,
            "knob of full pan's burner on (>= 0.5 rad)": BurnerAt("stove", "{full}", "on"),
            "knob of empty pan's burner off": BurnerAt("stove", "{_empty}", "off"),
            "both steaks in full_pan": "steak2",
        },
        turned=dict.fromkeys(("full_pan", "empty_pan"), HANDLE_TO_FRONT),
    ),
    "PressChicken": Ours(
        goal={
            "press_done latched": PRESSED,
            **away("chicken"),
        },
        initial={
            "burner chosen at random among those with knobs": None,
            "chosen burner knob on (>= 0.5 rad)": BurnerAt("stove", "{burner}", "on"),
        },
        order=PRESSED,
        turned={"chicken_container": HANDLE_TO_FRONT},
    ),
    "RotatePan": Ours(
        goal={
            "meat_container (pan) in contact with stove": ObjectTouches("meat_container", "stove"),
            "meat in meat_container (contact; centre xy < 0.7*meat_container radius)": ObjectOn(
                "meat", "meat_container"
            ),
            "pan_rotated latched (|yaw - start yaw| > 15 deg)": ROTATED,
            **away("meat_container"),
        },
        initial={
            "burner chosen at random among those with knobs": None,
            "chosen burner knob on (>= 0.5 rad)": BurnerAt("stove", "{burner}", "on"),
        },
        order=ROTATED,
        turned={"meat_container": HANDLE_TO_FRONT},
    ),
    "SetupFrying": Ours(
        goal={
            "pan on a burner (contact with stove; centre xy < 0.15 m)": OnBurner("pan", "stove", lit=True, within=0.15),
            # Lit is from 0.35 on everywhere else.
            "that burner's knob in [0.50, 2pi-0.35]": OnBurner("pan", "stove", lit=True, within=0.15),
            **away("pan"),
        },
        initial={"cabinet doors closed": None, "all burners off": None},
        turned={"pan": (-0.2, 0.2)},  # across the cabinet, as theirs
    ),
    "FryingPanAdjustment": Ours(
        goal={
            "obj (pan) on a burner (contact with stove; centre xy < 0.08 m)": OnBurner("obj", "stove", within=0.08),
            "that burner's knob in [0.35, 2pi-0.35]": OnBurner("obj", "stove", lit=True, within=0.08),
            "that burner != start burner": Not(OnBurner("obj", "stove", burner="{start_burner}", within=0.15)),
        },
        initial={
            "pan on random burner": "obj",
            "knob of that burner on (>= 0.5 rad)": BurnerAt("stove", "{start_burner}", "on"),
            "all other knobs off": None,
        },
        order=Not(OnBurner("obj", "stove", burner="{start_burner}", within=0.15)),
        turned={"obj": HANDLE_TO_FRONT},
    ),
    "SearingMeat": Ours(
        goal={
            "pan on chosen burner {burner} (contact with stove; centre xy < 0.15 m; knob in [0.35, 2pi-0.35])": LIT,
            "meat in pan (contact; centre xy < 0.07 m)": ObjectOn("meat", "pan", within=0.07),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
        },
        initial={
            "burner chosen at random among those with knobs": None,
            "chosen burner knob off": BurnerAt("stove", "{burner}", "off"),
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
        },
        turned={"pan": (-0.2, 0.2)},  # across the cabinet, as theirs
    ),
}
