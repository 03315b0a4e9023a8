"""Packing lunches: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, Exactly, GripperFar, Not, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness

FOOD = ("vegetable0", "vegetable1", "meat0", "meat1")


def one_of_each_in(box: str) -> AllOf:
    vegetables, meats = (tuple(ObjectOn(name, box) for name in names) for names in (FOOD[:2], FOOD[2:]))
    return AllOf(Exactly(1, *vegetables), Exactly(1, *meats))


def in_both(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "tupperware0"), ObjectOn(name, "tupperware1"))


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
}
