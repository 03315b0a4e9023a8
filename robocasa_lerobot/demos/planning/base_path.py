"""Paths of the base: A* on a grid of poses, round the fixtures, and round doors and drawers as they stand now.

The base can move to all sides, so a path keeps one heading where it can: it turns at the start, in between, or at the
end, whichever has room. Every grid pose is tested twice: with the fixtures' footprints, as start poses are, and with
the shapes of the robot, its arm as it is and what it holds, against the kitchen's in their present state.
"""

from __future__ import annotations

import contextlib
import functools
import heapq
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import Array, base_pose
from robocasa_lerobot.demos.planning.base_room import Room, Space, wrap
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, is_full
from robocasa_lerobot.demos.planning.errors import NoPlanError, ShutInError
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.scene.scene import Scene

__all__ = ["Room", "Space", "base_now", "carried", "find_free_path", "find_path", "search_path", "wrap"]

CELL_M = 0.10
HEADINGS = 8
TURN_COST_M = 0.30  # of one heading to the next
# Kept from what stands around, and near the start and the goal; or, where there is no path then, the next. An arm that
# carries a full vessel swings by some centimetres on the way.
type Margins = tuple[float, float]
MARGINS_M: tuple[Margins, ...] = ((0.02, 0.0), (0.0, 0.0))
HELD_MARGINS_M: tuple[Margins, ...] = ((0.08, 0.03), (0.05, 0.02), *MARGINS_M)
LOADED_MARGINS_M: tuple[Margins, ...] = ((0.05, 0.03), (0.03, 0.015), *MARGINS_M)
MOST_CELLS = 20_000  # that are looked at
# A goal from which fewer cells than these can be reached is shut in; poses near it count as others from this distance.
POCKET, APART_M = 1_500, 0.05
_NEIGHBOURS = [(x, y, CELL_M * float(np.hypot(x, y))) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]

type _Cell = tuple[int, int, int]


@dataclass(frozen=True)
class BasePath:
    """Where the base goes.

    Attributes:
        poses: from after the start to the goal.
        margin_m: kept from what stands around; less than nothing where the arm, or what it holds, may touch something.
    """

    poses: list[RobotPose]
    margin_m: float


def find_path(
    scene: Scene,
    data: mujoco.MjData | None,
    start: RobotPose,
    goal: RobotPose,
    held: Held | None = None,
    joints: Array | None = None,
) -> BasePath:
    """Poses from a start to a goal, both left out but the goal, all of them free: the shortest path by A*.

    Where there is none for the arm and what it holds, the footprint's path is better than nothing.

    Args:
        scene: of the kitchen.
        data: its present state; None asks the fixtures' footprints alone, with all doors shut.
        start: where the base centre stands.
        goal: where it is to stand; a pose that touches something is exchanged for a free one near it.
        held: the object in the gripper.
        joints: (7,) of the arm during the drive, radians; None takes those it has.

    Raises:
        NoPlanError: there is none.
    """
    if data is not None:
        margins = LOADED_MARGINS_M if is_full(held) else MARGINS_M if held is None else HELD_MARGINS_M
        with contextlib.suppress(NoPlanError):
            return find_free_path(scene, data, start, goal, held, joints, margins_m=margins)
    return BasePath(search_path(Room(scene), start, goal), -1.0)


def find_free_path(
    scene: Scene,
    data: mujoco.MjData,
    start: RobotPose,
    goal: RobotPose,
    held: Held | None = None,
    joints: Array | None = None,
    *,
    margins_m: Sequence[Margins] = MARGINS_M,
    checker: CollisionChecker | None = None,
) -> BasePath:
    """The same, but only a path on which neither the arm nor what it holds meets anything.

    Args:
        scene: as of `find_path`, like the rest.
        data: present state.
        start: where the base centre stands.
        goal: where it is to stand.
        held: what is in the gripper.
        joints: (7,) of the arm on the way, radians.
        margins_m: to keep from what stands around, or, where there is no path then, the next.
        checker: of this state, for whoever asks more than once; None makes one.

    Raises:
        NoPlanError: there is none; of the last margins, why.
    """
    checker = checker or CollisionChecker(scene, data)
    failure: NoPlanError | None = None
    for margin, close in margins_m:
        try:
            space = Space(scene, checker, start, goal, held, joints, margin, close)
            return BasePath(search_path(space, start, goal), margin)
        except NoPlanError as error:
            failure = error
    assert failure is not None, "no margins"
    raise failure


def _no_path(start: RobotPose, goal: RobotPose) -> str:
    return f"no path for the base from ({start.x:.2f}, {start.y:.2f}) to ({goal.x:.2f}, {goal.y:.2f})"


def carried(scene: Scene, data: mujoco.MjData) -> Held | None:
    """The task's object that both fingers touch, if there is one."""
    model = scene.model
    pairs = model.geom_bodyid[data.contact.geom] if data.ncon else np.zeros((0, 2), dtype=int)
    sides = [finger[pairs.reshape(-1)] for finger in scene.fingers()]
    for name in scene.objects:
        body = model.body(name).id
        mine = (pairs == body).reshape(-1, 2)[:, ::-1].reshape(-1) if len(pairs) else np.zeros(0, dtype=bool)
        if all(bool((side & mine).any()) for side in sides):
            return Held.now(data, name)
    return None


def search_path(room: Room, start: RobotPose, goal: RobotPose) -> list[RobotPose]:
    """The shortest path to the first of the goal and the free poses near it that is not shut in.

    Raises:
        ShutInError: all of them are.
        NoPlanError: there is no path to that one.
    """
    for end in _ends(room, goal):
        if room.straight(start, end):
            return [end]
        grid = _Grid(room, start, end)
        if grid.is_shut_in():
            continue
        cells = grid.search()
        if cells is None:
            raise NoPlanError(_no_path(start, goal))
        return shortened(room, start, [*(grid.pose(cell) for cell in cells[1:]), end])
    raise ShutInError(_no_path(start, goal))


def shortened(room: Room, start: RobotPose, poses: Sequence[RobotPose]) -> list[RobotPose]:
    """A path with its steps from cell to cell put together to straight moves, which may turn on the way, where free."""
    places, found, here = [start, *poses], list[RobotPose](), 0
    while here < len(poses):
        there = len(poses)
        while there > here + 1 and not room.closely(places[here], places[there]):
            there = here + (there - here + 1) // 2
        found.append(places[there])
        here = there
    return found


def _ends(room: Room, goal: RobotPose) -> Iterator[RobotPose]:
    """The goal, or the free pose nearest to it, and others that lie apart from it and from each other."""
    found = [room.nearest(goal)]
    yield found[0]
    for pose in room.near(goal):
        if all(np.hypot(pose.x - other.x, pose.y - other.y) > APART_M for other in found):
            found.append(pose)
            yield pose


@dataclass
class _Grid:
    """Cells (i, j, k) of places and headings, counted from the goal's pose."""

    room: Room
    start: RobotPose
    goal: RobotPose

    def __post_init__(self) -> None:
        self._known: dict[tuple[float, float, float], bool] = {}
        self._yaws: dict[float, float] = {}
        self._first = self.first()

    def pose(self, cell: tuple[float, float, float]) -> RobotPose:
        """The middle of a cell, or between two."""
        return RobotPose(*self._row(cell))

    def _row(self, cell: tuple[float, float, float]) -> tuple[float, float, float]:
        i, j, k = cell
        if k not in self._yaws:
            self._yaws[k] = wrap(self.goal.yaw + k * 2 * np.pi / HEADINGS)
        return self.goal.x + i * CELL_M, self.goal.y + j * CELL_M, self._yaws[k]

    def first(self) -> _Cell:
        """The cell of the start."""
        turn = wrap(self.start.yaw - self.goal.yaw)
        return (
            round((self.start.x - self.goal.x) / CELL_M),
            round((self.start.y - self.goal.y) / CELL_M),
            round(turn / (2 * np.pi) * HEADINGS) % HEADINGS,
        )

    def search(self) -> list[_Cell] | None:
        """Cells from the start's to the goal's, or None; the start's own surroundings count as free.

        A move between cells is tested closely when it would come next, which few of them do.
        """
        first, number = self._first, itertools.count()
        queue = [(_ahead(first), first, next(number), 0.0, first)]
        came: dict[_Cell, _Cell] = {}
        while queue and len(came) < MOST_CELLS:
            _, cell, _, cost, before = heapq.heappop(queue)
            if cell in came or not self._is_clear(before, cell):
                continue
            came[cell] = before
            if cell == (0, 0, 0):
                path = [cell]
                while path[-1] != first:
                    path.append(came[path[-1]])
                return path[::-1]
            for other, length in self._free_around(cell):
                if other not in came:
                    new = cost + length
                    heapq.heappush(queue, (new + _ahead(other), other, next(number), new, cell))
        return None

    def _is_clear(self, before: _Cell, cell: _Cell) -> bool:
        """Whether a move is free in between, where a margin is to be kept; the first one begins where the base is."""
        if before == cell or self.room.margin_m <= 0.0:
            return True
        if before == self._first:
            return not self.room.free(self.start) or self.room.closely(self.start, self.pose(cell))
        return self.room.closely(self.pose(before), self.pose(cell))

    def is_shut_in(self) -> bool:
        """Whether all that can be reached from the goal is a pocket of less than `POCKET` cells without the start."""
        goal = (0, 0, 0)
        found, queue = {goal}, [goal]
        while queue and len(found) < POCKET:
            cell = queue.pop()
            if cell == self._first:
                return False
            new = [other for other, _ in self._free_around(cell) if other not in found]
            found.update(new)
            queue += new
        return not queue

    def _free_around(self, cell: _Cell) -> list[tuple[_Cell, float]]:
        """The neighbours that are free, with the move there where it leads across a corner or turns; and how far."""
        around = _neighbours(cell)
        known = self._known
        new = [place for step in around for place in step[:2] if place not in known]
        if new:
            new = list(dict.fromkeys(new))
            free = self.room.free_at(np.array([self._row(place) for place in new]))
            known.update(zip(new, free.tolist(), strict=True))
            known[0, 0, 0] = True
        return [(other, length) for other, middle, length in around if known[other] and known[middle]]


def _neighbours(cell: _Cell) -> list[tuple[_Cell, tuple[float, float, float], float]]:
    """The cells beside one, what lies between (the other itself where they are side by side), and how far they are."""
    i, j, k = cell
    found: list[tuple[_Cell, tuple[float, float, float], float]] = []
    for x, y, length in _NEIGHBOURS:
        other = (i + x, j + y, k)
        found.append((other, (i + x / 2, j + y / 2, k) if x and y else other, length))
    for turn in (-1, 1):
        other = (i, j, (k + turn) % HEADINGS)
        low, high = sorted((k, other[2]))
        found.append((other, (i, j, high + 0.5 if (low, high) == (0, HEADINGS - 1) else low + 0.5), TURN_COST_M))
    return found


def _ahead(cell: _Cell) -> float:
    """The least that a path from a cell to the goal's can cost."""
    i, j, k = cell
    return _apart(i, j) + min(k, HEADINGS - k) * TURN_COST_M


@functools.lru_cache(maxsize=100_000)
def _apart(i: int, j: int) -> float:
    return float(np.hypot(i, j)) * CELL_M


def base_now(data: mujoco.MjData) -> RobotPose:
    """Where the base centre stands."""
    position, yaw = base_pose(data)
    return RobotPose(float(position[0]), float(position[1]), yaw)
