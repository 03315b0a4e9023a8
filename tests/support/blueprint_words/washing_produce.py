"""Washing produce: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from blueprint_words.washing_produce_stored import SAID_SORTED, SORTED
from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    GripperFar,
    Not,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StateIs,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water

UNDER = UnderWater("colander", "sink")
LOADED = ForEach("fruit", lambda name: ObjectOn(name, "colander"))
OFF = {"faucet off (handle joint not in (0.40, pi) rad)": StateIs("sink", "water_on", value=False)}
RINSED = StepsWhile(
    AllOf(
        ForEach("obj", lambda name: ObjectInside(name, "sink", margin=0.05)),
        ForEach("unwashable_obj", lambda name: Not(ObjectInside(name, "sink", margin=0.05))),
        StateIs("sink", "water_on"),
    ),
    11,
    consecutive=True,
    label="produce_washed",
)

DRAINED = StepsWhile(
    AllOf(ObjectInside("obj", "sink", margin=0.05), StateIs("sink", "water_on")),
    11,
    consecutive=True,
    label="obj_washed",
)

OURS = {
    "DrainVeggies": Ours(
        goal={
            "washed: for > 10 consecutive steps obj inside sink (bbox, tol 0.05) AND faucet on": DRAINED,
            "obj in obj_container (contact AND centre xy distance < 0.7 x obj_container radius)": ObjectOn(
                "obj", "obj_container"
            ),
            **OFF,
        },
        initial={"faucet off": Water("sink", on=False)},
        order=DRAINED,
    ),
    "AfterwashSorting": Ours(
        goal={**OFF, SAID_SORTED: SORTED},
        initial={
            "faucet on": Water("sink", on=True),
            "two different produce categories A, B drawn at random": "food3",
        },
    ),
    "AirDryFruit": Ours(
        goal={
            **OFF,
            "every fruit{i} on cutting_board (contact AND centre xy distance < 0.7 x board radius)": ForEach(
                "fruit", lambda name: ObjectOn(name, "cutting_board")
            ),
            "gripper > 0.15 m from every fruit{i}": ForEach("fruit", lambda name: GripperFar(name, 0.15)),
        },
        initial={"faucet on": Water("sink", on=True), "number of fruits N = 1, 2 or 3 at random": None},
    ),
    "ClearClutter": Ours(
        goal={
            "washed: for > 10 consecutive steps all obj_{i} inside sink (bbox, tol 0.05) AND no unwashable_obj_{i} "
            "inside sink AND faucet on": RINSED,
            "every obj_{i} on receptacle (contact AND centre xy distance < 0.7 x tray radius)": ForEach(
                "obj", lambda name: ObjectOn(name, "receptacle")
            ),
            "no unwashable_obj_{i} on receptacle": ForEach(
                "unwashable_obj", lambda name: Not(ObjectOn(name, "receptacle"))
            ),
            **OFF,
        },
        initial={
            "faucet off": Water("sink", on=False),
            "number of produce items 1 or 2 and of non-washable items 1 or 2, at random": None,
        },
        order=RINSED,
        turned={"receptacle": (0.0, 0.0)},
    ),
    "ClearSinkSpace": Ours(
        goal={
            "every obj{i} touches counter (contact)": ForEach("obj", lambda name: ObjectTouches(name, "counter")),
            "gripper > 0.25 m from every obj{i}": ForEach("obj", lambda name: GripperFar(name, 0.25)),
        },
        initial={"number of sink objects 1 or 2 at random": None},
    ),
    "WashFruitColander": Ours(
        goal={
            "colander under running water (centre xy within colander radius of stream, below its top, "
            "faucet on)": UNDER,
            "every fruit{i} in colander (contact AND centre xy distance < 0.7 x colander radius)": LOADED,
        },
        initial={"faucet off": Water("sink", on=False), "number of fruits N = 1, 2 or 3 at random": None},
        besides=frozenset(
            {
                StepsWhile(AllOf(UNDER, LOADED), 25, label="fruit_washed"),  # a passing moment would count
                ObjectInBasin("colander", "sink"),
                GripperFar("colander"),
            }
        ),
    ),
}
