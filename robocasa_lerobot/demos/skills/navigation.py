"""Driving the base: a way round the fixtures on a grid of poses, followed in short steps.

The base can move to all sides, so the way keeps one heading where it can: it turns at the start, on the way, or at the
end, whichever has room. Every grid pose is tested with `is_free`, the test that start poses pass.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import FROM_DESIRED, OPEN, Array, action, base_pose, limit
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, is_free
from robocasa_lerobot.envs.scene.scene import Scene

CELL_M = 0.10
HEADINGS = 8
TURN_COST_M = 0.30  # of one heading to the next
REACH_M = 0.7  # fixtures whose boxes are farther than this from the base centre cannot touch it
# A goal that touches something is exchanged for the nearest free pose up to this far away.
SHIFT_M, SHIFT_STEP_M = 0.18, 0.03
# A base at rest answers to commands above these only (docs/robocasa.md, section 2): metres and radians a second are
# |command| - 0.25 and 1.5 |command| - 0.167.
DEAD_ZONE, TURN_DEAD_ZONE = 0.25, 0.11
MOVE_GAIN, TURN_GAIN = 2.5, 2.0  # per second
WAYPOINT_M, WAYPOINT_RAD = 0.12, 0.25
ARRIVED_M, ARRIVED_RAD = 0.02, 0.03
STALL_STEPS, STALL_M = 30, 0.01
_NEIGHBOURS = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


def drive_to(
    env: KitchenEnv,
    x: float,
    y: float,
    yaw: float,
    *,
    gripper: float = OPEN,
    tolerance_m: float = ARRIVED_M,
    tolerance_rad: float = ARRIVED_RAD,
) -> Iterator[Array]:
    """Drive the base centre to a place (metres) and heading (radians), round the fixtures, the arm carried along.

    Raises:
        SkillError: there is no way, or the base got stuck.
    """
    position, heading = base_pose(env.data)
    start, goal = RobotPose(float(position[0]), float(position[1]), heading), RobotPose(x, y, yaw)
    way = find_way(env.scene, start, goal)
    for index, pose in enumerate(way):
        last = index == len(way) - 1
        bounds = (tolerance_m, tolerance_rad) if last else (WAYPOINT_M, WAYPOINT_RAD)
        yield from _approach(env, pose, gripper, bounds, stop=last)


def find_way(scene: Scene, start: RobotPose, goal: RobotPose) -> list[RobotPose]:
    """Poses from a start to a goal, both left out but the goal, all of them free: the shortest way by A*.

    Raises:
        SkillError: there is none.
    """
    room = Room(scene)
    goal = room.nearest(goal)
    if room.straight(start, goal):
        return [goal]
    grid = _Grid(room, start, goal)
    cells = grid.search()
    if cells is None:
        raise SkillError(f"no way for the base from ({start.x:.2f}, {start.y:.2f}) to ({goal.x:.2f}, {goal.y:.2f})")
    return [*(grid.pose(cell) for cell in cells[1:]), goal]


class Room:
    """Answers whether the robot can stand at a pose, asking the fixtures near it only."""

    def __init__(self, scene: Scene) -> None:
        self._bounds, self._shape = scene.layout.room, scene.robot.shape
        self._fixtures = [f for f in scene.fixtures.values() if f.name != "floor"]
        self._middle = np.array([f.pos[:2] for f in self._fixtures])
        self._half = np.array([[f.width / 2, f.depth / 2] for f in self._fixtures])
        turn = np.array([f.yaw for f in self._fixtures])
        self._cos, self._sin = np.cos(turn), np.sin(turn)

    def free(self, pose: RobotPose) -> bool:
        """Whether nothing is touched, inside of the walls."""
        bounds = self._bounds
        if not (bounds["x_min"] < pose.x < bounds["x_max"] and bounds["y_min"] < pose.y < 0.0):
            return False
        dx, dy = (np.array([pose.x, pose.y]) - self._middle).T
        x = np.abs(self._cos * dx + self._sin * dy) - self._half[:, 0]
        y = np.abs(-self._sin * dx + self._cos * dy) - self._half[:, 1]
        near = np.flatnonzero(np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0)) < REACH_M)
        return is_free({self._fixtures[index].name: self._fixtures[index] for index in near}, pose, self._shape)

    def nearest(self, goal: RobotPose) -> RobotPose:
        """The goal, or the free pose of the same heading that is nearest to it, or the goal if there is none."""
        reach = np.arange(-SHIFT_M, SHIFT_M + 1e-9, SHIFT_STEP_M)
        shifts = sorted(((float(x), float(y)) for x in reach for y in reach), key=lambda shift: np.hypot(*shift))
        for x, y in shifts:
            pose = RobotPose(goal.x + x, goal.y + y, goal.yaw)
            if np.hypot(x, y) <= SHIFT_M and self.free(pose):
                return pose
        return goal

    def straight(self, start: RobotPose, goal: RobotPose) -> bool:
        """Whether the robot can move and turn at once from one pose to another."""
        turn = _wrap(goal.yaw - start.yaw)
        length = float(np.hypot(goal.x - start.x, goal.y - start.y))
        steps = int(np.ceil(max(length / 0.05, abs(turn) / 0.1, 1.0)))
        return all(
            self.free(
                RobotPose(start.x + (goal.x - start.x) * t, start.y + (goal.y - start.y) * t, start.yaw + turn * t)
            )
            for t in np.arange(1, steps) / steps
        )


type _Cell = tuple[int, int, int]


@dataclass
class _Grid:
    """Cells (i, j, k) of places and headings, counted from the goal's pose."""

    room: Room
    start: RobotPose
    goal: RobotPose

    def __post_init__(self) -> None:
        self._known: dict[tuple[int, int, float], bool] = {}

    def pose(self, cell: tuple[int, int, float]) -> RobotPose:
        """The middle of a cell, or between two headings."""
        i, j, k = cell
        return RobotPose(
            self.goal.x + i * CELL_M, self.goal.y + j * CELL_M, _wrap(self.goal.yaw + k * 2 * np.pi / HEADINGS)
        )

    def first(self) -> _Cell:
        """The cell of the start."""
        turn = _wrap(self.start.yaw - self.goal.yaw)
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
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == (0, 0, 0):
                way = [cell]
                while way[-1] in came:
                    way.append(came[way[-1]])
                return way[::-1]
            if cell in done:
                continue
            done.add(cell)
            for other, length in self._neighbours(cell):
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

    def _is_free(self, before: _Cell, cell: _Cell) -> bool:
        if cell not in self._known:
            self._known[cell] = cell == (0, 0, 0) or self.room.free(self.pose(cell))
        if not self._known[cell] or before[2] == cell[2]:
            return self._known[cell]
        low, high = sorted((before[2], cell[2]))
        between = (*cell[:2], high + 0.5 if (low, high) == (0, HEADINGS - 1) else low + 0.5)
        if between not in self._known:
            self._known[between] = self.room.free(self.pose(between))
        return self._known[between]


def _approach(
    env: KitchenEnv, goal: RobotPose, gripper: float, bounds: tuple[float, float], *, stop: bool
) -> Iterator[Array]:
    best, since = np.inf, 0
    while True:
        position, heading = base_pose(env.data)
        error = np.array([goal.x - position[0], goal.y - position[1]])
        turn = _wrap(goal.yaw - heading)
        left = float(np.linalg.norm(error))
        if left < bounds[0] and abs(turn) < bounds[1]:
            return
        if left + 0.3 * abs(turn) < best - STALL_M:
            best, since = left + 0.3 * abs(turn), 0
        else:
            since += 1
        if since > STALL_STEPS:
            if stop and left < 3 * bounds[0] and abs(turn) < 3 * bounds[1]:
                return
            raise SkillError(f"the base is stuck {left * 100:.0f} cm and {np.rad2deg(turn):.0f} degrees from its way")
        yield action(gripper=gripper, base=_base_command(error, turn, heading, stop=stop), mode=FROM_DESIRED)


def _base_command(error: Array, turn: float, heading: float, *, stop: bool) -> Array:
    """Base command (4,): forwards, to the left, turn, torso; with the dead zones made up for."""
    c, s = np.cos(heading), np.sin(heading)
    speed = (MOVE_GAIN if stop else 3 * MOVE_GAIN) * np.array(
        [c * error[0] + s * error[1], -s * error[0] + c * error[1]]
    )
    command = np.zeros(4)
    for axis in range(2):
        if abs(speed[axis]) > 0.01:
            command[axis] = speed[axis] + np.sign(speed[axis]) * DEAD_ZONE
    if abs(turn) > 0.01:
        command[2] = (TURN_GAIN * turn + np.sign(turn) * 0.167) / 1.5
    command[:2] = limit(command[:2], 1.0)
    command[2] = np.clip(command[2], -1.0, 1.0)
    return command


def _wrap(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
