"""How the hand goes and from where the robot stands: paths of hand poses times places to stand, and the best of them.

All candidates are solved at once; then they are tested best first, each as far as it must be: its poses, then the lines
between them, then, where only the line to its first pose meets something, a path round that. The search ends when the
best tested candidate costs less than any other can.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array, HandTarget, base_pose, floor_axes
from robocasa_lerobot.demos.motion_style import motion_style_of
from robocasa_lerobot.demos.planning.approach import Approach
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, is_full
from robocasa_lerobot.demos.planning.costs import NEARBY, REACHING, PlanCosts
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

SHORTLIST, MOST_TESTED, MOST_DETOURS = 240, 120, 2
LOADED_MORE = 4  # times as many of all of them with a full vessel in the hand, which is wide: most come to nothing
SAMPLE_RAD, MOST_SAMPLES = 0.10, 5  # between tested configurations of a line, and how many at most
NEAR_M, DRIVE_STEP_M = 0.08, 0.07  # a drive as short is not tested; between tested places of a longer one
_POSES, _LINES, _DETOUR = range(3)
_TOGETHER = 8  # candidates whose poses are tested in one call, since the next ones are likely to be asked about too
_SHARES = [((np.arange(count) + 0.7) / max(count, 1))[:, None] for count in range(MOST_SAMPLES + 1)]


@dataclass(frozen=True)
class WaypointPath:
    """A row of hand poses.

    Attributes:
        targets: all paths that are compared have the same number.
        extra: cost that it has in any case.
        drawn: what of that was drawn at random, and is no reason to stand elsewhere.
        takes: the object in the gripper after the pose that is solved first, as it will be.
    """

    targets: tuple[HandTarget, ...]
    extra: float = 0.0
    takes: Held | None = None
    drawn: float = field(default=0.0, kw_only=True)  # no place of its own: kinds of paths add their parts after these


@dataclass(frozen=True)
class MotionPlan:
    """A path of the hand, and how it begins.

    Attributes:
        path: of the hand.
        base: where to stand; None for where the robot stands now.
        cost: from about 2 on it will not do.
        joints: (k, 7) radians: the joint path to the first pose, from the arm as it is when the base has arrived.
        shift: of the base, metres forward and to the left, where plans were asked for by such moves.
    """

    path: WaypointPath
    base: RobotPose | None
    cost: float
    joints: Array
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def targets(self) -> tuple[HandTarget, ...]:
        """The hand poses of its path."""
        return self.path.targets


def plan_near(
    env: KitchenEnv,
    rows: Iterable[tuple[HandTarget, ...]],
    shifts: Iterable[tuple[float, float]],
    *,
    allowed: frozenset[int] = frozenset(),
    tried: Sequence[Array] = (),
) -> MotionPlan:
    """The best path to one of some rows of hand poses from about where the robot stands, the arm carried as it is.

    Args:
        env: its state is read, not touched.
        rows: alternatives, each a row of hand poses, all of one length.
        shifts: moves of the base to try, metres forward and to the left; later ones where the first are not good.
        allowed: bodies that the robot may touch.
        tried: hand rotations (3, 3) of the last pose that are not wanted again, unless there are no others.
    """
    paths = [WaypointPath(tuple(row)) for row in rows]
    others = [path for path in paths if all(_differs(path.targets[-1].rotation, turn) for turn in tried)]
    planner = MotionPlanner(env, others or paths, 0, allowed=allowed, costs=NEARBY, preferred=-1)
    base, yaw = base_pose(env.data)
    axes = floor_axes(yaw)
    moves = list(shifts)
    best: MotionPlan | None = None
    for group in (moves[:1], moves[1:4], moves[4:]):
        bases = []
        for shift in group:
            x, y, _ = base + np.asarray(shift) @ axes
            bases.append(RobotPose(float(x), float(y), yaw))
        for plan in planner.best(bases, folded=False)[:1]:
            if best is None or plan.cost < best.cost:
                assert plan.base is not None
                best = replace(plan, shift=group[bases.index(plan.base)])
        if best is not None and best.cost < NEARBY.good_enough:
            break
    assert best is not None, "no shift, or no path"
    return best


def _differs(rotation: Array, other: Array) -> bool:
    return float(np.trace(rotation.T @ other)) < 2.5


class MotionPlanner:
    """Paths that are compared from any number of places.

    Args:
        env: its state is read, not touched.
        paths: alternatives, all with the same number of poses.
        key: number of the pose that is solved first.
        held: the object in the gripper.
        loaded: number of poses, from the first on, at which it still is.
        allowed: bodies that the robot may touch.
        costs: weights.
        preferred: number of the pose whose rotation the demonstration's style prefers; None takes `key`.
    """

    def __init__(
        self,
        env: KitchenEnv,
        paths: Sequence[WaypointPath],
        key: int,
        *,
        held: Held | None = None,
        loaded: int = 0,
        allowed: frozenset[int] = frozenset(),
        costs: PlanCosts = REACHING,
        preferred: int | None = None,
    ) -> None:
        self._env, self._paths, self._key, self._costs = env, list(paths), key, costs
        self._held, self._loaded = held, loaded
        self._more = LOADED_MORE if loaded and is_full(held) else 1
        self._checker = CollisionChecker(env.scene, env.data, allowed=allowed)
        self._arm, self._here = self._checker.arm, self._checker.present_base
        self._checker.allow_present()
        # (paths, poses, 3) and (paths, poses, 3, 3)
        self._positions = np.array([[t.position for t in path.targets] for path in paths])
        self._rotations = np.array([[t.rotation for t in path.targets] for path in paths])
        style, which = motion_style_of(env), key if preferred is None else preferred
        self._extra = np.array([path.extra for path in paths]) - style.bonuses(self._rotations[:, which])
        keys = np.column_stack([self._positions[:, key], self._rotations[:, key].reshape(len(paths), 9)])
        self._same = np.unique(keys.round(4), axis=0, return_inverse=True)[1].reshape(-1)
        self._drives: dict[tuple[float, float, float], float] = {}

    def best(
        self, bases: Sequence[RobotPose | None], *, folded: bool = True, detours: int = MOST_DETOURS
    ) -> list[MotionPlan]:
        """Plans among all paths from all places, the best first; the first one's cost is complete.

        Args:
            bases: None is where the robot stands.
            folded: whether the arm is folded while the base drives, or carried as it is.
            detours: how often a path to the first pose is searched for, at most.
        """
        if not bases or not self._paths:
            return []
        found = _Candidates(self, bases, folded=folded)
        queue = [(float(found.cost[row]), _POSES, row) for row in range(len(found.cost))]
        heapq.heapify(queue)
        plans: list[MotionPlan] = []
        number = itertools.count()
        detours *= self._more
        least = np.inf
        while queue:
            cost, stage, row = heapq.heappop(queue)
            if cost > least:
                break
            if stage == _POSES and next(number) >= MOST_TESTED * self._more:
                continue
            if stage == _POSES:
                heapq.heappush(queue, (cost + found.poses(row), _LINES, row))
            elif stage == _LINES:
                rest = cost + found.lines(row) + found.drive(row)
                first = found.straight(row)
                plans.append(found.plan(row, rest + first, found.goal(row)[None]))
                if first > 2 * self._costs.detour:
                    heapq.heappush(queue, (rest + self._costs.detour, _DETOUR, row))
            elif detours > 0:
                detours -= 1
                detour = found.detour(row)
                if detour is not None:
                    plans.append(found.plan(row, cost - self._costs.detour + detour[1], detour[0]))
            least = min([least, *(plan.cost for plan in plans[-1:])])
        return sorted(plans, key=lambda plan: plan.cost)

    # What candidates ask for, of one or many rows.

    def solve(self, paths: NDArray[np.intp], frames: Array, index: int, start: Array) -> tuple[Array, Array]:
        """Joints (n, 7) at one pose of paths, with the arm's frame at (n, 4), and what they cost (n,)."""
        costs = self._costs
        cos, sin = np.cos(frames[:, 3]), np.sin(frames[:, 3])
        turn = np.zeros((len(paths), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = cos
        turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = sin, -sin, 1.0
        position = (turn @ (self._positions[paths, index] - frames[:, :3])[..., None])[..., 0]
        solution = self._arm.solve(position, turn @ self._rotations[paths, index], start)
        miss = costs.miss_per_m * np.maximum(solution.position_error - costs.free_m, 0.0)
        miss += costs.miss_per_rad * np.maximum(solution.rotation_error - costs.free_rad, 0.0)
        margin = np.maximum(0.0, costs.near_limit_rad - solution.margin)
        return solution.joints, np.minimum(miss, costs.most_miss) + costs.near_limit * margin

    def held_on(self, path: WaypointPath, line: int) -> Held | None:
        """The object in the gripper on the line that ends in a pose, counted from 1."""
        if line <= self._loaded:
            return self._held
        return path.takes if line > self._key + 1 else None

    def drive_cost(self, base: RobotPose | None, joints: Array) -> float:
        """Cost of what the robot meets on a straight drive to a place."""
        if base is None or np.hypot(base.x - self._here[0], base.y - self._here[1]) < NEAR_M:
            return 0.0
        at = (base.x, base.y, base.yaw)
        if at not in self._drives:
            away = np.array(at) - self._here
            away[2] = np.arctan2(np.sin(away[2]), np.cos(away[2]))
            count = max(int(np.ceil(float(np.hypot(*away[:2])) / DRIVE_STEP_M)), 3)
            shares = np.arange(1, count + 1)[:, None] / count
            held = self._held if self._loaded else None
            counts = self._checker.touched(self._here + shares * away, joints, held=held).counts
            thirds = [int(part.max()) for part in np.array_split(counts, 3)]
            self._drives[at] = self._costs.hit * sum(thirds)
        return self._drives[at]


class _Candidates:
    """The cheapest of all paths from all places, solved; the further they are asked about, the more is tested."""

    def __init__(self, planner: MotionPlanner, bases: Sequence[RobotPose | None], *, folded: bool) -> None:
        self._p, self._bases = planner, bases
        costs, here = planner._costs, planner._here
        places = np.array([here if base is None else (base.x, base.y, base.yaw) for base in bases])
        present = planner._checker.present_joints
        home = planner._arm.home if folded else present
        starts = np.array([present if base is None else home for base in bases])
        far = np.hypot(*(places - here)[:, :2].T)
        drives = np.where([base is None for base in bases], 0.0, costs.drive + costs.drive_per_m * far)
        frames = planner._checker.arm_frames(places)
        count = len(planner._paths)
        which, where = np.tile(np.arange(count), len(bases)), np.repeat(np.arange(len(bases)), count)
        start, key = starts[where], planner._key
        cost = planner._extra[which] + drives[where]
        # Many paths differ in how they come and go only.
        same = planner._same[which] + where * count
        _, first, back = np.unique(same, return_index=True, return_inverse=True)
        joints, missed = planner.solve(which[first], frames[where[first]], key, start[first])
        joints, missed = joints[back.reshape(-1)], missed[back.reshape(-1)]
        cost = cost + missed + costs.turn * np.abs(joints - start).max(axis=1)
        short = np.argsort(cost, kind="stable")[: SHORTLIST * planner._more]
        which, where, cost, start = which[short], where[short], cost[short], start[short]
        solved = [start]
        for index in range(planner._positions.shape[1]):
            joints, more = planner.solve(which, frames[where], index, solved[-1])
            solved.append(joints)
            if index != key:
                cost = cost + costs.other_poses * more
        self.cost, self._which, self._where = cost, which, where
        self._places, self._joints = places, np.stack(solved, axis=1)  # (rows, 1 + poses, 7)
        self._lines = len(solved) - 1
        self._order = np.argsort(cost, kind="stable").tolist()  # in which they are asked about first
        self._hits: dict[int, int] = {}
        self._straight: dict[tuple[int, int, bytes], float] = {}

    def poses(self, row: int) -> float:
        """Cost of the bodies touched at the poses."""
        if row not in self._hits:
            begin = self._order.index(row)
            self._test_poses(self._order[begin : begin + _TOGETHER])
        return self._p._costs.hit_at_pose * float(self._hits[row])

    def _test_poses(self, rows: list[int]) -> None:
        """Count the bodies touched at all poses of some rows; what is held is one question each."""
        asked: dict[int, tuple[Held | None, list[int], list[int]]] = {}
        for row in rows:
            path = self._p._paths[self._which[row]]
            self._hits[row] = 0
            for line in range(1, self._lines + 1):
                held = self._p.held_on(path, line)
                _, its_rows, its_lines = asked.setdefault(id(held), (held, [], []))
                its_rows.append(row)
                its_lines.append(line)
        for held, its_rows, its_lines in asked.values():
            places, joints = self._places[self._where[its_rows]], self._joints[its_rows, its_lines]
            counts = self._p._checker.touched(places, joints, held=held, most=self._p._costs.most_hits).counts
            for row, count in zip(its_rows, counts.tolist(), strict=True):
                self._hits[row] += count

    def lines(self, row: int) -> float:
        """Cost of the bodies touched on the lines between the poses."""
        joints, worst, at = self._joints[row], 0, 0
        away = joints[2:] - joints[1:-1]
        samples = np.clip(np.ceil(np.abs(away).max(axis=1) / SAMPLE_RAD), 1, MOST_SAMPLES).astype(int).tolist()
        # Lines end short of their poses, which have been tested.
        pieces = [(line + 2, joints[line + 1] + _SHARES[count] * away[line]) for line, count in enumerate(samples)]
        counts = self._counts(row, pieces)
        for count in samples:
            worst += max(counts[at : at + count])
            at += count
        return self._p._costs.hit * worst

    def drive(self, row: int) -> float:
        """Cost of the obstacles met on the drive."""
        return self._p.drive_cost(self._bases[self._where[row]], self._joints[row, 0])

    def goal(self, row: int) -> Array:
        """Joint angles (7,) at the first pose."""
        joints: Array = self._joints[row, 1]
        return joints

    def straight(self, row: int) -> float:
        """Cost of the straight line to the first pose."""
        held = self._p.held_on(self._p._paths[self._which[row]], 1)
        key = (int(self._where[row]), id(held), self._joints[row, :2].tobytes())
        if key not in self._straight:  # many paths begin alike
            self._straight[key] = self._approach(row).straight(self._joints[row, 0], self._joints[row, 1])
        return self._straight[key]

    def detour(self, row: int) -> tuple[Array, float] | None:
        """A joint path (k, 7) to the first pose round what the straight line meets, and its cost."""
        place = self._places[self._where[row]]
        return self._approach(row).detour(self._joints[row, 0], self._joints[row, 1], place)

    def _approach(self, row: int) -> Approach:
        planner, place = self._p, self._places[self._where[row]]
        held, most = planner.held_on(planner._paths[self._which[row]], 1), planner._costs.most_hits

        def counts(joints: Array, margin_m: float) -> NDArray[np.int64]:
            return planner._checker.touched(place, joints, held=held, margin_m=margin_m, most=most).counts

        return Approach(planner._arm, counts, planner._costs, level=held is not None and bool(held.contents))

    def plan(self, row: int, cost: float, joints: Array) -> MotionPlan:
        """The plan of a row."""
        return MotionPlan(self._p._paths[self._which[row]], self._bases[self._where[row]], cost, joints)

    def _counts(self, row: int, pieces: list[tuple[int, Array]]) -> list[int]:
        """Bodies touched at configurations (n, 7) of lines in their order, with the object held on each, one row."""
        path, place = self._p._paths[self._which[row]], self._places[self._where[row]]
        found: list[int] = []
        for held, group in itertools.groupby(pieces, key=lambda piece: self._p.held_on(path, piece[0])):
            joints = np.concatenate([joints for _, joints in group])
            checked = self._p._checker.touched(place, joints, held=held, most=self._p._costs.most_hits)
            found += checked.counts.tolist()
        return found
