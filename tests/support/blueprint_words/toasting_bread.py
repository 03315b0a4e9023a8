"""Toasting bread: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    Goal,
    GripperFar,
    Near,
    ObjectOn,
    ObjectOnRack,
    ObjectTouches,
    Once,
    PartWithin,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_SLOT = ObjectTouches("obj", "toaster", part="lever{_side}")
TOASTING = Once(AllOf(IN_SLOT, StateIs("toaster", "on{_side}")), label="bread_toasted")
OFF, UP = StateIs("toaster", "on{_side}", value=False), PartWithin("toaster", "lever{_side}", high=0.3, label="up")

SLICES = ("bread_slice_1", "bread_slice_2")
OPEN = {"toaster_oven door open (1.0)": InitialOpenness("toaster_oven", 1.0, 1.0)}


def in_bowl(name: str, other: str) -> Goal:
    return AnyOf(ObjectOn(name, "bowl"), AllOf(ObjectTouches(name, other), ObjectOn(other, "bowl")))


def shut_in(name: str) -> dict[str, Goal]:
    return {
        f"{name} touching any toaster_oven rack/tray level (contact)": ObjectOnRack(name, "toaster_oven"),
        "toaster_oven door closed (<= 0.005 of range)": DoorsClosed("toaster_oven", 0.005),
    }


OURS = {
    "PJSandwichPrep": Ours(
        goal={
            "at least one slice in bowl (contact AND xy centre distance < 0.7 x bowl horizontal radius)": AnyOf(
                *(ObjectOn(name, "bowl") for name in SLICES)
            ),
            "each other slice likewise in bowl OR touching a slice that is": AllOf(
                in_bowl(*SLICES), in_bowl(*reversed(SLICES))
            ),
            "bowl touching dining_counter (contact)": ObjectTouches("bowl", "dining_counter"),
            **{
                f"bowl within 0.4 m (xy, strict) of {name}": Near("bowl", name, 0.4)
                for name in ("peanut_butter", "jelly")
            },
            **away("bowl"),
        },
        initial={"toaster off, both slices already in the slots": "bread_slice_1"},
    ),
    "ToastOneSlotPair": Ours(
        goal={
            **{
                f"{name} touching a slot floor of the working pair (contact)": ObjectTouches(
                    name, "toaster", part="lever{working}"
                )
                for name in ("bread_broken", "bread_working")
            },
            "working pair turned on (lever >= 0.90; stays on 500 steps)": StateIs("toaster", "on{working}"),
        },
        initial={
            "toaster off, levers up": None,
            "working slot pair left (0) or right (1) at random; the other counts as broken (no physical defect)": None,
        },
        order=StateIs("toaster", "on{working}"),
        kinds={"toaster": "toaster_with_four_slots"},
    ),
    "ServeWarmCroissant": Ours(
        goal={
            "croissant on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn(
                "croissant", "plate"
            ),
            **away("croissant"),
        },
        initial={
            "toaster_oven door closed (default), rack in": None,
            "rack_level 0 (bottom) or 1 (top) at random 50/50; only level used if single": "croissant",
        },
    ),
    "ToastBagel": Ours(
        goal={
            **shut_in("bagel"),
            "toaster_oven timer >= 0.1 of range": PartWithin("toaster_oven", "knob_time", low=0.1, label="set"),
            **away("bagel"),
        },
        initial={**OPEN, "timer at 0 (default)": PartAt("toaster_oven", "knob_time", (0.0, 0.0))},
        order=PartWithin("toaster_oven", "knob_time", low=0.1, label="set"),  # it runs down by itself
    ),
    "ToastBaguette": Ours(
        goal={
            **shut_in("baguette"),
            "toaster_oven temperature <= 0.05 of range": PartWithin(
                "toaster_oven", "knob_temp", high=0.05, label="lowest"
            ),
        },
        initial={
            **OPEN,
            "temperature knob at random 0.2-1.0 of range (uniform)": PartAt("toaster_oven", "knob_temp", (0.2, 1.0)),
        },
    ),
    "ToastOnCorrectRack": Ours(
        goal={
            "bread touching toaster_oven rack/tray of bread level (contact)": ObjectTouches(
                "bread", "toaster_oven", part="{bread_level}"
            ),
            "meat touching toaster_oven rack/tray of meat level (contact)": ObjectTouches(
                "meat", "toaster_oven", part="{_meat_level}"
            ),
            **away("bread", "meat"),
        },
        initial={
            "toaster_oven door closed (default), racks in": None,
            "bread level 0 (bottom) or 1 (top) at random 50/50; meat gets the other level": None,
        },
        order=ObjectTouches("bread", "toaster_oven", part="{bread_level}"),  # racks may be out, the door open
        kinds={"toaster_oven": "toaster_oven_with_two_racks"},
    ),
    "GetToastedBread": Ours(
        goal={
            "toaster was turned on while obj stood in a slot of that slot pair (latched)": TOASTING,
            "obj on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn("obj", "plate"),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"toaster off, lever up": None, "slot chosen at random": "obj"},
        order=TOASTING,
        besides=frozenset({Once(AllOf(TOASTING, IN_SLOT, OFF, UP), label="bread_popped_up")}),
        turned={"obj": (0.0, 0.0)},  # along its slot
    ),
}
