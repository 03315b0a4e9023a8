"""What was drawn for an episode before its model is made: fixtures of roles, objects, choices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.envs.kitchens.fixtures.base import yaw_quat
from robocasa_lerobot.envs.kitchens.footprints import Footprint
from robocasa_lerobot.envs.objects.catalogue import Instance
from robocasa_lerobot.envs.scene.words import numbered


@dataclass(frozen=True)
class PlacedObject:
    """An object of a scene: its model, and where it starts (centre in metres, yaw in radians).

    One that is `lying` was turned by a quarter about its own x axis before.
    `let_down_m` is how far above the floor of a vessel it starts: it may come down by that while it settles.
    `region_middle` is that of the rectangle in which its place was drawn, in the room, metres; of what lies in a vessel
    the vessel's.
    """

    name: str
    item: Instance
    pos: tuple[float, float, float]
    yaw: float
    region_middle: tuple[float, float]
    lying: bool = False
    let_down_m: float = 0.0

    @property
    def footprint(self) -> Footprint:
        """Its bounding box on the floor plan."""
        width, depth, height = self.item.size
        depth = height if self.lying else depth
        return Footprint(self.pos[0], self.pos[1], self.yaw, (width / 2, depth / 2))

    @property
    def quat(self) -> tuple[float, float, float, float]:
        """How it is turned at the start, (w, x, y, z)."""
        w, x, y, z = map(float, yaw_quat(self.yaw))
        half = float(np.sqrt(0.5))
        return (half * w, half * w, half * z, half * z) if self.lying else (w, x, y, z)


@dataclass(kw_only=True)
class Drawn:
    """What goals and stages may depend on.

    Attributes:
        roles: fixture name of each role of the task.
        objects: by name.
        choices: what was drawn for the task's choices, and the roles' fixtures, by name.
    """

    roles: dict[str, str]
    objects: dict[str, PlacedObject]
    choices: dict[str, str]

    def fill(self, text: str) -> str:
        """A name of a declaration with its choices and roles filled in, e.g. "knob_{knob}"."""
        return text.format(**self.choices) if "{" in text else text

    def named(self, name: str) -> tuple[str, ...]:
        """The objects of a declaration's name: one, or as many as were drawn, `<name>_0` first."""
        return numbered(self.fill(name), self.objects)
