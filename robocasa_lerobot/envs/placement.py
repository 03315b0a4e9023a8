"""Placing objects on surfaces: rejection sampling of footprints that do not overlap, with the generator passed in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_SAMPLES = 5000  # draws for an object before the scene is given up (robocasa facts, section 6)
MAX_YAW_RAD = np.pi / 4  # of the default rotation range, to either side


class PlacementError(RuntimeError):
    """No free place was found; the scene builder tries the whole scene again with the next draw."""


@dataclass(frozen=True)
class Footprint:
    """An oriented rectangle on the floor plan: centre (metres), yaw (radians) and half sizes (metres)."""

    x: float
    y: float
    yaw: float
    half: tuple[float, float]

    def axes(self) -> NDArray[np.float64]:
        """Unit vectors of its edges as rows, shape (2, 2)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, s], [-s, c]])

    def corners(self) -> NDArray[np.float64]:
        """Corners, shape (4, 2)."""
        signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        return np.array([self.x, self.y]) + (signs * self.half) @ self.axes()

    def overlaps(self, other: Footprint, margin: float = 0.0) -> bool:
        """Whether two rectangles come closer than `margin` metres (separating axis test)."""
        a, b = self.corners(), other.corners()
        for axis in np.vstack([self.axes(), other.axes()]):
            along_a, along_b = a @ axis, b @ axis
            if along_a.max() + margin < along_b.min() or along_b.max() + margin < along_a.min():
                return False
        return True


class Footprints:
    """Several footprints, asked at once whether another one comes near: for searches with thousands of questions."""

    def __init__(self, marks: Sequence[Footprint]) -> None:
        self._axes = np.array([mark.axes() for mark in marks]).reshape(-1, 2, 2)
        self._corners = np.array([mark.corners() for mark in marks]).reshape(-1, 4, 2)
        own = self._corners @ self._axes.transpose(0, 2, 1)
        self._low, self._high = own.min(axis=1), own.max(axis=1)

    def any_overlaps(self, other: Footprint, margin: float = 0.0) -> bool:
        """Whether one of them overlaps another footprint, as in `Footprint.overlaps`."""
        corners, axes = other.corners(), other.axes()
        ours, theirs = self._corners @ axes.T, corners @ axes.T
        apart = _apart(ours.min(axis=1), ours.max(axis=1), theirs.min(axis=0), theirs.max(axis=0), margin)
        theirs = corners @ self._axes.transpose(0, 2, 1)
        apart_too = _apart(self._low, self._high, theirs.min(axis=1), theirs.max(axis=1), margin)
        return not (apart | apart_too).all()


def _apart(
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    other_low: NDArray[np.float64],
    other_high: NDArray[np.float64],
    margin: float,
) -> NDArray[np.bool_]:
    """For each of n footprints whether one of the two axes, the last dimension, separates it from another; (n,)."""
    return np.asarray(((high + margin < other_low) | (other_high + margin < low)).any(axis=1))


@dataclass(frozen=True)
class Area:
    """A rectangle of a horizontal surface in the frame of a fixture.

    Attributes:
        x0, x1, y0, y1: bounds in the fixture's frame, metres.
        origin: of that frame in the room (x, y), metres.
        yaw: of that frame, radians.
        z: height of the surface in the room, metres.
        name: of the surface, for messages.
        height: free above it, metres.
        rotation: bounds of the turn of what is placed, radians.
        inside: whole footprints must lie in it, not their middles alone.
    """

    x0: float
    x1: float
    y0: float
    y1: float
    origin: tuple[float, float]
    yaw: float
    z: float
    name: str = "surface"
    height: float = float("inf")
    rotation: tuple[float, float] = (-MAX_YAW_RAD, MAX_YAW_RAD)
    inside: bool = True

    def sample(
        self, rng: np.random.Generator, half: tuple[float, float], middle: tuple[float, float] = (0.0, 0.0)
    ) -> Footprint:
        """A footprint of half sizes `half` whose corners lie in the area where it is large enough, else its centre.

        If only middles must lie in the area, `middle` is what counts as such, in the footprint's own frame, metres: a
        pan stands with its round part over the burner, whatever the length of its handle.
        """
        yaw = float(rng.uniform(*self.rotation))
        c, s = abs(np.cos(yaw)), abs(np.sin(yaw))
        reach_x, reach_y = (c * half[0] + s * half[1], s * half[0] + c * half[1]) if self.inside else (0.0, 0.0)
        x = _uniform_inside(rng, self.x0, self.x1, reach_x)
        y = _uniform_inside(rng, self.y0, self.y1, reach_y)
        if not self.inside:
            turned = np.array(middle) @ Footprint(0.0, 0.0, yaw, half).axes()
            x, y = x - float(turned[0]), y - float(turned[1])
        return Footprint(*self.to_room(x, y), self.yaw + yaw, half)

    def to_room(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the fixture's frame is in the room, metres."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return float(self.origin[0] + c * x - s * y), float(self.origin[1] + s * x + c * y)

    def holds(self, footprint: Footprint) -> bool:
        """Whether all corners of a footprint lie in the rectangle."""
        axes = Footprint(0.0, 0.0, self.yaw, (0.0, 0.0)).axes()
        x, y = ((footprint.corners() - self.origin) @ axes.T).T
        return bool(self.x0 <= x.min() and x.max() <= self.x1 and self.y0 <= y.min() and y.max() <= self.y1)

    @property
    def middle(self) -> tuple[float, float]:
        """In the room, metres."""
        return self.to_room((self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2)

    @property
    def extent(self) -> float:
        """Square metres."""
        return max(self.x1 - self.x0, 0.0) * max(self.y1 - self.y0, 0.0)

    def free_extent(self, occupied: list[Footprint], grid: int = 24) -> float:
        """Square metres that no footprint covers, counted on a grid."""
        xs = self.x0 + (np.arange(grid) + 0.5) * (self.x1 - self.x0) / grid
        ys = self.y0 + (np.arange(grid) + 0.5) * (self.y1 - self.y0) / grid
        points = np.array([self.to_room(x, y) for x in xs for y in ys])
        free = np.ones(len(points), dtype=bool)
        for other in occupied:
            local = np.abs((points - (other.x, other.y)) @ other.axes().T)
            free &= (local > other.half).any(axis=1)
        return self.extent * float(free.mean())


def _uniform_inside(rng: np.random.Generator, low: float, high: float, reach: float) -> float:
    if high - low <= 2 * reach:
        return (low + high) / 2
    return float(rng.uniform(low + reach, high - reach))


def place(
    rng: np.random.Generator,
    areas: list[Area],
    half: tuple[float, float],
    occupied: list[Footprint],
    margin: float = 0.01,
    what: str = "a footprint",
    middle: tuple[float, float] = (0.0, 0.0),
) -> tuple[Footprint, Area]:
    """Find a footprint in one of the areas that keeps `margin` metres from those occupied; `middle` as in `sample`.

    Raises:
        PlacementError: none found in 5000 draws; it names `what`, the region, its free area and three remedies.
    """
    aside = float(np.hypot(*middle))
    near = {id(area): _neighbours(area, half, occupied, margin + aside) for area in areas}
    for _ in range(MAX_SAMPLES):
        area = areas[int(rng.integers(len(areas)))]
        footprint = area.sample(rng, half, middle)
        if not any(footprint.overlaps(other, margin) for other in near[id(area)]):
            return footprint, area
    free = sum(area.free_extent(occupied) for area in areas)
    names = ", ".join(dict.fromkeys(area.name for area in areas))
    raise PlacementError(
        f"no free place for {what} of {half[0] * 2:.2f} x {half[1] * 2:.2f} m on {names}: {free:.3f} of "
        f"{sum(area.extent for area in areas):.3f} m2 are free. Ask for a larger region, for fewer or smaller "
        "objects there, or for another fixture."
    )


def _neighbours(area: Area, half: tuple[float, float], occupied: list[Footprint], margin: float) -> list[Footprint]:
    """Footprints that one in the area can come near to."""
    middle = area.middle
    reach = np.hypot(area.x1 - area.x0, area.y1 - area.y0) / 2 + np.hypot(*half) + margin
    return [o for o in occupied if np.hypot(o.x - middle[0], o.y - middle[1]) <= reach + np.hypot(*o.half)]
