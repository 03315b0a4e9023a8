"""Microwaving food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away, together
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    Goal,
    GripperFar,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StateIs,
    When,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

RUNS = StateIs("microwave", "on")
OPEN = {"microwave door open (0.90-1.0 of range)": InitialOpenness("microwave", 0.9, 1.0)}
HEATED: dict[str, Goal] = {
    "microwave door closed (<= 0.005 of range)": DoorsClosed("microwave", 0.005),
    "microwave on (start button touched by gripper while door not open; latched until stop button or door open >= "
    "0.90)": RUNS,
}
INSIDE = "{} inside microwave (all 8 bbox corners in interior region, slack 0.05)"
MEALS = ("0", "1")


def inside(name: str) -> dict[str, Goal]:
    return {INSIDE.format(name): ObjectInside(name, "microwave", margin=0.05)}


def held(name: str, receptacle: str, other: str = "") -> dict[str, Goal]:
    """In a receptacle, or on the other thing in it."""
    middle = f"(contact AND xy centre distance < 0.7 x {receptacle} horizontal radius)"
    where = "on" if receptacle == "plate" else "in"
    goal = together(name, other, receptacle) if other else ObjectOn(name, receptacle)
    return {f"{name} {where} {receptacle} {middle}": goal}


def in_meal(food: str, other: str) -> Goal:
    return When(
        "target",
        {number: together(f"{food}_bowl{number}", f"{other}_bowl{number}", f"bowl{number}") for number in MEALS},
    )


OURS = {
    "FilterMicrowavableItem": Ours(
        goal={**inside("bowl"), **held("meat", "bowl"), **held("fruit", "plate"), **HEATED, **away("bowl")},
        initial=OPEN,
        order=RUNS,
    ),
    "MicrowaveCorrectMeal": Ours(
        goal={
            INSIDE.format("bowl{target}"): When(
                "target", {number: ObjectInside(f"bowl{number}", "microwave", margin=0.05) for number in MEALS}
            ),
            **{
                f"{food}_bowl{{target}} in bowl{{target}} (contact AND xy centre distance < 0.7 x bowl{{target}} "
                "horizontal radius)": in_meal(food, other)
                for food, other in (("food0", "food1"), ("food1", "food0"))
            },
            **HEATED,
            "gripper > 0.25 m from bowl{target}": When(
                "target", {number: GripperFar(f"bowl{number}", 0.25) for number in MEALS}
            ),
        },
        initial={
            **OPEN,
            "target bowl 0 or 1 at random": None,
            "4 food categories drawn without repeat": None,
        },
        order=RUNS,
    ),
    "MicrowaveDefrostMeat": Ours(
        goal={**inside("tupperware"), **held("meat", "tupperware"), **HEATED, **away("tupperware")},
        initial={
            "freezer door open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="freezer"),
            "fridge compartment door closed (default)": None,
            **OPEN,
        },
        order=RUNS,
        kinds={"fridge": "fridge_with_freezer"},
    ),
    "PlaceMicrowaveSafeItem": Ours(
        goal={
            **inside("microwave_safe_item"),
            "NOT microwave_unsafe_item inside microwave": Not(ObjectInside("microwave_unsafe_item", "microwave")),
            **HEATED,
        },
        initial={
            **OPEN,
            "safe category and unsafe category each chosen at random": None,
            "safe item shows liquid (visual)": "microwave_safe_item",
        },
        order=RUNS,
    ),
    "ReheatMeal": Ours(
        goal={
            **inside("tupperware"),
            **held("meat", "tupperware", "vegetable"),
            **held("vegetable", "tupperware", "meat"),
            **HEATED,
            **away("tupperware"),
        },
        initial={
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            **OPEN,
        },
        order=RUNS,
    ),
    "ReturnHeatedFood": Ours(
        goal={
            "bowl touching dining_counter (contact)": ObjectTouches("bowl", "dining_counter"),
            **held("meat", "bowl", "vegetable"),
            **held("vegetable", "bowl", "meat"),
            **away("bowl"),
        },
        initial={"microwave door closed and off (default)": None},
    ),
}
