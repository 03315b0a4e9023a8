"""Restocking the sink: our words for its blueprint."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import NearFixture, ObjectTouchesAnyCounter, ObjectUpright
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "RestockSinkSupplies": Ours(
        goal={
            "soap_dispenser in contact with any counter": ObjectTouchesAnyCounter("soap_dispenser"),
            "sponge in contact with any counter": ObjectTouchesAnyCounter("sponge"),
            "bbox gap soap_dispenser to sink < 0.25 m": NearFixture("soap_dispenser", "sink", 0.25),
            "bbox gap sponge to sink < 0.25 m": NearFixture("sponge", "sink", 0.25),
            "soap_dispenser upright (tilt < 15 deg)": ObjectUpright("soap_dispenser"),
            **away("soap_dispenser", "sponge"),
        },
        initial={
            "drawer open": InitialOpenness("drawer", 0.9, 1.0),
            "robot base to the left or right of drawer at random": None,
            "soap_dispenser lies on its side": "soap_dispenser",  # as its start says
        },
        kinds={"counter": "counter", "drawer": "drawer_top"},
        near={"counter": "sink"},
        turned={"soap_dispenser": (0.0, 0.0)},  # about the vertical; it lies, turned about its own x axis
    ),
}
