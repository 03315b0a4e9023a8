"""Washing dishes in the sink: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    MovedSince,
    Not,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT
from robocasa_lerobot.envs.tasks.composite.common import both_together

DRY = {"faucet off": Water("sink", on=False)}
DRY_AT_FIRST = {"faucet off (not set by the task, default)": None}
MARGIN = "(bbox, margin 0.05 m)"


def inside(*names: str) -> dict[str, ObjectInside]:
    return {f"{name} inside sink {MARGIN}": ObjectInside(name, "sink", margin=0.05) for name in names}


def rinsed(name: str, *, on_end: bool) -> StepsWhile:
    return StepsWhile(UnderWater(name, "sink"), 25, consecutive=on_end, label=f"{name}_rinsed")


SCRUBBED = StepsWhile(
    AllOf(ObjectOn("sponge", "bowl"), MovedSince("sponge", since="step", by_m=0.001)), 15, label="bowl_scrubbed"
)

LEFT = both_together("leftover1", "leftover2", "bowl")

OURS = {
    "ClearSink": Ours(
        goal={
            **{
                f"{name} NOT inside sink {MARGIN}": Not(ObjectInside(name, "sink", margin=0.05))
                for name in ("food0", "food1")
            },
            **inside("dish0", "dish1"),
            **away("food0", "food1", "dish0", "dish1"),
        },
        initial=DRY,
    ),
    "DryDishes": Ours(
        goal={
            "obj1 touching counter": ObjectTouches("obj1", "counter"),
            "obj2 touching counter": ObjectTouches("obj2", "counter"),
            **away("obj1", "obj2"),
        },
        initial={**DRY, "cup in random back corner of sink (left or right)": "obj1"},
    ),
    "DumpLeftovers": Ours(
        goal={
            "leftover1 NOT in bowl (contact and xy dist < 0.7 x radius)": Not(LEFT[0]),
            "leftover2 NOT in bowl (intended; source tests leftover1 twice)": Not(LEFT[1]),
            **inside("bowl"),
            **away("bowl"),
        },
        initial={"leftovers in bowl": "leftover1"},
    ),
    "RinseBowls": Ours(
        goal={
            "dish0 rinsed: >= 25 consecutive steps under running water (xy dist to stream < bowl radius, below stream "
            "top, faucet on)": rinsed("dish0", on_end=True),
            "dish1 rinsed: same": rinsed("dish1", on_end=True),
            **away("dish0", "dish1"),
        },
        initial=DRY_AT_FIRST,
        order=rinsed("dish0", on_end=True),
    ),
    "ScrubBowl": Ours(
        goal={"scrubbed >= 15 steps": SCRUBBED, **away("bowl")},
        initial=DRY,
        order=SCRUBBED,
    ),
    "SoakSponge": Ours(
        goal={
            "sponge under running water >= 25 steps (xy dist to stream < sponge radius, below stream top, faucet "
            "on)": rinsed("obj", on_end=False),
            **away("obj"),
            **inside("obj"),
        },
        initial=DRY_AT_FIRST,
        order=rinsed("obj", on_end=False),
    ),
    "StackBowlsInSink": Ours(
        goal={
            **inside("receptacle1", "receptacle2"),
            "OR(receptacle2 in receptacle1; receptacle1 in receptacle2) (contact; xy dist < 0.7 x radius of the "
            "lower)": AnyOf(ObjectOn("receptacle2", "receptacle1"), ObjectOn("receptacle1", "receptacle2")),
            **away("receptacle1", "receptacle2"),
        },
        initial=DRY,
    ),
    "TransportCookware": Ours(
        goal={
            **{f"{name} inside sink {MARGIN}": ObjectInBasin(name, "sink") for name in ("pot", "pan")},
            **away("pot", "pan"),
        },
        initial={"all burners off": None},
        turned={"pan": HANDLE_TO_FRONT},
    ),
}
