"""Slow cooking: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import IN_SAUCEPAN, LEVEL, LIT_SAUCEPAN, ON_SAUCEPAN, Ours, away
from robocasa_lerobot.envs.predicates import BurnerLevel, ObjectOn, ObjectTouchesAnyCounter, StateIs
from robocasa_lerobot.envs.scene.initial_states import BurnerAt

LOW = {"chosen burner's knob on low: in [0.35, 80 deg (1.396)]": BurnerLevel("stove", "{knob}", "low")}
CHOSEN = {"burner chosen at random among front burners": None}
STARTS_LOW = {
    "chosen burner knob low (0.35 to 1.396)": BurnerAt("stove", "{knob}", "low"),
    "lid starts on the saucepan (anchored)": "saucepan_auxiliary",
}
BROTH = {"saucepan holds broth (visual liquid)": "saucepan"}
TAKEN_OFF = {"lid": "saucepan_auxiliary"}

OURS = {
    "AddToSoupPot": Ours(
        goal={
            **LIT_SAUCEPAN,
            **LOW,
            **{IN_SAUCEPAN.format(name): ObjectOn(name, "saucepan") for name in ("vegetable1", "vegetable2")},
            **ON_SAUCEPAN,
            **away("saucepan_auxiliary"),
        },
        initial={
            **CHOSEN,
            **STARTS_LOW,
            "saucepan holds soup (visual liquid)": "saucepan",
            "two different vegetables chosen at random from tomato, mushroom, carrot, potato, sweet_potato, "
            "broccoli": None,
        },
        called=TAKEN_OFF,
        besides=LEVEL,
    ),
    "BeginSlowCooking": Ours(
        goal={**LIT_SAUCEPAN, **LOW, **ON_SAUCEPAN, **away("saucepan_auxiliary")},
        initial={**CHOSEN, "all burners off": None, **BROTH},
        called=TAKEN_OFF,
        besides=LEVEL,
    ),
    "StopSlowCooking": Ours(
        goal={
            "chosen burner off (knob < 0.35 or > 2pi-0.35)": StateIs("stove", "{knob}_on", value=False),
            "saucepan_auxiliary (lid) in contact with any counter": ObjectTouchesAnyCounter("saucepan_auxiliary"),
            **away("saucepan_auxiliary"),
        },
        initial={**CHOSEN, **STARTS_LOW, **BROTH},
        called=TAKEN_OFF,
        kinds={"counter": "counter"},
        near={"counter": "stove"},
    ),
}
