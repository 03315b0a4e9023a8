"""Packing lunches: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Exactly,
    GripperFar,
    Near,
    Not,
    ObjectOn,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

FOOD = ("vegetable0", "vegetable1", "meat0", "meat1")


def one_of_each_in(box: str) -> AllOf:
    vegetables, meats = (tuple(ObjectOn(name, box) for name in names) for names in (FOOD[:2], FOOD[2:]))
    return AllOf(Exactly(1, *vegetables), Exactly(1, *meats))


def in_both(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "tupperware0"), ObjectOn(name, "tupperware1"))


BOX_SCALE = (1.5, 1.5, 1.25)
FRIDGE_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")


def apart(hot_box: str, cold_box: str) -> AllOf:
    hot, cold = ("hot0", "hot1"), ("cold0", "cold1")
    return AllOf(*(ObjectOn(name, hot_box) for name in hot), *(ObjectOn(name, cold_box) for name in cold))


OURS = {
    "PackIdenticalLunches": Ours(
        goal={
            "tupperware0 holds exactly one vegetable and one meat (contact; xy dist < 0.7 x radius)": one_of_each_in(
                "tupperware0"
            ),
            "tupperware1 holds exactly one vegetable and one meat (contact; xy dist < 0.7 x radius)": one_of_each_in(
                "tupperware1"
            ),
            "no item counted in both tupperwares": AllOf(*(Not(in_both(name)) for name in FOOD)),
            **{f"gripper > 0.25 m from {name}": GripperFar(name, 0.25) for name in FOOD},
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "one vegetable category and one meat category random, two of each": "vegetable0",
        },
        # Ours are 17 cm long as they are, so that 2.5 would make them 44 cm.
        scales={"tupperware0": (1.5, 1.5, 1.25), "tupperware1": (1.5, 1.5, 1.25)},
    ),
    "PackFoodByTemp": Ours(
        goal={
            "OR(hot0 and hot1 in tupperware0 AND cold0 and cold1 in tupperware1; hot0 and hot1 in "
            "tupperware1 AND cold0 and cold1 in tupperware0) (contact; xy dist < 0.7 x tupperware radius; "
            "source ANDs the gripper tests to the second branch only)": AnyOf(
                apart("tupperware0", "tupperware1"), apart("tupperware1", "tupperware0")
            ),
            "gripper > 0.25 m from hot0": GripperFar("hot0", 0.25),
            "gripper > 0.25 m from hot1": GripperFar("hot1", 0.25),
            "gripper > 0.25 m from cold0": GripperFar("cold0", 0.25),
            "gripper > 0.25 m from cold1": GripperFar("cold1", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": FRIDGE_OPEN,
            "burner {knob} chosen at random among burners that have a knob": "hot0_container",
            "all burners off": None,
        },
        scales={"tupperware0": BOX_SCALE, "tupperware1": BOX_SCALE},
        turned={"hot0_container": (np.pi / 4, 3 * np.pi / 4)},
    ),
    "PackFruitContainer": Ours(
        goal={
            "fruit0 in tupperware (contact; xy dist < 0.7 x tupperware radius)": ObjectOn("fruit0", "tupperware"),
            "fruit1 in tupperware (contact; xy dist < 0.7 x tupperware radius)": ObjectOn("fruit1", "tupperware"),
            "gripper > 0.25 m from fruit0": GripperFar("fruit0", 0.25),
            "gripper > 0.25 m from fruit1": GripperFar("fruit1", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": FRIDGE_OPEN,
        },
        scales={"tupperware": BOX_SCALE},
    ),
    "PackSnack": Ours(
        goal={
            "snack touching any counter": ObjectTouchesAnyCounter("snack"),
            "snack within 0.30 m (xy) of tupperware": Near("snack", "tupperware", 0.3),
            "gripper > 0.25 m from snack": GripperFar("snack", 0.25),
        },
        initial={
            "cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
        },
        kinds={"counter": "counter"},
        scales={"tupperware": BOX_SCALE},
    ),
}
