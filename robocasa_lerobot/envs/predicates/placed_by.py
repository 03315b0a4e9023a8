"""Conditions on where objects are by a fixture, or beside another one as seen from it. Lengths in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.logic import Term, plain
from robocasa_lerobot.envs.predicates.objects import object_corners, radius

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

_SEAT = "stool"  # type of fixtures that somebody sits on


@dataclass(frozen=True)
class NearFixture(Term):
    """An object is near a fixture.

    Attributes:
        object: name.
        fixture: role.
        within: bound of the distance, allowed itself.
        to_corner: measure from the object's origin to the nearest corner of the fixture's outer box; else the gap
            between the two bounding boxes along the fixture's axes, 0 where they overlap.
    """

    object: str
    fixture: str
    within: float
    to_corner: bool = False

    @property
    def name(self) -> str:
        """E.g. `obj_near_stove`."""
        return plain(f"{self.object}_near_{self.fixture}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the distance with the bound."""
        fixture, name = scene.fixture(self.fixture), scene.fill(self.object)
        half = np.array([fixture.width, fixture.depth, fixture.height]) / 2
        if self.to_corner:
            apart = np.abs(_seen_from(fixture, data.body(name).xpos)) - half
        else:
            corners = _seen_from(fixture, object_corners(scene, data, name))
            apart = np.maximum(np.maximum(corners.min(axis=0) - half, -half - corners.max(axis=0)), 0.0)
        return float(np.linalg.norm(apart)) <= self.within


@dataclass(frozen=True)
class Beside(Term):
    """An object is to the left or to the right of another one, as seen by who stands before a fixture.

    A stool is one that somebody sits on, who looks to its front.

    Attributes:
        object, other: names.
        fixture: role.
        across: bound of the distance of the origins to the side, allowed itself.
        along: bound of that to the front or to the back, allowed itself.
        side: "left" or "right" of the other; either if empty. May name a choice in braces.
    """

    object: str
    other: str
    fixture: str
    across: float
    along: float
    side: str = ""

    @property
    def name(self) -> str:
        """E.g. `fork_left_of_plate`, `shaker_beside_plate`."""
        where = f"{self.side}_of" if self.side else "beside"
        return plain(f"{self.object}_{where}_{self.other}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare both distances with their bounds."""
        origins = (data.body(scene.fill(name)).xpos for name in (self.object, self.other))
        first, second = (_seen_from(scene.fixture(self.fixture), origin) for origin in origins)
        across, along = (first - second)[:2]
        if scene.layout.types[scene.fixture(self.fixture).name] == _SEAT:
            across = -across
        side = scene.fill(self.side)
        if (side == "left" and across >= 0.0) or (side == "right" and across <= 0.0):
            return False
        return abs(float(across)) <= self.across and abs(float(along)) <= self.along


@dataclass(frozen=True)
class RestsOn(Term):
    """An object stands on another one: they touch, it is over it, and higher.

    Its origin is within the other's horizontal radius of the other's origin, and all of its bounding box above that.

    Attributes:
        object, other: names.
        higher: least difference in height of the origins.
    """

    object: str
    other: str
    higher: float = 0.0

    @property
    def name(self) -> str:
        """E.g. `can1_rests_on_can2`."""
        return plain(f"{self.object}_rests_on_{self.other}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the places, then look at the contacts."""
        name, other = scene.fill(self.object), scene.fill(self.other)
        below = data.body(other).xpos
        apart = data.body(name).xpos - below
        if np.linalg.norm(apart[:2]) > radius(scene, other) or apart[2] <= self.higher:
            return False
        over = object_corners(scene, data, name)[:, 2].min() > below[2]
        return bool(over) and touching(scene.model, data, scene.subtree(name), scene.subtree(other))


@dataclass(frozen=True)
class Higher(Term):
    """An object's origin is higher than another one's, by more than half of that one's height.

    Attributes:
        object, other: names.
    """

    object: str
    other: str

    @property
    def name(self) -> str:
        """E.g. `fruit_higher_than_reamer`."""
        return plain(f"{self.object}_higher_than_{self.other}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the heights."""
        name, other = scene.fill(self.object), scene.fill(self.other)
        apart = float(data.body(name).xpos[2] - data.body(other).xpos[2])
        return apart > scene.objects[other].item.size[2] / 2


def _seen_from(fixture: Fixture, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the room, (..., 3), along the axes of a fixture: to its right, to its back, up; from its middle."""
    c, s = np.cos(fixture.yaw), np.sin(fixture.yaw)
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    local: NDArray[np.float64] = (points - np.asarray(fixture.pos)) @ axes
    return local
