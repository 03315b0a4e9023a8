"""Conditions on the shelves of a fridge, named by their level."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.envs.kitchens.fixtures.regions import ANY_LEVEL, USABLE_SHELF
from robocasa_lerobot.envs.predicates.logic import plain
from robocasa_lerobot.envs.predicates.objects import ObjectInside

LOWER_SHARE = 0.9  # of a shelf's height, that an object's origin must be in (docs/robocasa.md, section 7)

_ROUNDING_M = 1e-6  # the level decides which shelf counts, the heights tell skills the same


@dataclass(frozen=True, init=False)
class OnShelf(ObjectInside):
    """An object is on a usable shelf of a compartment: its bounding box in the shelf's room, or nearly.

    Its corners may stand out by 0.05 m, its origin is in the lower 90 % of the room's height.

    Args:
        object: name.
        fixture: role.
        level: "highest", "second_highest" (the highest if there is one only) or "any". May name a choice in braces.
        compartment: "fridge" or "freezer".
    """

    def __init__(self, object: str, fixture: str, level: str = ANY_LEVEL, compartment: str = "fridge") -> None:
        low, high, room = USABLE_SHELF
        height = (low - _ROUNDING_M, high + _ROUNDING_M, room - _ROUNDING_M)
        region = f"{compartment}_shelf:{level}"
        super().__init__(object, fixture, region=region, lower=LOWER_SHARE, height=height)

    @property
    def name(self) -> str:
        """E.g. `obj_on_highest_freezer_shelf`, `obj_on_any_fridge_shelf`."""
        shelf, _, level = self.region.partition(":")
        return f"{plain(self.object)}_on_{plain(level)}_{shelf}"


def inside(object: str, fixture: str, region: str = "") -> ObjectInside:
    """An object is in a region of a fixture: on the shelf of a level, if it is named so, as "fridge_shelf:highest"."""
    start, _, level = region.partition(":")
    if level:
        return OnShelf(object, fixture, level, start.removesuffix("_shelf"))
    return ObjectInside(object, fixture, region=region)
