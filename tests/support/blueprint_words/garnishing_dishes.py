"""Garnishing dishes: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AnyOf, Exactly, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_TOP = "(contact AND xy centre distance < 0.7 x {} horizontal radius)"


def on_cake_or_plate(name: str) -> AnyOf:
    return AnyOf(ObjectOn(name, "cake"), ObjectOn(name, "cake_plate"))


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
    "GarnishCake": Ours(
        goal={
            "exactly one of cherry1, cherry2 is OR(on cake, on cake_plate) (contact AND xy centre "
            "distance < 0.7 x that receptacle's horizontal radius)": Exactly(
                1, on_cake_or_plate("cherry1"), on_cake_or_plate("cherry2")
            ),
            "exactly one of strawberry1, strawberry2 is on cake_plate (contact AND xy centre distance < "
            "0.7 x cake_plate horizontal radius)": Exactly(
                1, ObjectOn("strawberry1", "cake_plate"), ObjectOn("strawberry2", "cake_plate")
            ),
            "cake_plate in contact with dining_counter": ObjectTouches("cake_plate", "dining_counter"),
            "gripper > 0.25 m from cake_plate": GripperFar("cake_plate", 0.25),
        },
        initial={
            "robot base in front of fruit_plate": "fruit_plate",
        },
        called={"one": ""},
        scales={"cake": (1.4, 1.4, 1.4)},
    ),
    "GarnishCupcake": Ours(
        goal={
            "cinnamon within 0.3 m (xy centres) of cupcake_container (no surface contact checked)": Near(
                "cinnamon", "cupcake_container", 0.3
            ),
            "chocolate in/on cupcake_container (contact AND xy centre distance < 0.7 x cupcake_container "
            "horizontal radius)": ObjectOn("chocolate", "cupcake_container"),
            "cupcake in/on cupcake_container (contact AND xy centre distance < 0.7 x cupcake_container "
            "horizontal radius)": ObjectOn("cupcake", "cupcake_container"),
            "cupcake_container in contact with dining_counter": ObjectTouches("cupcake_container", "dining_counter"),
            "gripper > 0.25 m from cinnamon": GripperFar("cinnamon", 0.25),
            "gripper > 0.25 m from chocolate": GripperFar("chocolate", 0.25),
        },
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
        },
        besides=frozenset({ObjectTouches("cinnamon", "dining_counter")}),
    ),
}
