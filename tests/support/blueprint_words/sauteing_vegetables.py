"""Sauteing vegetables: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Goal,
    Grasped,
    MovedSince,
    Near,
    Not,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

STIRRED = StepsWhile(
    AllOf(
        Grasped("spatula"),
        OnBurner("pot", "stove", burner="{knob}", lit=True, within=0.15),
        ObjectOn("veg1", "pot"),
        ObjectOn("veg2", "pot"),
        MovedSince("veg1", "step", by_m=0.0005, across=True),
        MovedSince("veg2", "step", by_m=0.0005, across=True),
        ObjectTouches("spatula", "veg1"),
    ),
    5,
    label="vegetables_stirred",
)

BURNER_OFF = {"burner {knob} chosen at random among burners that have a knob": None, "all burners off": None}
ON = {"{knob} burner on (knob angle in [0.35, 2pi-0.35])": StateIs("stove", "{knob}_on")}
TO_FRONT = {"pan": HANDLE_TO_FRONT}
PREHEATED = StepsWhile(
    AllOf(OnBurner("pot", "stove", burner="{knob}", lit=True), Not(ObjectOn("vegetable", "pot"))),
    500,
    label="pot_preheated",
)


def over_flame(name: str) -> dict[str, Goal]:
    sentence = f"{name} touching stove and within 0.15 m (xy) of the {{knob}} burner site, that burner on"
    return {sentence: OnBurner(name, "stove", burner="{knob}", lit=True, within=0.15)}


def inside(vessel: str, *names: str) -> dict[str, Goal]:
    return {f"{name} in {vessel} (contact; xy dist < 0.7 x {vessel} radius)": ObjectOn(name, vessel) for name in names}


VEGETABLE_IN = ObjectOn("obj", "obj_container")
SHAKEN = StepsWhile(AllOf(VEGETABLE_IN, MovedSince("obj_container", "step", by_m=0.001)), 25, label="pan_shaken")
TILTED = StepsWhile(AllOf(VEGETABLE_IN, MovedSince("obj_container", "reset", by_rad=0.3)), 12, label="pan_tilted")
BURNER_ON = {
    "burner {knob} chosen at random among burners that have a knob": None,
    "{knob} burner on": BurnerAt("stove", "{knob}", "on"),
}

OURS = {
    "ShakePan": Ours(
        goal={
            "shaken >= 25 steps": SHAKEN,
            **inside("obj_container", "obj"),
            **over_flame("obj_container"),
        },
        initial=BURNER_ON,
        order=SHAKEN,
        turned={"obj_container": HANDLE_TO_FRONT},
    ),
    "TiltPan": Ours(
        goal={
            "tilted >= 12 steps": TILTED,
            **over_flame("obj_container"),
            **inside("obj_container", "obj"),
        },
        initial=BURNER_ON,
        order=TILTED,
        turned={"obj_container": HANDLE_TO_FRONT},
    ),
    "AdjustHeat": Ours(
        goal={
            **over_flame("pan"),
            # Of a turn of 3/2 pi.
            "{knob} knob angle in [pi/4, 3pi/4]": PartWithin(
                "stove", "knob_{knob}", low=1 / 6, high=1 / 2, label="medium"
            ),
            **inside("pan", "veg1", "veg2"),
        },
        initial=BURNER_OFF,
        turned=TO_FRONT,
    ),
    "ButterOnPan": Ours(
        goal={**inside("pan", "butter"), **over_flame("pan"), **ON},
        initial=BURNER_OFF,
        turned=TO_FRONT,
    ),
    "PlaceVegetablesEvenly": Ours(
        goal={
            **inside("pan", "veg1", "veg2"),
            # Middles at one height within 2 cm are no more than chance between a broccoli and a carrot.
            "height difference of veg1 and veg2 < 0.02 m": Not(ObjectTouches("veg1", "veg2")),
            "xy distance of veg1 and veg2 > 0.06 m": Not(Near("veg2", "veg1", 0.06)),
            **away("veg1", "veg2"),
        },
        initial=BURNER_OFF,
        turned=TO_FRONT,
    ),
    "PreheatPot": Ours(
        goal={
            **over_flame("pot"),
            **ON,
            "preheated >= 500 steps before the vegetable is added": PREHEATED,
            **inside("pot", "vegetable"),
        },
        initial=BURNER_OFF,
        order=PREHEATED,
    ),
    "StirVegetables": Ours(
        goal={"stirred >= 5 steps": STIRRED},
        initial={
            "burner {knob} chosen at random among burners that have a knob": "pot",
            "{knob} burner on": BurnerAt("stove", "{knob}", "on"),
        },
        order=STIRRED,
    ),
}
