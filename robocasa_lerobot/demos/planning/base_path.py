"""Paths of the base: A* on a grid of poses, round the fixtures, and round doors and drawers as they stand now.

The base can move to all sides, so a path keeps one heading where it can: it turns at the start, on the way, or at the
end, whichever has room. Every grid pose is tested twice: with the fixtures' footprints, as start poses are, and with
the shapes of the robot, its arm as it is and what it holds, against the kitchen's in their present state.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array, base_pose
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, Touched
from robocasa_lerobot.demos.planning.errors import NoPlanError
from robocasa_lerobot.envs.scene.robot_poses import Obstacles, RobotPose
from robocasa_lerobot.envs.scene.scene import Scene

CELL_M = 0.10
HEADINGS = 8
TURN_COST_M = 0.30  # of one heading to the next
# A goal that touches something is exchanged for the nearest free pose up to this far away.
SHIFT_M, SHIFT_STEP_M = 0.18, 0.03
STEP_M, STEP_RAD = 0.05, 0.1  # between tested poses of a straight move
MARGINS_M = (0.02, 0.0)  # kept from what stands around, or, where there is no path then, the next
# From the start, within which what is touched there already may still be touched; and from the goal.
LEAVING_M, COMING_M = 0.15, 0.20
MOST_CELLS = 20_000  # that are looked at
_NEIGHBOURS = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]

type _Cell = tuple[int, int, int]

_obstacles: WeakKeyDictionary[mujoco.MjModel, Obstacles] = WeakKeyDictionary()


def find_path(
    scene: Scene,
    data: mujoco.MjData | None,
    start: RobotPose,
    goal: RobotPose,
    held: Held | None = None,
    joints: Array | None = None,
) -> list[RobotPose]:
    """Poses from a start to a goal, both left out but the goal, all of them free: the shortest path by A*.

    Args:
        scene: of the kitchen.
        data: its present state; None asks the fixtures' footprints alone, with all doors shut.
        start: where the base centre stands.
        goal: where it is to stand; a pose that touches something is exchanged for a free one near it.
        held: what is in the gripper.
        joints: (7,) of the arm on the way, radians; None takes those it has.

    Raises:
        NoPlanError: there is none.
    """
    footprints, path = Room(scene), None
    for margin in MARGINS_M if data is not None else ():
        path = path or _search(Space(footprints, data, start, goal, held, joints, margin), start, goal)
    if path is None:  # without a state, or where the arm already touches something wherever it goes
        path = _search(footprints, start, goal)
    if path is None:
        raise NoPlanError(f"no way for the base from ({start.x:.2f}, {start.y:.2f}) to ({goal.x:.2f}, {goal.y:.2f})")
    return path


class Room:
    """Answers whether the robot can stand at poses, asking the fixtures' footprints."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        if scene.model not in _obstacles:
            fixtures = {name: fixture for name, fixture in scene.fixtures.items() if name != "floor"}
            _obstacles[scene.model] = Obstacles(fixtures, scene.robot.shape)
        self._obstacles = _obstacles[scene.model]

    def free(self, pose: RobotPose) -> bool:
        """Whether nothing is touched, inside of the walls."""
        return bool(self.all_free([pose])[0])

    def all_free(self, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
        """The same of N poses, (N,)."""
        if not poses:
            return np.zeros(0, dtype=np.bool_)
        x, y = np.array([(pose.x, pose.y) for pose in poses]).T
        bounds = self.scene.layout.room
        inside = (bounds["x_min"] < x) & (x < bounds["x_max"]) & (bounds["y_min"] < y) & (y < 0.0)
        return inside & self._obstacles.leave_free(poses)

    def nearest(self, goal: RobotPose) -> RobotPose:
        """The goal, or the free pose of the same heading that is nearest to it, or the goal if there is none."""
        if self.free(goal):
            return goal
        reach = np.arange(-SHIFT_M, SHIFT_M + 1e-9, SHIFT_STEP_M)
        shifts = sorted(((float(x), float(y)) for x in reach for y in reach), key=lambda shift: np.hypot(*shift))
        near = [RobotPose(goal.x + x, goal.y + y, goal.yaw) for x, y in shifts if np.hypot(x, y) <= SHIFT_M]
        found = np.flatnonzero(self.all_free(near))
        return near[int(found[0])] if len(found) else goal

    def straight(self, start: RobotPose, goal: RobotPose) -> bool:
        """Whether the robot can move and turn at once from one pose to another."""
        turn = wrap(goal.yaw - start.yaw)
        length = float(np.hypot(goal.x - start.x, goal.y - start.y))
        steps = int(np.ceil(max(length / STEP_M, abs(turn) / STEP_RAD, 1.0)))
        between = [
            RobotPose(start.x + (goal.x - start.x) * t, start.y + (goal.y - start.y) * t, start.yaw + turn * t)
            for t in (np.arange(1, steps) / steps).tolist()
        ]
        return bool(self.all_free(between).all())


class Space(Room):
    """The same, and the robot's shapes against those of the kitchen as it is now.

    Args:
        room: footprints.
        data: present state.
        start: where the base stands; what is touched there is no obstacle near it.
        goal: where it is to stand.
        held: what is in the gripper.
        joints: (7,) of the arm on the way, radians; None takes those it has.
        margin_m: kept from what stands around.
    """

    def __init__(
        self,
        room: Room,
        data: mujoco.MjData,
        start: RobotPose,
        goal: RobotPose,
        held: Held | None,
        joints: Array | None,
        margin_m: float,
    ) -> None:
        super().__init__(room.scene)
        self._checker = CollisionChecker(room.scene.model, data)
        self._held, self._margin = held, margin_m
        self._joints = self._checker.present_joints if joints is None else joints
        self._start, self._goal = start, goal
        self._leaning = self._touched([start], 8, 0.0).all()

    def all_free(self, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
        """Whether nothing is touched, inside of the walls; poses near the start may touch what the start does.

        Near the start and the goal no margin is kept: robots stand close to what they work on.
        """
        free = super().all_free(poses)
        places = np.flatnonzero(free)
        if not len(places):
            return free
        at = np.array([(poses[index].x, poses[index].y) for index in places])
        leaving = np.hypot(*(at - [self._start.x, self._start.y]).T) < LEAVING_M
        coming = np.hypot(*(at - [self._goal.x, self._goal.y]).T) < COMING_M
        for close in (False, True):
            mine = places[(leaving | coming) == close]
            if not len(mine):
                continue
            found = self._touched([poses[index] for index in mine], 8 if close else 1, 0.0 if close else self._margin)
            for index, count, bodies in zip(mine, found.counts, found.bodies, strict=True):
                touched = frozenset(bodies[:count].tolist())
                left = np.hypot(poses[index].x - self._start.x, poses[index].y - self._start.y) < LEAVING_M
                free[index] = not (touched - self._leaning if left else touched)
        return free

    def _touched(self, poses: Sequence[RobotPose], most: int, margin_m: float) -> Touched:
        bases = np.array([(pose.x, pose.y, pose.yaw) for pose in poses])
        return self._checker.touched(bases, self._joints, held=self._held, margin_m=margin_m, most=most)


def carried(scene: Scene, data: mujoco.MjData) -> Held | None:
    """The task's object that both fingers touch, if there is one."""
    model = scene.model
    fingers = [model.body(name).id for name in ("gripper0_right_leftfinger", "gripper0_right_rightfinger")]
    pairs = model.geom_bodyid[data.contact.geom] if data.ncon else np.zeros((0, 2), dtype=int)
    sides = [
        np.array([_below(model, int(body), finger) for body in pairs.reshape(-1)], dtype=bool) for finger in fingers
    ]
    for name in scene.objects:
        body = model.body(name).id
        mine = (pairs == body).reshape(-1, 2)[:, ::-1].reshape(-1) if len(pairs) else np.zeros(0, dtype=bool)
        if all(bool((side & mine).any()) for side in sides):
            return Held.now(data, name)
    return None


def _below(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > root:
        body = int(model.body_parentid[body])
    return body == root


def _search(room: Room, start: RobotPose, goal: RobotPose) -> list[RobotPose] | None:
    goal = room.nearest(goal)
    if room.straight(start, goal):
        return [goal]
    grid = _Grid(room, start, goal)
    cells = grid.search()
    return None if cells is None else [*(grid.pose(cell) for cell in cells[1:]), goal]


@dataclass
class _Grid:
    """Cells (i, j, k) of places and headings, counted from the goal's pose."""

    room: Room
    start: RobotPose
    goal: RobotPose

    def __post_init__(self) -> None:
        self._known: dict[tuple[float, float, float], bool] = {}

    def pose(self, cell: tuple[float, float, float]) -> RobotPose:
        """The middle of a cell, or between two."""
        i, j, k = cell
        return RobotPose(
            self.goal.x + i * CELL_M, self.goal.y + j * CELL_M, wrap(self.goal.yaw + k * 2 * np.pi / HEADINGS)
        )

    def first(self) -> _Cell:
        """The cell of the start."""
        turn = wrap(self.start.yaw - self.goal.yaw)
        return (
            round((self.start.x - self.goal.x) / CELL_M),
            round((self.start.y - self.goal.y) / CELL_M),
            round(turn / (2 * np.pi) * HEADINGS) % HEADINGS,
        )

    def search(self) -> list[_Cell] | None:
        """Cells from the start's to the goal's, or None; the start's own surroundings count as free."""
        first = self.first()
        cost: dict[_Cell, float] = {first: 0.0}
        came: dict[_Cell, _Cell] = {}
        queue = [(self._ahead(first), first)]
        done: set[_Cell] = set()
        while queue and len(done) < MOST_CELLS:
            _, cell = heapq.heappop(queue)
            if cell == (0, 0, 0):
                path = [cell]
                while path[-1] in came:
                    path.append(came[path[-1]])
                return path[::-1]
            if cell in done:
                continue
            done.add(cell)
            around = list(self._neighbours(cell))
            self._look(cell, [other for other, _ in around])
            for other, length in around:
                new = cost[cell] + length
                if new < cost.get(other, np.inf) and self._is_free(cell, other):
                    cost[other], came[other] = new, cell
                    heapq.heappush(queue, (new + self._ahead(other), other))
        return None

    def _ahead(self, cell: _Cell) -> float:
        i, j, k = cell
        return float(np.hypot(i, j)) * CELL_M + min(k, HEADINGS - k) * TURN_COST_M

    def _neighbours(self, cell: _Cell) -> Iterator[tuple[_Cell, float]]:
        i, j, k = cell
        for x, y in _NEIGHBOURS:
            yield (i + x, j + y, k), CELL_M * float(np.hypot(x, y))
        for turn in (-1, 1):
            yield (i, j, (k + turn) % HEADINGS), TURN_COST_M

    def _look(self, before: _Cell, cells: Sequence[_Cell]) -> None:
        """Test cells, and the way there where it leads across a corner or turns, all at once."""
        wanted: list[tuple[float, float, float]] = [*cells, *(_middle(before, cell) for cell in cells)]
        new = [cell for cell in dict.fromkeys(wanted) if cell not in self._known]
        free = self.room.all_free([self.pose(cell) for cell in new])
        self._known.update(zip(new, free.tolist(), strict=True))
        self._known[0, 0, 0] = True

    def _is_free(self, before: _Cell, cell: _Cell) -> bool:
        return self._known[cell] and self._known[_middle(before, cell)]


def _middle(before: _Cell, cell: _Cell) -> tuple[float, float, float]:
    """Between two cells that lie across a corner or have other headings; the second one where they lie side by side."""
    (i, j, k), (x, y, turned) = before, cell
    if k == turned:
        return ((i + x) / 2, (j + y) / 2, k) if i != x and j != y else cell
    low, high = sorted((k, turned))
    return (x, y, high + 0.5 if (low, high) == (0, HEADINGS - 1) else low + 0.5)


def base_now(data: mujoco.MjData) -> RobotPose:
    """Where the base centre stands."""
    position, yaw = base_pose(data)
    return RobotPose(float(position[0]), float(position[1]), yaw)


def wrap(angle: float) -> float:
    """The same angle between -pi and pi, radians."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
