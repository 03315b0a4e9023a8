"""Adding ice to beverages: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Exactly, GripperFar, ObjectOn, ObjectTouches


def in_glass(name: str) -> ObjectOn:
    return ObjectOn(name, "glass_cup", within=0.06)  # half a metre would leave it to the contact alone


ICE, FOUR = ("ice_cube1", "ice_cube2"), ("ice_cube1", "ice_cube2", "ice_cube3", "ice_cube4")


def in_cup(name: str, cup: str, names: tuple[str, ...]) -> AnyOf:
    others = [other for other in names if other != name]
    on_those = [AllOf(ObjectOn(other, cup, within=0.06), ObjectTouches(name, other)) for other in others]
    return AnyOf(ObjectOn(name, cup, within=0.06), *on_those)


def two_in(cup: str) -> Exactly:
    return Exactly(2, *(in_cup(name, cup, FOUR) for name in FOUR))


OURS = {
    "RetrieveIceTray": Ours(
        goal={
            "ice_cube_tray in contact with dining_counter": ObjectTouches("ice_cube_tray", "dining_counter"),
            **away("ice_cube_tray"),
        },
        initial={"freezer door closed": None, "fridge door closed": None},
        kinds={"fridge": "fridge_with_freezer"},
        scales={"ice_cube_tray": (1.0, 0.7, 1.0)},  # the gripper opens by 8 cm
    ),
    "PlaceEqualIceCubes": Ours(
        goal={
            "for each of glass_cup1, glass_cup2: exactly 2 cubes = (cubes in cup: contact with cup, centre xy < 0.5 m; "
            "at least 1) + (other cubes touching a cube in that cup)": two_in("glass_cup1"),
            **away(*FOUR, metres=0.15),
        },
        besides=frozenset({two_in("glass_cup2")}),  # of the same sentence
        initial={"robot base centred on ice_bowl": "ice_bowl", "both glasses hold water (visual liquid)": "glass_cup1"},
    ),
    "PlaceIceInCup": Ours(
        goal={
            "OR(ice_cube1 in glass_cup AND (ice_cube2 in glass_cup OR cubes touch), ice_cube2 in glass_cup AND "
            "(ice_cube1 in glass_cup OR cubes touch)); in = contact, centre xy < 0.5 m": AllOf(
                *(in_cup(name, "glass_cup", ICE) for name in ICE)
            ),
            **away(*ICE, metres=0.15),
        },
        initial={"robot base centred on ice_bowl": "ice_bowl"},
    ),
    "MakeIceLemonade": Ours(
        goal={
            "lemon_wedge in glass_cup (contact; centre xy < 0.5 m)": in_glass("lemon_wedge"),
            "OR(ice_cube1 in glass_cup (contact; xy < 0.5 m), ice_cube2 in glass_cup (contact; xy < 0.5 m))": AnyOf(
                in_glass("ice_cube1"), in_glass("ice_cube2")
            ),
            "gripper > 0.15 m from lemon_wedge": GripperFar("lemon_wedge", 0.15),
            "gripper > 0.15 m from ice_cube1": GripperFar("ice_cube1", 0.15),
            "gripper > 0.15 m from ice_cube2": GripperFar("ice_cube2", 0.15),
        },
        initial={"fridge doors closed": None, "glass_cup holds lemonade (visual liquid)": "glass_cup"},
    ),
}
