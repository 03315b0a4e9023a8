"""Sanitizing cutting boards: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    Not,
    ObjectOn,
    ObjectTouchesAnyCounter,
    PartWithin,
    StateIs,
    StepsWhile,
    Strokes,
    UnderWater,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

RUBBED = Strokes("sponge", "cutting_board", n_places=5, apart_m=0.02, span_m=0.1)
OFF = "(no contact OR xy centre distance >= 0.7 x cutting_board horizontal radius)"
RINSED = StepsWhile(
    AllOf(UnderWater("cutting_board", "sink"), PartWithin("sink", "handle_temp", low=0.6, label="hot")),
    100,
    label="cutting_board_rinsed",
)

OURS = {
    "RinseCuttingBoard": Ours(
        goal={
            "rinse counter >= 100 steps": RINSED,
            "water off now (handle joint not in (0.40, pi))": StateIs("sink", "water_on", value=False),
        },
        initial={"faucet off (default)": None, "temperature joint at default": None},
        order=RINSED,
    ),
    "RemoveCuttingBoardItems": Ours(
        goal={
            **{
                f"NOT {name} on cutting_board {OFF}": Not(ObjectOn(name, "cutting_board"))
                for name in ("vegetable", "meat")
            },
            **away("vegetable", "meat"),
        },
        initial={"robot base in front of cutting_board": "cutting_board"},
    ),
    "SanitizePrepCuttingBoard": Ours(
        goal={
            **{
                f"{name} within 0.35 m (xy centres) of cutting_board": Near(name, "cutting_board", 0.35)
                for name in ("spray", "dish_brush")
            },
            **{
                f"{name} in contact with any counter": ObjectTouchesAnyCounter(name)
                for name in ("spray", "dish_brush", "cutting_board")
            },
            **away("spray", "dish_brush"),
        },
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            "robot base in front of cutting_board": "cutting_board",
        },
    ),
    "ScrubCuttingBoard": Ours(
        goal={
            "recorded scrub points >= 5": RUBBED,
            "diagonal of xy bounding box of recorded points >= 0.1 m": RUBBED,
            "gripper > 0.15 m from sponge": GripperFar("sponge", 0.15),
        },
        initial={"robot base in front of sponge": "sponge"},
        order=RUBBED,
    ),
}
