"""Placing objects on surfaces: rejection sampling of footprints that do not overlap, with the generator passed in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.footprint_kernel import clear, overlapping

MAX_SAMPLES = 5000  # draws for an object before the scene is given up (docs/robocasa.md, section 6)
FEW_SAMPLES = 32  # of these, one by one: nearly always enough; the others are drawn together, much faster
MAX_YAW_RAD = np.pi / 4  # of the default rotation range, to either side

_CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])


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
        return np.array([self.x, self.y]) + (_CORNERS * self.half) @ self.axes()

    def overlaps(self, other: Footprint, margin: float = 0.0) -> bool:
        """Whether two rectangles come closer than `margin` metres (separating axis test)."""
        a, b = self.corners(), other.corners()
        for axis in np.vstack([self.axes(), other.axes()]):
            along_a, along_b = a @ axis, b @ axis
            if along_a.max() + margin < along_b.min() or along_b.max() + margin < along_a.min():
                return False
        return True

    def distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far n points of the floor plan, (n, 2), are from the rectangle, metres, (n,); 0 of those in it."""
        beyond = np.maximum(np.abs((points - (self.x, self.y)) @ self.axes().T) - self.half, 0.0)
        found: NDArray[np.float64] = np.hypot(beyond[:, 0], beyond[:, 1])
        return found

    def gap(self, other: Footprint) -> float:
        """Metres between two rectangles: none where they overlap, else from a corner of either to the other one."""
        if self.overlaps(other):
            return 0.0
        return float(min(self.distances(other.corners()).min(), other.distances(self.corners()).min()))


class Footprints:
    """Several footprints, asked at once whether others come near: for searches with thousands of questions."""

    def __init__(self, marks: Sequence[Footprint]) -> None:
        # As `Footprint.axes` and `corners`, for all at once.
        yaws = np.array([mark.yaw for mark in marks], dtype=np.float64)
        middles = np.array([(mark.x, mark.y) for mark in marks], dtype=np.float64).reshape(-1, 1, 2)
        halves = np.array([mark.half for mark in marks], dtype=np.float64).reshape(-1, 1, 2)
        cos, sin = np.cos(yaws), np.sin(yaws)
        self.axes = np.stack((cos, sin, -sin, cos), axis=1).reshape(-1, 2, 2)
        self.corners = middles + (_CORNERS * halves) @ self.axes
        own = self.corners @ self.axes.transpose(0, 2, 1)
        self.low, self.high = own.min(axis=1), own.max(axis=1)
        self.middles, self.reaches = middles[:, 0], np.hypot(halves[:, 0, 0], halves[:, 0, 1])

    def overlapping(
        self, places: NDArray[np.float64], half: tuple[float, float], margin: float = 0.0
    ) -> NDArray[np.bool_]:
        """Which of n footprints overlap one of these, as in `Footprint.overlaps`; shape (n,).

        `places` are their middles (metres) and yaws, shape (n, 3); `half` are the half sizes of all of them.
        """
        return overlapping(places, half, self.corners, self.axes, self.low, self.high, margin)


@dataclass(frozen=True)
class Part:
    """A rectangle of something that stands at a pose, and what it must not meet.

    Attributes:
        ahead: of the pose, where its middle is, metres.
        half: its half sizes along and across the heading, metres.
        marks: that must not come near it.
        margin: metres.
    """

    ahead: float
    half: tuple[float, float]
    marks: Footprints
    margin: float = 0.0


class Standing:
    """Rectangles that go together, asked at once whether there is room for all: a base's path asks 10,000 times."""

    def __init__(self, parts: Sequence[Part]) -> None:
        sets = [part.marks for part in parts]
        self._shapes = np.array([(part.ahead, *part.half, part.margin) for part in parts])
        self._starts = np.cumsum([0, *(len(marks.reaches) for marks in sets)])
        self._marks = tuple(
            np.concatenate(arrays)
            for arrays in zip(*((m.corners, m.axes, m.low, m.high, m.middles, m.reaches) for m in sets), strict=True)
        )

    def clear(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """At which of n poses (x, y in metres and yaw), (n, 3), none of them meets anything; shape (n,)."""
        return clear(poses, self._shapes, self._starts, *self._marks)


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
        rotation: bounds of the turn of the placed object, radians.
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
        self,
        rng: np.random.Generator,
        half: tuple[float, float],
        middle: tuple[float, float] = (0.0, 0.0),
        count: int = 1,
    ) -> NDArray[np.float64]:
        """Places (x, y in metres and yaw, in the room) of `count` footprints of half sizes `half`, shape (count, 3).

        Their corners lie in the area where it is large enough, else they are at its centre. If only middles must lie
        in it, `middle` is what counts as such, in the footprint's own frame, metres: a pan stands with its round part
        over the burner, whatever the length of its handle.
        """
        yaw = rng.uniform(*self.rotation, size=count)
        c, s = abs(np.cos(yaw)), abs(np.sin(yaw))
        reach = (c * half[0] + s * half[1], s * half[0] + c * half[1]) if self.inside else (0.0 * yaw, 0.0 * yaw)
        x = _uniform_inside(rng, self.x0, self.x1, reach[0])
        y = _uniform_inside(rng, self.y0, self.y1, reach[1])
        if not self.inside:
            x = x - (np.cos(yaw) * middle[0] - np.sin(yaw) * middle[1])
            y = y - (np.sin(yaw) * middle[0] + np.cos(yaw) * middle[1])
        return np.column_stack([self._in_room(x, y), self.yaw + yaw])

    def to_room(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the fixture's frame is in the room, metres."""
        room_x, room_y = self._in_room(np.array([x]), np.array([y]))[0].tolist()
        return room_x, room_y

    def _in_room(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where n points of the fixture's frame are in the room, metres, (n, 2)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.stack((self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y), axis=1)

    def holds(self, footprint: Footprint) -> bool:
        """Whether all corners of a footprint lie in the rectangle."""
        x, y = self._in_own_frame(footprint)
        return bool(self.x0 <= x.min() and x.max() <= self.x1 and self.y0 <= y.min() and y.max() <= self.y1)

    def pushed_in(self, footprint: Footprint) -> Footprint | None:
        """A footprint shifted by as little as brings all its corners into the rectangle; None if it is too large."""
        x, y = self._in_own_frame(footprint)
        shifts = []
        for along, low, high in ((x, self.x0, self.x1), (y, self.y0, self.y1)):
            if along.max() - along.min() > high - low:
                return None
            shifts.append(max(low - along.min(), 0.0) + min(high - along.max(), 0.0))
        axes = Footprint(0.0, 0.0, self.yaw, (0.0, 0.0)).axes()
        shift_x, shift_y = (np.array(shifts) @ axes).tolist()
        return replace(footprint, x=footprint.x + shift_x, y=footprint.y + shift_y)

    def _in_own_frame(self, footprint: Footprint) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The corners of a footprint in the fixture's frame, x and y, metres."""
        axes = Footprint(0.0, 0.0, self.yaw, (0.0, 0.0)).axes()
        x, y = ((footprint.corners() - self.origin) @ axes.T).T
        return x, y

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
        points = self._in_room(np.repeat(xs, grid), np.tile(ys, grid))
        free = np.ones(len(points), dtype=bool)
        for other in occupied:
            local = np.abs((points - (other.x, other.y)) @ other.axes().T)
            free &= (local > other.half).any(axis=1)
        return self.extent * float(free.mean())


def _uniform_inside(
    rng: np.random.Generator, low: float, high: float, reach: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Between two bounds, `reach` away from both, and midway where that leaves nothing."""
    first, last = low + reach, high - reach
    if (last <= first).all():
        return np.full(len(reach), (low + high) / 2)
    return np.where(last <= first, (low + high) / 2, first + (last - first) * rng.random(len(reach)))


def place(
    rng: np.random.Generator,
    areas: list[Area],
    half: tuple[float, float],
    occupied: list[Footprint] | Callable[[Area], list[Footprint]],
    margin: float = 0.01,
    what: str = "a footprint",
    middle: tuple[float, float] = (0.0, 0.0),
) -> tuple[Footprint, Area]:
    """Find a footprint in one of the areas that keeps `margin` metres from those occupied; `middle` as in `sample`.

    Obstacles may differ from area to area: shelves lie over each other.

    Raises:
        PlacementError: none found in 5000 draws; it names `what`, the region, its free area and three remedies.
    """
    aside = float(np.hypot(*middle))
    taken = [occupied(area) if callable(occupied) else occupied for area in areas]
    pairs = list(zip(areas, taken, strict=True))
    near = [Footprints(_neighbours(area, half, marks, margin + aside)) for area, marks in pairs]
    for count in (*[1] * FEW_SAMPLES, MAX_SAMPLES - FEW_SAMPLES):
        which = rng.integers(len(areas), size=count)
        places, free = np.empty((count, 3)), np.empty(count, dtype=bool)
        for index in np.unique(which).tolist():
            mine = which == index
            places[mine] = areas[index].sample(rng, half, middle, int(mine.sum()))
            free[mine] = ~near[index].overlapping(places[mine], half, margin)
        if free.any():
            first = int(np.argmax(free))
            x, y, yaw = places[first].tolist()
            return Footprint(x, y, yaw, half), areas[int(which[first])]
    left = sum(area.free_extent(marks) for area, marks in pairs)
    names = ", ".join(dict.fromkeys(area.name for area in areas))
    raise PlacementError(
        f"no free place for {what} of {half[0] * 2:.2f} x {half[1] * 2:.2f} m on {names}: {left:.3f} of "
        f"{sum(area.extent for area in areas):.3f} m2 are free. Ask for a larger region, for fewer or smaller "
        "objects there, or for another fixture."
    )


def _neighbours(area: Area, half: tuple[float, float], occupied: list[Footprint], margin: float) -> list[Footprint]:
    """Footprints that one in the area can come near to."""
    middle = area.middle
    reach = np.hypot(area.x1 - area.x0, area.y1 - area.y0) / 2 + np.hypot(*half) + margin
    return [o for o in occupied if np.hypot(o.x - middle[0], o.y - middle[1]) <= reach + np.hypot(*o.half)]
