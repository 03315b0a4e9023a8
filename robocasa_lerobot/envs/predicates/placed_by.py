"""Conditions on where objects are by a fixture, or beside another one as seen from it, and on how they are turned.

Lengths in metres.
"""

from __future__ import annotations

import itertools
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
_SIDES = {"right": (1.0, 0.0, 0.0), "left": (-1.0, 0.0, 0.0), "front": (0.0, -1.0, 0.0), "back": (0.0, 1.0, 0.0)}


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
class BeforeStools(Term):
    """Objects are before stools, each before one of its own.

    Attributes:
        objects: names.
        across: bound of the distance of an object's origin from the stool's middle to the sides, not allowed itself.
        along: bound of that to the front, as somebody looks who sits there, or to the back.
    """

    objects: tuple[str, ...]
    across: float
    along: float

    @property
    def name(self) -> str:
        """E.g. `bowl1_and_bowl2_before_stools`."""
        return plain(f"{'_and_'.join(self.objects)}_before_stools")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look for stools that the objects can be shared out among."""
        stools = scene.layout.of_type(_SEAT)
        origins = [data.body(scene.fill(name)).xpos for name in self.objects]
        return any(
            all(self._is_before(stool, origin) for stool, origin in zip(some, origins, strict=True))
            for some in itertools.permutations(stools, len(origins))
        )

    def _is_before(self, stool: Fixture, origin: NDArray[np.float64]) -> bool:
        across, along, _ = np.abs(_seen_from(stool, origin))
        return bool(across < self.across and along < self.along)


@dataclass(frozen=True)
class HandlePoints(Term):
    """The handle of a vessel points to a side of a fixture, as seen by who stands before it.

    Attributes:
        object: name.
        fixture: role.
        to: "right", "left", "front" or "back".
        within: bound of the angle between the two, radians.
    """

    object: str
    fixture: str
    to: str
    within: float

    @property
    def name(self) -> str:
        """E.g. `mug_handle_to_right_of_cabinet`."""
        return plain(f"{self.object}_handle_to_{self.to}_of_{self.fixture}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the angle with the bound."""
        return self.off(scene, data.body(scene.fill(self.object)).xmat.reshape(3, 3)) <= self.within

    def off(self, scene: Scene, turn: NDArray[np.float64]) -> float:
        """Angle between the side and the handle of the object if it is turned so, (3, 3), radians."""
        handle = _seen_from_afar(scene.fixture(self.fixture), turn @ handle_direction(scene, scene.fill(self.object)))
        long = float(np.hypot(handle[0], handle[1]))
        return float(np.arccos(np.clip(handle @ np.array(_SIDES[self.to]) / max(long, 1e-9), -1.0, 1.0)))


@dataclass(frozen=True)
class Behind(Term):
    """An object is farther from the front of a fixture than another one, as seen by who stands before that.

    Attributes:
        object, other: names.
        fixture: role.
        by: bound of the distance of the origins to the back, which is not allowed itself.
    """

    object: str
    other: str
    fixture: str
    by: float = 0.0

    @property
    def name(self) -> str:
        """E.g. `new_can_behind_old_can`."""
        return plain(f"{self.object}_behind_{self.other}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the distance with the bound."""
        origins = (data.body(scene.fill(name)).xpos for name in (self.object, self.other))
        first, second = (_seen_from(scene.fixture(self.fixture), origin) for origin in origins)
        return float((first - second)[1]) > self.by


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


def handle_direction(scene: Scene, name: str) -> NDArray[np.float64]:
    """Unit vector (3,) from the middle of a vessel to its handle, in its own axes."""
    inside = scene.objects[name].item.interior
    assert inside is not None, f"{name} is no vessel"
    away = np.array([-inside.center[0], -inside.center[1], 0.0])
    unit: NDArray[np.float64] = away / np.linalg.norm(away)
    return unit


def _seen_from(fixture: Fixture, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the room, (..., 3), along the axes of a fixture: to its right, to its back, up; from its middle."""
    return _seen_from_afar(fixture, points - np.asarray(fixture.pos))


def _seen_from_afar(fixture: Fixture, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors of the room, (..., 3), along the axes of a fixture."""
    c, s = np.cos(fixture.yaw), np.sin(fixture.yaw)
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    local: NDArray[np.float64] = vectors @ axes
    return local
