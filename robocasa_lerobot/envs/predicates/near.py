"""Conditions on distances between objects. Lengths in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robocasa_lerobot.envs.predicates.logic import Term, plain
from robocasa_lerobot.envs.predicates.objects import radius

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

type Names = str | tuple[str, ...]


@dataclass(frozen=True)
class Near(Term):
    """An object's origin is near that of another object, or of one of several.

    Attributes:
        object: name.
        other: name, or several.
        within: bound of the distance, allowed itself.
        in_space: measure in three dimensions; else horizontally.
        from_edge: measure from the other's horizontal radius instead of from its origin.
    """

    object: str
    other: Names
    within: float
    in_space: bool = False
    from_edge: bool = False

    @property
    def name(self) -> str:
        """E.g. `obj_near_cup`, `bottle_near_plastic1_or_plastic2`."""
        return f"{plain(self.object)}_near_{plain('_or_'.join(_several(self.other)))}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the least distance with the bound."""
        return min(self._apart(scene, data, scene.fill(other)) for other in _several(self.other)) <= self.within

    def _apart(self, scene: Scene, data: mujoco.MjData, other: str) -> float:
        distance = _distance(data, scene.fill(self.object), other, axes=3 if self.in_space else 2)
        return distance - radius(scene, other) if self.from_edge else distance


@dataclass(frozen=True)
class NearerThan(Term):
    """Objects are nearer to some objects than to others: the farthest of the former is nearer than that of the latter.

    Attributes:
        objects: name, or several; distances are those between any of them and any of the others, in space.
        to: name, or several, that are near; a distance to itself does not count.
        than: name, or several, that are farther away.
        factor: how many times the near distance must still be less than the far one.
    """

    objects: Names
    to: Names
    than: Names
    factor: float = 1.0

    @property
    def name(self) -> str:
        """E.g. `can_nearer_to_left_can_than_right_can`."""
        objects, to, than = ("_and_".join(_several(names)) for names in (self.objects, self.to, self.than))
        return plain(f"{objects}_nearer_to_{to}_than_{than}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the largest distances."""
        return self.factor * self._farthest(scene, data, self.to) < self._farthest(scene, data, self.than)

    def _farthest(self, scene: Scene, data: mujoco.MjData, others: Names) -> float:
        pairs = ((scene.fill(a), scene.fill(b)) for a in _several(self.objects) for b in _several(others) if a != b)
        return max(_distance(data, a, b, axes=3) for a, b in pairs)


@dataclass(frozen=True)
class OnOneSide(Term):
    """Objects are all to the left of another one, or all to its right, as seen by who stands before a fixture.

    Attributes:
        objects: names.
        of: name.
        fixture: role.
        apart: least distance across, metres.
    """

    objects: tuple[str, ...]
    of: str
    fixture: str
    apart: float = 0.0

    @property
    def name(self) -> str:
        """E.g. `cup1_and_cup2_on_one_side_of_bowl`."""
        return plain(f"{'_and_'.join(self.objects)}_on_one_side_of_{self.of}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the origins across the fixture."""
        yaw = scene.fixture(self.fixture).yaw
        across = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        other = data.body(scene.fill(self.of)).xpos
        aside = [float(across @ (data.body(scene.fill(name)).xpos - other)) for name in self.objects]
        return min(aside) > self.apart or max(aside) < -self.apart


def _several(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else names


def _distance(data: mujoco.MjData, first: str, second: str, axes: int) -> float:
    return float(np.linalg.norm((data.body(first).xpos - data.body(second).xpos)[:axes]))
