"""Mixing and blending: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    GripperFar,
    NearFixture,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside
from robocasa_lerobot.envs.scene.spec import InitialOpenness


def on(*names: str) -> dict[str, ObjectOn]:
    wording = "{} on receptacle (contact; xy dist < 0.7 x receptacle radius)"
    return {wording.format(name): ObjectOn(name, "receptacle") for name in names}


OURS = {
    "ColorfulSalsa": Ours(goal={**on("onion", "avocado", "tomato", "bell_pepper"), **away("receptacle")}, initial={}),
    "SpicyMarinade": Ours(
        goal={
            "bowl touching counter": ObjectTouches("bowl", "counter"),
            "condiment touching counter": ObjectTouches("condiment", "counter"),
            **on("lime", "garlic"),
            **away("receptacle", "bowl", "condiment"),
        },
        initial={"cabinet doors closed": None},
    ),
    "MakeBananaMilkshake": Ours(
        goal={
            "banana inside blender (bbox, margin 0.01 m)": ObjectInside("banana", "blender"),
            "milk bbox within 0.30 m of blender": NearFixture("milk", "blender", 0.3),
            "honey bbox within 0.30 m of blender": NearFixture("honey", "blender", 0.3),
            "honey touching any counter": ObjectTouchesAnyCounter("honey"),
            "milk touching any counter": ObjectTouchesAnyCounter("milk"),
            "gripper > 0.25 m from banana": GripperFar("banana", 0.25),
            "gripper > 0.25 m from milk": GripperFar("milk", 0.25),
            "gripper > 0.25 m from honey": GripperFar("honey", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "blender lid off, lying on the surface beside the blender": LidAside("blender"),
        },
        more={"counter"},
    ),
}
