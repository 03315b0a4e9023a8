"""The designs of every category: proportions in metres, finishes and details that its models are drawn from.

Counts by category are those of RoboCasa365 (456 models in 12 categories).
"""

from __future__ import annotations

from robocasa_lerobot.envs.scene.appliances.records import Family, Kind

_STEELS = ("steel", "warm_steel", "black_steel")
_PLAIN = ("white", "black", "graphite", "silver")
_RETRO = ("cream", "mint", "red", "sky", "pink", "sage", "navy", "mustard")

KINDS: tuple[Kind, ...] = (
    Kind(
        "blender",
        "blender",
        22,
        8,
        (
            Family(
                "jug",
                (0.185, 0.20, 0.36),
                (0.21, 0.225, 0.42),
                ("black", "steel", "red", "graphite"),
                {"jug": ("round", "square"), "handle": ("bow", "straight"), "panel": ("button", "wide")},
            ),
            Family(
                "retro",
                (0.185, 0.19, 0.37),
                (0.21, 0.215, 0.41),
                ("cream", "mint", "sky", "pink"),
                {"jug": ("round",), "handle": ("bow",), "panel": ("button",)},
            ),
            Family(
                "tower",
                (0.19, 0.20, 0.40),
                (0.21, 0.22, 0.46),
                ("silver", "black", "white", "black_steel"),
                {"jug": ("square", "round"), "handle": ("straight",), "panel": ("wide",)},
            ),
        ),
    ),
    Kind(
        "coffee_machine",
        "coffee_machine",
        48,
        10,
        (
            Family(
                "espresso",
                (0.24, 0.27, 0.30),
                (0.32, 0.34, 0.38),
                ("steel", "black", "red", "cream", "copper", "mint"),
                {"tray": ("grid", "slots"), "top": ("rail", "flat"), "accent": ("black", "chrome", "oak")},
            ),
            Family(
                "capsule",
                (0.14, 0.30, 0.25),
                (0.18, 0.36, 0.31),
                ("black", "white", "red", "graphite", "sky", "mustard"),
                {"tray": ("round", "grid"), "top": ("lever", "flat"), "accent": ("chrome", "black")},
            ),
            Family(
                "bean_to_cup",
                (0.24, 0.34, 0.34),
                (0.30, 0.40, 0.41),
                ("silver", "black", "graphite", "white", "black_steel"),
                {"tray": ("slots", "grid"), "top": ("hopper",), "accent": ("black", "chrome")},
            ),
            Family(
                "pod",
                (0.19, 0.28, 0.30),
                (0.24, 0.34, 0.35),
                ("black", "navy", "sage", "white", "silver", "cream"),
                {"tray": ("round", "slots"), "top": ("lever", "flat"), "accent": ("chrome", "graphite")},
            ),
        ),
    ),
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
                (*_STEELS, "white", "black"),
                {"handle": ("bar", "bow"), "panel": ("display", "dial"), "tines": (3, 4)},
            ),
            Family(
                "hidden_control",
                (0.595, 0.60, 0.86),
                (0.605, 0.62, 0.88),
                (*_STEELS, "white", "graphite"),
                {"handle": ("bar", "slim"), "panel": ("none",), "tines": (3, 4, 5)},
            ),
        ),
    ),
    Kind(
        "electric_kettle",
        "electric_kettle",
        25,
        8,
        (
            Family(
                "cone",
                (0.15, 0.21, 0.22),
                (0.165, 0.235, 0.25),
                ("steel", "white", "black", "red", "mint", "graphite"),
                {"window": (True, False), "accent": ("black", "chrome")},
            ),
            Family(
                "dome",
                (0.16, 0.22, 0.23),
                (0.175, 0.24, 0.26),
                ("cream", "sky", "pink", "navy", "copper", "sage"),
                {"window": (False,), "accent": ("chrome", "oak", "black")},
            ),
            Family(
                "glass",
                (0.15, 0.21, 0.22),
                (0.165, 0.23, 0.25),
                ("black", "white", "silver", "graphite"),
                {"window": (True,), "accent": ("black", "chrome")},
            ),
        ),
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
                (*_STEELS, "white", "graphite"),
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
                (*_STEELS, "white", "black"),
                {
                    "handle": ("bar", "bow"),
                    "dispenser": (True, False),
                    "shelves": (4, 5),
                    "drawers": (1, 2),
                    "freezer": (0.40, 0.44),
                },
            ),
        ),
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
                (*_STEELS, "white", "graphite"),
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
    ),
    Kind(
        "microwave",
        "microwave",
        50,
        10,
        (
            Family(
                "classic",
                (0.46, 0.36, 0.27),
                (0.56, 0.42, 0.32),
                (*_STEELS, "white", "black", "silver"),
                {"handle": ("bar", "bow"), "controls": ("keypad", "plain"), "window": ("wide", "tall")},
            ),
            Family(
                "frameless",
                (0.46, 0.36, 0.27),
                (0.54, 0.42, 0.31),
                ("black", "graphite", "white", "black_steel"),
                {"handle": ("bar", "slim"), "controls": ("strip", "plain"), "window": ("full",)},
            ),
            Family(
                "retro",
                (0.44, 0.36, 0.27),
                (0.50, 0.40, 0.30),
                _RETRO,
                {"handle": ("bow", "bar"), "controls": ("dials",), "window": ("tall", "wide")},
            ),
        ),
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
                (*_STEELS, "black", "white"),
                {"handle": ("bar", "bow"), "racks": (2,), "panel": ("display", "plain")},
            ),
            Family(
                "tall_oven",
                (0.70, 0.58, 0.68),
                (0.76, 0.62, 0.74),
                (*_STEELS, "graphite", "cream"),
                {"handle": ("bar", "slim"), "racks": (2,), "panel": ("display", "plain")},
            ),
            Family(
                "compact",
                (0.595, 0.55, 0.455),
                (0.60, 0.58, 0.48),
                (*_STEELS, "black", "navy"),
                {"handle": ("bar", "slim"), "racks": (1,), "panel": ("display",)},
            ),
        ),
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
    ),
    Kind(
        "stand_mixer",
        "stand_mixer",
        25,
        8,
        (
            Family(
                "tilt_head",
                (0.21, 0.34, 0.34),
                (0.23, 0.38, 0.37),
                ("red", "cream", "mint", "sky", "black", "silver", "navy", "pink", "white"),
                {"bowl": ("steel_plain", "chrome", "glass"), "trim": ("band", "cap"), "tool": ("whisk", "paddle")},
            ),
            Family(
                "angular",
                (0.21, 0.34, 0.34),
                (0.24, 0.38, 0.37),
                ("graphite", "white", "silver", "black", "mustard", "sage"),
                {"bowl": ("steel_plain", "white"), "trim": ("band", "cap"), "tool": ("whisk", "paddle", "hook")},
            ),
        ),
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
                (*_STEELS, "white", "black"),
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
                (*_STEELS, "navy", "graphite"),
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
    ),
    Kind(
        "stovetop",
        "stove",
        16,
        4,
        (
            Family(
                "gas",
                (0.58, 0.50, 0.05),
                (0.76, 0.53, 0.06),
                ("steel", "black", "black_steel", "white", "warm_steel"),
                {"knob": ("round", "bar"), "hob": ("gas",), "burners": (4, 5)},
            ),
            Family(
                "ceramic",
                (0.58, 0.50, 0.04),
                (0.76, 0.53, 0.05),
                ("black", "graphite", "steel", "white"),
                {"knob": ("round",), "hob": ("glass",), "burners": (4,)},
            ),
        ),
    ),
    Kind(
        "toaster",
        "toaster",
        44,
        10,
        (
            Family(
                "two_slot",
                (0.26, 0.17, 0.185),
                (0.30, 0.20, 0.21),
                (*_STEELS, "white", "black", "red"),
                {"slots": (2,), "corner": (0.02, 0.035), "base": ("black", "silver"), "dial": (True, False)},
            ),
            Family(
                "retro",
                (0.28, 0.18, 0.195),
                (0.31, 0.21, 0.21),
                _RETRO,
                {"slots": (2,), "corner": (0.05, 0.06), "base": ("chrome", "black"), "dial": (True,)},
            ),
            Family(
                "four_slot",
                (0.29, 0.27, 0.185),
                (0.32, 0.31, 0.21),
                ("steel", "black", "silver", "cream", "graphite", "red"),
                {"slots": (4,), "corner": (0.02, 0.04), "base": ("black", "silver"), "dial": (True, False)},
            ),
        ),
    ),
    Kind(
        "toaster_oven",
        "toaster_oven",
        47,
        10,
        (
            Family(
                "side_knobs",
                (0.44, 0.34, 0.25),
                (0.52, 0.40, 0.30),
                (*_STEELS, "black", "silver", "white"),
                {"handle": ("bar", "bow"), "racks": (1, 2), "feet": ("round", "square")},
            ),
            Family(
                "retro",
                (0.42, 0.33, 0.25),
                (0.48, 0.38, 0.29),
                _RETRO,
                {"handle": ("bow", "bar"), "racks": (1, 2), "feet": ("round",)},
            ),
            Family(
                "air_fryer",
                (0.42, 0.36, 0.30),
                (0.50, 0.42, 0.36),
                ("black", "graphite", "steel", "black_steel", "silver"),
                {"handle": ("bar",), "racks": (2,), "feet": ("round", "square")},
            ),
        ),
    ),
)
