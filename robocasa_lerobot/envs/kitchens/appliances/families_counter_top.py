"""Designs of the appliances that stand on a counter: proportions in metres, finishes, details."""

from __future__ import annotations

from robocasa_lerobot.envs.kitchens.appliances.families_built_in import STEELS
from robocasa_lerobot.envs.kitchens.appliances.kind_record import Kind
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.appliances.kinds.coffee_machine import CoffeeMachine
from robocasa_lerobot.envs.kitchens.appliances.kinds.electric_kettle import ElectricKettle
from robocasa_lerobot.envs.kitchens.appliances.kinds.microwave import Microwave
from robocasa_lerobot.envs.kitchens.appliances.kinds.stand_mixer import StandMixer
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster import Toaster
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster_oven import ToasterOven
from robocasa_lerobot.envs.kitchens.appliances.records import Family

RETRO = ("cream", "mint", "red", "sky", "pink", "sage", "navy", "mustard")

COUNTER_TOP: tuple[Kind, ...] = (
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
        made_by=Blender,
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
                (0.14, 0.30, 0.27),
                (0.18, 0.36, 0.33),
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
        made_by=CoffeeMachine,
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
        made_by=ElectricKettle,
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
                (*STEELS, "white", "black", "silver"),
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
                RETRO,
                {"handle": ("bow", "bar"), "controls": ("dials",), "window": ("tall", "wide")},
            ),
        ),
        made_by=Microwave,
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
        made_by=StandMixer,
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
                (*STEELS, "white", "black", "red"),
                {"slots": (2,), "corner": (0.02, 0.035), "base": ("black", "silver"), "dial": (True, False)},
            ),
            Family(
                "retro",
                (0.28, 0.18, 0.195),
                (0.31, 0.21, 0.21),
                RETRO,
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
        made_by=Toaster,
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
                (*STEELS, "black", "silver", "white"),
                {"handle": ("bar", "bow"), "racks": (1, 2), "feet": ("round", "square")},
            ),
            Family(
                "retro",
                (0.42, 0.33, 0.25),
                (0.48, 0.38, 0.29),
                RETRO,
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
        made_by=ToasterOven,
    ),
)
