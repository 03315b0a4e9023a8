"""Designs of the appliances that are built in or stand on the floor: proportions in metres, finishes, details."""

from __future__ import annotations

from robocasa_lerobot.envs.kitchens.appliances.kind_record import Kind
from robocasa_lerobot.envs.kitchens.appliances.kinds.dishwasher import Dishwasher
from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import BottomFreezerFridge, FrenchDoorFridge
from robocasa_lerobot.envs.kitchens.appliances.kinds.oven import Oven
from robocasa_lerobot.envs.kitchens.appliances.kinds.side_by_side_fridge import SideBySideFridge
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Stove, Stovetop
from robocasa_lerobot.envs.kitchens.appliances.records import Family

STEELS = ("steel", "warm_steel", "black_steel")

BUILT_IN: tuple[Kind, ...] = (
    Kind(
        "dishwasher",
        "dishwasher",
        25,
        8,
        (
            Family(
                "front_control",
                (0.595, 0.60, 0.86),
                (0.605, 0.62, 0.88),
                (*STEELS, "white", "black"),
                {"handle": ("bar", "bow"), "panel": ("display", "dial"), "tines": (3, 4)},
            ),
            Family(
                "hidden_control",
                (0.595, 0.60, 0.86),
                (0.605, 0.62, 0.88),
                (*STEELS, "white", "graphite"),
                {"handle": ("bar", "slim"), "panel": ("none",), "tines": (3, 4, 5)},
            ),
        ),
        made_by=Dishwasher,
    ),
    Kind(
        "fridge_french_door",
        "fridge",
        20,
        4,
        (
            Family(
                "modern",
                (0.86, 0.70, 1.75),
                (0.92, 0.78, 1.85),
                (*STEELS, "white", "graphite"),
                {
                    "handle": ("bar", "bow", "slim"),
                    "dispenser": (True, False),
                    "shelves": (3, 4),
                    "drawers": (1, 2),
                    "freezer": (0.32, 0.36),
                },
            ),
            Family(
                "four_door",
                (0.86, 0.70, 1.75),
                (0.92, 0.78, 1.85),
                ("black_steel", "steel", "navy", "white"),
                {
                    "handle": ("bar", "slim"),
                    "dispenser": (False,),
                    "shelves": (3, 4),
                    "drawers": (2,),
                    "freezer": (0.34, 0.38),
                },
            ),
        ),
        made_by=FrenchDoorFridge,
    ),
    Kind(
        "fridge_side_by_side",
        "fridge",
        15,
        3,
        (
            Family(
                "side_by_side",
                (0.86, 0.70, 1.72),
                (0.92, 0.78, 1.82),
                (*STEELS, "white", "black"),
                {
                    "handle": ("bar", "bow"),
                    "dispenser": (True, False),
                    "shelves": (4, 5),
                    "drawers": (1, 2),
                    "freezer": (0.40, 0.44),
                },
            ),
        ),
        made_by=SideBySideFridge,
    ),
    Kind(
        "fridge_bottom_freezer",
        "fridge",
        15,
        3,
        (
            Family(
                "bottom_freezer",
                (0.68, 0.66, 1.70),
                (0.78, 0.74, 1.85),
                (*STEELS, "white", "graphite"),
                {
                    "handle": ("bar", "bow", "slim"),
                    "dispenser": (False,),
                    "shelves": (3, 4),
                    "drawers": (1,),
                    "freezer": (0.33, 0.38),
                },
            ),
            Family(
                "retro",
                (0.66, 0.66, 1.68),
                (0.74, 0.72, 1.80),
                ("cream", "mint", "red", "sky"),
                {
                    "handle": ("bow",),
                    "dispenser": (False,),
                    "shelves": (3, 4),
                    "drawers": (1,),
                    "freezer": (0.30, 0.34),
                },
            ),
        ),
        made_by=BottomFreezerFridge,
    ),
    Kind(
        "oven",
        "oven",
        21,
        8,
        (
            Family(
                "wall_oven",
                (0.595, 0.56, 0.59),
                (0.60, 0.60, 0.61),
                (*STEELS, "black", "white"),
                {"handle": ("bar", "bow"), "racks": (2,), "panel": ("display", "plain")},
            ),
            Family(
                "tall_oven",
                (0.70, 0.58, 0.68),
                (0.76, 0.62, 0.74),
                (*STEELS, "graphite", "cream"),
                {"handle": ("bar", "slim"), "racks": (2,), "panel": ("display", "plain")},
            ),
            Family(
                "compact",
                (0.595, 0.55, 0.455),
                (0.60, 0.58, 0.48),
                (*STEELS, "black", "navy"),
                {"handle": ("bar", "slim"), "racks": (1,), "panel": ("display",)},
            ),
        ),
        made_by=Oven,
    ),
    Kind(
        "sink",
        "sink",
        49,
        10,
        (
            Family(
                "single",
                (0.52, 0.38, 0.17),
                (0.64, 0.42, 0.21),
                ("steel", "granite_black", "ceramic", "granite_grey", "warm_steel"),
                {
                    "faucet": ("gooseneck", "square", "pull_down"),
                    "lever": ("side", "top"),
                    "metal": ("chrome", "steel_plain", "black", "brass"),
                },
            ),
            Family(
                "double",
                (0.66, 0.38, 0.17),
                (0.76, 0.42, 0.21),
                ("steel", "warm_steel", "ceramic", "granite_black", "granite_sand"),
                {
                    "faucet": ("gooseneck", "pull_down"),
                    "lever": ("side", "top"),
                    "metal": ("chrome", "steel_plain", "black", "brass"),
                },
            ),
            Family(
                "deep",
                (0.54, 0.39, 0.21),
                (0.66, 0.42, 0.24),
                ("ceramic", "granite_grey", "steel", "granite_sand"),
                {
                    "faucet": ("bridge", "gooseneck", "square"),
                    "lever": ("side",),
                    "metal": ("chrome", "brass", "bronze"),
                },
            ),
        ),
        made_by=Sink,
    ),
    Kind(
        "stove",
        "stove",
        20,
        4,
        (
            Family(
                "gas",
                (0.75, 0.65, 0.92),
                (0.765, 0.68, 0.92),
                (*STEELS, "white", "black"),
                {"handle": ("bar", "bow"), "knob": ("round", "bar"), "back": (0.0, 0.06, 0.10), "hob": ("gas",)},
            ),
            Family(
                "electric",
                (0.75, 0.65, 0.92),
                (0.765, 0.68, 0.92),
                ("white", "steel", "black", "graphite", "black_steel"),
                {"handle": ("bar", "slim"), "knob": ("round",), "back": (0.10, 0.14), "hob": ("coil", "glass")},
            ),
            Family(
                "retro",
                (0.75, 0.65, 0.92),
                (0.765, 0.68, 0.92),
                ("cream", "mint", "red", "navy"),
                {"handle": ("bow", "bar"), "knob": ("round", "bar"), "back": (0.06, 0.10), "hob": ("gas",)},
            ),
        ),
        made_by=Stove,
    ),
    Kind(
        "stove_wide",
        "stove",
        14,
        3,
        (
            Family(
                "pro",
                (0.90, 0.66, 0.92),
                (1.00, 0.70, 0.92),
                (*STEELS, "navy", "graphite"),
                {"handle": ("bar",), "knob": ("round", "bar"), "back": (0.0, 0.08), "hob": ("gas",)},
            ),
            Family(
                "country",
                (0.90, 0.66, 0.92),
                (1.00, 0.70, 0.92),
                ("cream", "sage", "black", "red"),
                {"handle": ("bow", "bar"), "knob": ("round",), "back": (0.06, 0.10), "hob": ("gas", "coil")},
            ),
        ),
        made_by=Stove,
    ),
    Kind(
        "stovetop",
        "stove",
        16,
        4,
        (
            Family(
                "gas",
                (0.58, 0.50, 0.010),
                (0.76, 0.53, 0.015),
                ("steel", "black", "black_steel", "white", "warm_steel"),
                {"knob": ("round", "bar"), "hob": ("gas",), "burners": (4, 5)},
            ),
            Family(
                "ceramic",
                (0.58, 0.50, 0.010),
                (0.76, 0.53, 0.015),
                ("black", "graphite", "steel", "white"),
                {"knob": ("round",), "hob": ("glass",), "burners": (4,)},
            ),
        ),
        made_by=Stovetop,
    ),
)
