"""Fridges side by side: the freezer is as high as the fridge, and takes drawers for tasks that ask for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import Fridge

FREEZER_DRAWERS = "freezer_drawers"  # what one may be fitted with: two, on shelves
_UPPER_FLOOR = (0.55, 1.0)  # bounds of the height of the upper one's floor in the room, metres


@dataclass
class SideBySideFridge(Fridge):
    """The freezer at the left, the fridge at the right; with drawers in the freezer where a task asks for them."""

    with_freezer_drawers: bool = False

    def fit(self, what: str) -> None:
        """Take two drawers into the freezer."""
        if what != FREEZER_DRAWERS:
            super().fit(what)
        self.with_freezer_drawers = True

    @property
    def freezer_drawers(self) -> tuple[str, ...]:
        """`freezer_drawer0` and `freezer_drawer1`, the upper one."""
        return tuple(f"freezer_drawer{number}" for number in range(len(self._drawer_levels())))

    def _drawer_levels(self) -> tuple[int, ...]:
        if not self.with_freezer_drawers:
            return ()
        low, high = _UPPER_FLOOR
        floors = [self.height / 2 + level for level in self._levels("freezer")]
        upper = max(number for number, floor in enumerate(floors) if low <= floor <= high)
        return upper - 1, upper

    looks: ClassVar = {"closed": {}, "open": {"fridge_door": 1.0, "freezer_door": 1.0, "fridge_drawer0": 0.5}}
