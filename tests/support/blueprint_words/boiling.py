"""Boiling: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import IN_SAUCEPAN, LEVEL, LIT_SAUCEPAN, ON_SAUCEPAN, Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectInBasin,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, PartAt
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

COOLED = StepsWhile(
    AllOf(ObjectTouches("kettle", "stove"), StateIs("stove", "{burner}_on", value=False)), 150, label="kettle_cooled"
)
HEATS = StateIs("electric_kettle", "on")

OURS = {
    "BoilCorn": Ours(
        goal={
            **LIT_SAUCEPAN,
            **{IN_SAUCEPAN.format(name): ObjectOn(name, "saucepan") for name in ("corn1", "corn2")},
            **ON_SAUCEPAN,
            **away("saucepan_auxiliary"),
        },
        initial={
            "burner chosen at random among front burners": None,
            "chosen burner knob high (>= 80 deg)": BurnerAt("stove", "{knob}", "high"),
            "lid starts on the saucepan (anchored)": "saucepan_auxiliary",
            "saucepan holds water (visual liquid)": "saucepan",
        },
        called={"lid": "saucepan_auxiliary"},
        besides=LEVEL,
        turned={"saucepan": HANDLE_TO_FRONT},
    ),
    "BoilEggs": Ours(
        goal={
            **LIT_SAUCEPAN,
            **{IN_SAUCEPAN.format(name): ObjectOn(name, "saucepan") for name in ("egg1", "egg2")},
            **away("saucepan"),
        },
        initial={
            "burner chosen at random among front burners": None,
            "chosen burner knob high (>= 80 deg)": BurnerAt("stove", "{knob}", "high"),
            "saucepan holds water (visual liquid)": "saucepan",
            "robot base centred on egg_plate": "egg_plate",
        },
        turned={"saucepan": HANDLE_TO_FRONT},
    ),
    "BoilPot": Ours(
        goal={
            "pot in contact with stove": ObjectTouches("pot", "stove"),
            "knob of the burner nearest to the pot (any distance) in [0.35, 2pi-0.35]": OnBurner(
                "pot", "stove", lit=True, within=0.15
            ),
        },
        initial={
            "all burners off": None,
            "pot holds water (visual liquid)": "pot",
            "robot base centred on pot": "pot",
        },
        besides=frozenset({GripperFar("pot")}),
    ),
    "CoolKettle": Ours(
        goal={
            "cooling_done latched": COOLED,
            "kettle in contact with dining_counter": ObjectTouches("kettle", "dining_counter"),
            **away("kettle", metres=0.15),
        },
        initial={
            "burner chosen at random among those with knobs": None,
            "knob of chosen burner on (>= 0.5 rad)": BurnerAt("stove", "{burner}", "on"),
            "kettle on chosen burner": "kettle",
        },
        order=COOLED,
    ),
    "FillKettle": Ours(
        goal={
            "obj inside sink (all bbox corners within one interior region, tol 0.05)": ObjectInBasin("obj", "sink"),
            **away("obj"),
        },
        initial={"cabinet doors closed": None},
    ),
    "HeatMultipleWater": Ours(
        goal={
            "obj (pot) on a lit burner: contact with stove, centre xy < 0.15 m of burner, its knob in [0.35, "
            "2pi-0.35]": OnBurner("obj", "stove", lit=True, within=0.15),
            "obj2 (kettle) on a lit burner: contact with stove, centre xy < 0.08 m of burner, its knob in [0.35, "
            "2pi-0.35]": OnBurner("obj2", "stove", lit=True, within=0.08),
            "burner of pot != burner of kettle": OnBurner("obj", "stove", other_than="obj2"),
            **away("obj", "obj2"),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0), "all burner knobs off": None},
    ),
    "PlaceLidToBoil": Ours(
        goal={**LIT_SAUCEPAN, **ON_SAUCEPAN, **away("saucepan_auxiliary")},
        initial={
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
            "burner chosen at random among front burners": None,
            "chosen burner knob high (>= 80 deg)": BurnerAt("stove", "{knob}", "high"),
            "saucepan holds water (visual liquid)": "saucepan",
        },
        called={"lid": "saucepan_auxiliary"},
        besides=LEVEL,
        turned={"saucepan": HANDLE_TO_FRONT},
    ),
    "StartElectricKettle": Ours(
        goal={
            "electric_kettle lid closed (<= 0.01 of range)": PartWithin(
                "electric_kettle", "lid", high=0.01, label="closed"
            ),
            "electric_kettle turned on (switch >= 0.95 of range latches power)": HEATS,
        },
        initial={
            "kettle lid fully open (1.0)": PartAt("electric_kettle", "lid", (1.0, 1.0)),
            "kettle switched off": None,
        },
        order=HEATS,
    ),
}
