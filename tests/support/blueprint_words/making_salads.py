"""Making salads: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, Near, ObjectTouches, StepsWhile, UnderWater
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

WASHED = StepsWhile(UnderWater("lettuce", "sink"), 25)

OURS = {
    "WashLettuce": Ours(
        goal={"washed >= 25 steps in total under running water": WASHED},
        initial={"faucet off": Water("sink", on=False)},
        order=WASHED,
    ),
    "PrepareCheeseStation": Ours(
        goal={
            "cheese in contact with counter": ObjectTouches("cheese", "counter"),
            "grater in contact with counter": ObjectTouches("grater", "counter"),
            "xy distance grater to lettuce_container (bowl) minus bowl radius < 0.25 m": Near(
                "grater", "lettuce_container", 0.25, from_edge=True
            ),
            "xy distance cheese to lettuce_container (bowl) minus bowl radius < 0.25 m": Near(
                "cheese", "lettuce_container", 0.25, from_edge=True
            ),
            "gripper > 0.25 m from cheese": GripperFar("cheese", 0.25),
            "gripper > 0.25 m from grater": GripperFar("grater", 0.25),
        },
        initial={
            "fridge doors open": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
        },
    ),
}
