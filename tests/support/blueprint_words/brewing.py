"""Brewing: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    GripperFar,
    GripperFarFromPart,
    Near,
    ObjectAtSite,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnBurner,
    StateIs,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

LIT = OnBurner("obj", "stove", lit=True, within=0.15)  # it also asks that the object touches the stove
ON_TRAY = "in/on container (contact AND xy centre distance < 0.7 x container horizontal radius)"
ADDED = ("obj1", "obj2")
RUNS = StateIs("coffee_machine", "on")

OURS = {
    "OrganizeCoffeeCondiments": Ours(
        goal={
            **{f"{name} within 0.3 m (3D centres) of mug": Near(name, "mug", 0.3, in_space=True) for name in ADDED},
            **{
                # The mug's: in three layouts a stove parts it from the machine's, more than 0.3 m away.
                f"{name} in contact with coffee_machine_counter": ObjectTouches(name, "counter")
                for name in ADDED
            },
            **away(*ADDED, metres=0.15),
        },
        initial={
            "cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0),
            "mug filled with coffee (visual liquid only)": "mug",
        },
    ),
    "DeliverBrewedCoffee": Ours(
        goal={
            "brewed_coffee in contact with dining_counter": ObjectTouches("brewed_coffee", "dining_counter"),
            "breakfast_plate in contact with dining_counter": ObjectTouches("breakfast_plate", "dining_counter"),
            "brewed_coffee within 0.3 m (xy centres) of breakfast_plate": Near("brewed_coffee", "breakfast_plate", 0.3),
            **away("brewed_coffee"),
        },
        initial={"mug stands under coffee_machine dispenser, filled with coffee (visual liquid only)": "brewed_coffee"},
    ),
    "SweetenCoffee": Ours(
        goal={
            "milk in contact with any counter": ObjectTouchesAnyCounter("milk"),
            "coffee in contact with any counter": ObjectTouchesAnyCounter("coffee"),
            "milk within 0.25 m (xy centres) of coffee": Near("milk", "coffee", 0.25),
            "sugar_cube in/on coffee (contact AND xy centre distance < 0.7 x coffee horizontal radius)": ObjectOn(
                "sugar_cube", "coffee"
            ),
            **away("milk", "sugar_cube"),
        },
        initial={
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "mug filled with coffee (visual liquid only)": "coffee",
            "robot base in front of coffee mug": "coffee",
        },
    ),
    "KettleBoiling": Ours(
        goal={
            "obj in contact with stove": LIT,
            "obj within 0.15 m (xy) of a burner centre": LIT,
            "knob of that same burner in [0.35, 2pi-0.35]": LIT,
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"all stove knobs off": None, "pan or pot on a burner chosen at random": "stove_distr"},
    ),
    "ArrangeTea": Ours(
        goal={
            f"obj {ON_TRAY}": ObjectOn("obj", "container"),
            f"obj2 {ON_TRAY}": ObjectOn("obj2", "container"),
            "cab doors closed (every door joint <= 0.005 of range)": DoorsClosed("cab", 0.005),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0)},
    ),
    "PrepareCoffee": Ours(
        goal={
            "obj under coffee_machine dispenser (xy < 0.04 m and |dz| < 0.10 m from receptacle site)": ObjectAtSite(
                "obj", "coffee_machine", "receptacle", across=0.04, high=0.10
            ),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
            "coffee_machine turned on": RUNS,
            "gripper > 0.15 m from every start button": GripperFarFromPart("coffee_machine", "start_button", 0.15),
        },
        initial={
            "cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0),
            "coffee machine off": None,
        },
        order=RUNS,
    ),
}
