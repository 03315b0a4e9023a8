"""Measuring ingredients: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, Not, ObjectOn, ObjectTouches, ObjectUpright
from robocasa_lerobot.envs.scene.spec import InitialOpenness

WANTED, OTHER = "measuring_cup_{size}", "measuring_cup_{_other}"

OURS = {
    "ChooseMeasuringCup": Ours(
        goal={
            "target cup in contact with counter": ObjectTouches(WANTED, "counter"),
            "other cup NOT in contact with counter": Not(ObjectTouches(OTHER, "counter")),
            "gripper > 0.25 m from target cup": GripperFar(WANTED, 0.25),
        },
        initial={
            "drawer closed": None,
            "robot base to the left or right of drawer at random; {side} = side of drawer as seen by robot": None,
            "target size larger or smaller at random": None,
            "both cups are the same model at different scale": "measuring_cup_large",
        },
        called={"target": WANTED},
    ),
    "WeighIngredients": Ours(
        goal={
            "obj on digital_scale (contact; centre xy < 0.7*digital_scale radius)": ObjectOn("obj", "digital_scale"),
            "obj upright (tilt < 15 deg)": ObjectUpright("obj"),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
}
