"""Defrosting food: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, ObjectInside, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

RUNS = StateIs("microwave", "on")

OURS = {
    "MoveToCounter": Ours(
        goal={
            "frosted_food on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("frosted_food", "plate"),
            **away("frosted_food"),
        },
        initial={"fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
    ),
    "MicrowaveThawing": Ours(
        goal={
            "obj inside microwave (bbox, margin 0.05 m)": ObjectInside("obj", "microwave", margin=0.05),
            "gripper > 0.25 m from obj": GripperFar("obj", 0.25),
            "microwave on (start button pressed with door not open >= 0.90)": RUNS,
        },
        initial={"microwave door closed and off": None},
        order=RUNS,
        besides=frozenset({DoorsClosed("microwave")}),  # it would also run while the door is ajar
        same={"distractor_counter": "counter"},
    ),
    "DefrostByCategory": Ours(
        goal={
            "obj0 inside sink (bbox, margin 0.05 m)": ObjectInside("obj0", "sink", margin=0.05),
            "obj1 inside sink (bbox, margin 0.05 m)": ObjectInside("obj1", "sink", margin=0.05),
            "obj2 in container (contact; xy dist < 0.7 x container radius)": ObjectOn("obj2", "container"),
            "obj3 in container (contact; xy dist < 0.7 x container radius)": ObjectOn("obj3", "container"),
            "gripper > 0.25 m from obj0": GripperFar("obj0", 0.25),
            "gripper > 0.25 m from obj1": GripperFar("obj1", 0.25),
            "gripper > 0.25 m from obj2": GripperFar("obj2", 0.25),
            "gripper > 0.25 m from obj3": GripperFar("obj3", 0.25),
        },
        initial={
            "bowl on random side (left or right) of sink, food on the other side": "container",
            "faucet not set by the task (default off)": Water("sink", on=True),
        },
    ),
    "MicrowaveThawingFridge": Ours(
        goal={
            "meat inside microwave (bbox, margin 0.05 m)": ObjectInside("meat", "microwave", margin=0.05),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
            "microwave on (start button pressed with door not open >= 0.90)": StateIs("microwave", "on"),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "microwave door open (0.90-1.0 of range)": InitialOpenness("microwave", 0.9, 1.0),
        },
        order=StateIs("microwave", "on"),
        besides=frozenset({DoorsClosed("microwave")}),
    ),
    "QuickThaw": Ours(
        goal={
            "{knob} burner on (knob angle in [0.35, 2pi-0.35])": StateIs("stove", "{knob}_on"),
            "meat in container (contact; xy dist < 0.7 x container radius)": ObjectOn("meat", "container"),
            "gripper > 0.15 m from meat": GripperFar("meat", 0.15),
        },
        initial={
            "burner {knob} chosen at random among burners that have a knob": "container",
            "{knob} burner off": BurnerAt("stove", "{knob}", "off"),
        },
    ),
    "ThawInSink": Ours(
        goal={
            "obj inside sink (bbox, margin 0.05 m)": ObjectInside("obj", "sink", margin=0.05),
            "faucet on (handle angle in (0.40, pi))": StateIs("sink", "water_on"),
        },
        initial={
            "faucet off": Water("sink", on=False),
        },
    ),
}
