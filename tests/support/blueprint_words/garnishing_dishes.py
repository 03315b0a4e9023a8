"""Garnishing dishes: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn, ObjectTouches

ON_TOP = "(contact AND xy centre distance < 0.7 x {} horizontal radius)"

OURS = {
    "AddSugarCubes": Ours(
        goal={
            **{
                f"{name} in/on cake_container {ON_TOP.format('cake_container')}": ObjectOn(name, "cake_container")
                for name in ("sugar_cube_1", "sugar_cube_2", "cake")
            },
            "cake_container in contact with dining_counter": ObjectTouches("cake_container", "dining_counter"),
            **away("sugar_cube_1", "sugar_cube_2", metres=0.15),
        },
        initial={},
    ),
    "AddLemonToFish": Ours(
        goal={
            f"lemon_wedge in/on fish_container {ON_TOP.format('fish_container')}": ObjectOn(
                "lemon_wedge", "fish_container"
            ),
            f"fish in/on fish_container {ON_TOP.format('fish_container')}": ObjectOn("fish", "fish_container"),
            "fish_container in contact with dining_counter": ObjectTouches("fish_container", "dining_counter"),
            **away("lemon_wedge"),
        },
        initial={"fridge doors closed": None},
    ),
    "GarnishPancake": Ours(
        goal={
            f"strawberry in/on pancake {ON_TOP.format('pancake')}": ObjectOn("strawberry", "pancake"),
            f"pancake in/on pancake_container {ON_TOP.format('pancake_container')}": ObjectOn(
                "pancake", "pancake_container"
            ),
            "pancake_container in contact with dining_counter": ObjectTouches("pancake_container", "dining_counter"),
            "gripper > 0.25 m from strawberry": GripperFar("strawberry", 0.25),
        },
        initial={"fridge doors closed": None},
    ),
}
