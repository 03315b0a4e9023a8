"""Conditions on objects that a burner heats or that stand under running water."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco

from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.logic import Term, plain
from robocasa_lerobot.envs.predicates.objects import middle_of, radius

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

ON_BURNER_M = 0.15  # horizontally from the burner's middle; RoboCasa asks for 0.08 in some tasks


@dataclass(frozen=True)
class UnderWater(Term):
    """An object is under running water: the stream falls within its radius, and begins above its middle.

    Attributes:
        object: name.
        fixture: role of the sink.
    """

    object: str
    fixture: str

    @property
    def name(self) -> str:
        """E.g. `obj_under_water`."""
        return f"{plain(self.object)}_under_water"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look where the stream falls."""
        name = scene.fill(self.object)
        return scene.fixture(self.fixture, Sink).under_water(data, middle_of(scene, data, name), radius(scene, name))


@dataclass(frozen=True)
class OnBurner(Term):
    """An object stands on a burner: it touches the stove, is above the burners, and this one is the nearest.

    Attributes:
        object: name.
        fixture: role of the stove or stovetop.
        burner: its location; may name a choice in braces; any burner if empty.
        lit: whether its knob must be on, or must be off; None is either.
        within: bound of the horizontal distance from the object's middle, metres.
        other_than: name of an object whose burner it must not be.
    """

    object: str
    fixture: str
    burner: str = ""
    lit: bool | None = None
    within: float = ON_BURNER_M
    other_than: str = ""

    @property
    def name(self) -> str:
        """E.g. `pan_on_burner`, `pan_on_lit_knob`, `pan_on_burner_without_pot`."""
        light = {True: "lit_", False: "unlit_", None: ""}[self.lit]
        without = f"_without_{plain(self.other_than)}" if self.other_than else ""
        return f"{plain(self.object)}_on_{light}{plain(self.burner) or 'burner'}{without}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Find the burner, then look at its knob, at contacts and at the other object's burner."""
        name, hob = scene.fill(self.object), scene.fixture(self.fixture, Hob)
        burner = self._burner_of(scene, data, name)
        if burner is None or (self.burner and burner != scene.fill(self.burner)):
            return False
        if self.lit is not None and (hob.burner_level(data, burner) != "off") != self.lit:
            return False
        if self.other_than and burner == self._burner_of(scene, data, scene.fill(self.other_than)):
            return False
        return touching(scene.model, data, scene.subtree(name), scene.subtree(hob.name))

    def _burner_of(self, scene: Scene, data: mujoco.MjData, name: str) -> str | None:
        hob = scene.fixture(self.fixture, Hob)
        burner, apart = hob.nearest_burner(data, middle_of(scene, data, name))
        # Below it is the oven.
        above = data.body(name).xpos[2] > data.site(f"{hob.name}_burner_on_{burner}").xpos[2]
        return burner if above and apart < self.within else None
