"""Where the base has room: by the fixtures' footprints, or by the robot's shapes against the kitchen as it is now."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, Touched
from robocasa_lerobot.envs.scene.robot_poses import Obstacles, RobotPose
from robocasa_lerobot.envs.scene.scene import Scene

# A goal that touches something is exchanged for the nearest free pose up to this far away.
SHIFT_M, SHIFT_STEP_M = 0.18, 0.03
STEP_M, STEP_RAD = 0.05, 0.1  # between tested poses of a straight move
CLOSE_STEP_M, CLOSE_STEP_RAD = 0.025, 0.06  # the same where a margin is to be kept
# From the start, within which bodies touched there already may still be touched; and from the goal.
LEAVING_M, COMING_M = 0.15, 0.20
_MOST_NEAR = 8  # bodies that are told apart there

_obstacles: WeakKeyDictionary[mujoco.MjModel, Obstacles] = WeakKeyDictionary()


class Room:
    """Answers whether the robot can stand at poses, asking the fixtures' footprints.

    Attributes:
        margin_m: kept from what stands around.
    """

    margin_m = 0.0

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        if scene.model not in _obstacles:
            fixtures = {name: fixture for name, fixture in scene.fixtures.items() if name != "floor"}
            _obstacles[scene.model] = Obstacles(fixtures, scene.robot.shape)
        self._obstacles = _obstacles[scene.model]

    def free_at(self, poses: Array) -> NDArray[np.bool_]:
        """Whether nothing is touched, inside of the walls, at N poses, rows of x and y in metres and yaw, (N,)."""
        if not len(poses):
            return np.zeros(0, dtype=np.bool_)
        x, y = poses[:, 0], poses[:, 1]
        bounds = self.scene.layout.room
        inside: NDArray[np.bool_] = (bounds["x_min"] < x) & (x < bounds["x_max"]) & (bounds["y_min"] < y) & (y < 0.0)
        return inside & self._obstacles.leave_free_at(poses)

    def free_all_along(self, poses: Array) -> bool:
        """Whether N poses are all free."""
        return bool(self.free_at(poses).all())

    def all_free(self, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
        """The same of poses as they are named elsewhere, (N,)."""
        return self.free_at(np.array([(pose.x, pose.y, pose.yaw) for pose in poses]).reshape(-1, 3))

    def free(self, pose: RobotPose) -> bool:
        """The same of one pose."""
        return bool(self.all_free([pose])[0])

    def nearest(self, goal: RobotPose) -> RobotPose:
        """The goal, or the free pose of the same heading that is nearest to it, or the goal if there is none."""
        return goal if self.free(goal) else next(iter(self.near(goal)), goal)

    def near(self, goal: RobotPose) -> list[RobotPose]:
        """Free poses of a goal's heading up to `SHIFT_M` from it, the nearest first."""
        poses = [RobotPose(goal.x + x, goal.y + y, goal.yaw) for x, y in _shifts()]
        return [pose for pose, free in zip(poses, self.all_free(poses), strict=True) if free]

    def straight(self, start: RobotPose, goal: RobotPose) -> bool:
        """Whether the robot can move and turn at once from one pose to another."""
        return self.free_all_along(rows_between(start, goal, STEP_M, STEP_RAD))

    def closely(self, one: RobotPose, other: RobotPose) -> bool:
        """The same with poses tested that lie no farther apart than a handle is wide."""
        return self.free_all_along(rows_between(one, other, CLOSE_STEP_M, CLOSE_STEP_RAD))


class Space(Room):
    """The same, and the robot's shapes against those of the kitchen as it is now.

    Args:
        scene: of the kitchen.
        checker: of the present state.
        start: where the base stands; bodies touched there are no obstacles near it.
        goal: where it is to stand.
        held: the object in the gripper.
        joints: (7,) of the arm on the way, radians; None takes those it has.
        margin_m: kept from what stands around.
        close_m: the same near the start and the goal.
    """

    def __init__(
        self,
        scene: Scene,
        checker: CollisionChecker,
        start: RobotPose,
        goal: RobotPose,
        held: Held | None,
        joints: Array | None,
        margin_m: float,
        close_m: float = 0.0,
    ) -> None:
        super().__init__(scene)
        self._checker = checker
        self._held, self.margin_m, self._close = held, margin_m, close_m
        self._joints = self._checker.present_joints if joints is None else joints
        self._start, self._goal = start, goal
        leaning = self._touched(np.array([(start.x, start.y, start.yaw)]), _MOST_NEAR, close_m).all()
        self._leaning = np.zeros(scene.model.nbody, dtype=np.bool_)
        self._leaning[list(leaning)] = True

    def free_at(self, poses: Array) -> NDArray[np.bool_]:
        """Whether nothing is touched, inside of the walls; poses near the start may touch what the start does.

        Near the start and the goal little or no margin is kept: robots stand close to what they work on.
        """
        free = super().free_at(poses)
        places = np.flatnonzero(free)
        if len(places):
            mine = poses[places]
            leaving, close = self._near_ends(mine)
            if not close.all():
                far = ~close
                free[places[far]] = self._touched(mine[far], 1, self.margin_m).counts == 0
            if close.any():
                free[places[close]] = self._free_close(mine[close], leaving[close])
        return free

    def free_all_along(self, poses: Array) -> bool:
        """Whether N poses are all free; what comes after one that is not is not looked at."""
        if not super().free_at(poses).all():
            return False
        leaving, close = self._near_ends(poses)
        if close.any() and not self._free_close(poses[close], leaving[close]).all():
            return False
        far = poses[~close]
        return not len(far) or not self._touched(far, 1, self.margin_m, until_one=True).counts.any()

    def _near_ends(self, poses: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether each of N poses is near the start, and whether it is near that or the goal."""
        leaving = np.hypot(poses[:, 0] - self._start.x, poses[:, 1] - self._start.y) < LEAVING_M
        return leaving, leaving | (np.hypot(poses[:, 0] - self._goal.x, poses[:, 1] - self._goal.y) < COMING_M)

    def _free_close(self, poses: Array, leaving: NDArray[np.bool_]) -> NDArray[np.bool_]:
        found = self._touched(poses, _MOST_NEAR, self._close)
        meant = np.arange(_MOST_NEAR) < found.counts[:, None]
        pardoned = leaving[:, None] & self._leaning[found.bodies]
        return np.asarray((pardoned | ~meant).all(axis=1))

    def _touched(self, poses: Array, most: int, margin_m: float, *, until_one: bool = False) -> Touched:
        return self._checker.touched(
            poses, self._joints, held=self._held, margin_m=margin_m, most=most, until_one=until_one
        )


def rows_between(start: RobotPose, goal: RobotPose, step_m: float, step_rad: float) -> Array:
    """Poses on a straight move as rows of x and y in metres and yaw, both ends left out; steps are no longer."""
    turn = wrap(goal.yaw - start.yaw) if goal.yaw != start.yaw else 0.0
    x, y = goal.x - start.x, goal.y - start.y
    steps = int(np.ceil(max(float(np.hypot(x, y)) / step_m, abs(turn) / step_rad, 1.0)))
    shares = np.arange(1, steps) / steps
    rows = np.empty((steps - 1, 3))
    rows[:, 0], rows[:, 1], rows[:, 2] = start.x + x * shares, start.y + y * shares, start.yaw + turn * shares
    return rows


def between(start: RobotPose, goal: RobotPose, step_m: float, step_rad: float) -> list[RobotPose]:
    """The same as poses."""
    return [RobotPose(x, y, yaw) for x, y, yaw in rows_between(start, goal, step_m, step_rad).tolist()]


@functools.cache
def _shifts() -> list[tuple[float, float]]:
    """Of a goal that touches something, the nearest first, metres."""
    reach = np.arange(-SHIFT_M, SHIFT_M + 1e-9, SHIFT_STEP_M)
    shifts = sorted(((float(x), float(y)) for x in reach for y in reach), key=lambda shift: np.hypot(*shift))
    return [(x, y) for x, y in shifts if np.hypot(x, y) <= SHIFT_M]


def wrap(angle: float) -> float:
    """The same angle between -pi and pi, radians."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
