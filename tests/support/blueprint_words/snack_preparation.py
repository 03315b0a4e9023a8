"""Preparing snacks: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import DoorsClosed, ForEach, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

SHUT = {"cab doors closed (every door joint <= 0.005 of range)": DoorsClosed("cab", 0.005)}
OPEN = {"cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0)}


def on(name: str, receptacle: str) -> dict[str, ObjectOn]:
    return {f"{name} in/on {receptacle} {ON_ITS_MIDDLE.format(receptacle)}": ObjectOn(name, receptacle)}


OURS = {
    "BreadAndCheese": Ours(
        goal={**on("obj", "container"), **on("obj2", "container"), **away("obj")},
        initial={"robot base in front of cutting_board": "container"},
        called={"cutting_board": "container"},
    ),
    "CerealAndBowl": Ours(
        goal={
            "cereal in contact with counter": ObjectTouches("cereal", "counter"),
            "bowl in contact with counter": ObjectTouches("bowl", "counter"),
            **SHUT,
        },
        initial={"cab doors closed": None, "cereal and bowl on opposite sides of cab, sides at random": "cereal"},
    ),
    "MakeFruitBowl": Ours(
        goal={**on("fruit1", "bowl"), **on("fruit2", "bowl"), **SHUT},
        initial={"cab doors closed (model default; source sets no door state)": None},
    ),
    "VeggieDipPrep": Ours(
        goal={
            **on("cucumber", "tray"),
            **on("carrot", "tray"),
            **on("bowl", "tray"),
            **away("bowl", "cucumber", "carrot", metres=0.15),
        },
        initial={"robot base in front of tray": "tray"},
    ),
    "YogurtDelightPrep": Ours(
        goal={
            "yogurt in contact with counter": ObjectTouches("yogurt", "counter"),
            "every fruit_{i} in contact with counter": ForEach("fruit", lambda name: ObjectTouches(name, "counter")),
            **away("yogurt"),
            "gripper > 0.25 m from every fruit_{i}": ForEach("fruit", GripperFar),
        },
        initial={**OPEN, "number of fruits 1-3 at random": "fruit"},
        called={"fruit_0": "fruit_i"},
    ),
}
