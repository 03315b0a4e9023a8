"""Reheating food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import NEAR_THE_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import (
    DoorsClosed,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    OnBurner,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

RUNS = StateIs("microwave", "on")
LIT = {"burner {knob} on (knob in [0.35, 2pi-0.35])": StateIs("stove", "{knob}_on")}
ON_BOARD = "{} on cutting_board (contact AND centre xy distance < 0.7 x cutting_board radius)"
IN_PAN = "{} in pan (contact AND centre xy distance < 0.7 x pan radius)"

OURS = {
    "HeatMug": Ours(
        goal={
            "obj inside microwave (all 8 bbox corners in interior region, tol 0.05)": ObjectInside(
                "obj", "microwave", margin=0.05
            ),
            **away("obj"),
            "microwave door closed (every joint <= 0.005 of range)": DoorsClosed("microwave", 0.005),
        },
        initial={
            "microwave door open (0.90-1.0)": InitialOpenness("microwave", 0.9, 1.0),
            "microwave off": None,
            "mug shows liquid": "obj",
        },
    ),
    "MakeLoadedPotato": Ours(
        goal={
            **{ON_BOARD.format(name): ObjectOn(name, "cutting_board") for name in ("potato", "condiment", "cheese")},
            **away("potato", "condiment", "cheese"),
        },
        initial={"microwave door closed and off": None},
    ),
    "ReheatMeatOnStove": Ours(
        goal={
            IN_PAN.format("meat"): ObjectOn("meat", "pan"),
            "pan touches stove, within 0.15 m (xy) of burner {knob}": OnBurner(
                "pan", "stove", burner="{knob}", within=0.15
            ),
            **LIT,
            **away("meat"),
        },
        initial={
            "burner {knob} on low (knob 0.35 rad to 80 deg); knob chosen at random": BurnerAt("stove", "{knob}", "low")
        },
        turned={"pan": HANDLE_TO_FRONT},
    ),
    "SimmeringSauce": Ours(
        goal={
            "pan touches stove, within 0.08 m (xy) of burner {knob}": OnBurner(
                "pan", "stove", burner="{knob}", within=0.08
            ),
            **{IN_PAN.format(name): ObjectOn(name, "pan") for name in ("tomato", "onion")},
            **LIT,
        },
        initial={"all burners off": None, "burner {knob} chosen at random": None},
        turned={"pan": (1.45, 1.69)},
    ),
    "WarmCroissant": Ours(
        goal={**LIT, IN_PAN.format("croissant"): ObjectOn("croissant", "pan"), **away("croissant")},
        initial={"burner {knob} off; knob chosen at random": "pan"},
    ),
    "WaffleReheat": Ours(
        goal={
            f"waffle in waffle_container {NEAR_THE_MIDDLE.format('waffle_container')}": ObjectOn(
                "waffle", "waffle_container"
            ),
            "waffle_container inside microwave (all 8 bbox corners in interior region, tol 0.05)": ObjectInside(
                "waffle_container", "microwave", margin=0.05
            ),
            "microwave on": RUNS,
        },
        initial={"microwave door closed and off": None},
        order=RUNS,
        # It would also run while the door is ajar.
        besides=frozenset({DoorsClosed("microwave"), GripperFarFromPart("microwave", "start_button")}),
    ),
}
