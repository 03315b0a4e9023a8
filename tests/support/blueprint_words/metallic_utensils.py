"""Metallic utensils: our words for their blueprint."""

from __future__ import annotations

from collections.abc import Callable

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, ForEach, Goal, GripperFar, Not, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

INSIDE = "(all 8 bbox corners in interior region, slack 0.05)"


def of_metal(make: Callable[[str], Goal]) -> AllOf:
    return AllOf(make("metallic_utensil"), make("metallic_utensil_2"), ForEach("third_metallic_utensil", make))


def of_wood(make: Callable[[str], Goal]) -> AllOf:
    return AllOf(make("wooden_spoon"), ForEach("second_wooden_spoon", make))


OURS = {
    "OrganizeMetallicUtensils": Ours(
        goal={
            f"every metal utensil inside drawer {INSIDE}": of_metal(
                lambda name: ObjectInside(name, "drawer", margin=0.05)
            ),
            "NOT any metal utensil touching dining_counter": of_metal(
                lambda name: Not(ObjectTouches(name, "dining_counter"))
            ),
            "every wooden spoon touching dining_counter": of_wood(lambda name: ObjectTouches(name, "dining_counter")),
            "NOT any wooden spoon inside drawer": of_wood(lambda name: Not(ObjectInside(name, "drawer"))),
            "gripper > 0.25 m from every utensil": AllOf(
                of_metal(lambda name: GripperFar(name, 0.25)), of_wood(lambda name: GripperFar(name, 0.25))
            ),
        },
        initial={
            # Of the slide's range, of which full travel is 0.55.
            "drawer open (0.27-0.30 of range (partial open))": InitialOpenness("drawer", 0.49, 0.55),
            "4th utensil metal or wooden at random 50/50": None,
        },
    ),
}
