"""Paths of the hand along a part that turns or slides: doors, drawers, heads, lids, with the base going along.

A plan says where the base stands when the hand first touches the part and where it stands at the end: long doors are
followed with the base as well as with the arm. All candidates are solved at once and tested best first, as far as they
must be, so planning takes a bounded time, also for parts out of reach.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array, HandTarget, floor_axes
from robocasa_lerobot.demos.planning.approach import Approach
from robocasa_lerobot.demos.planning.collision import CollisionChecker, MovingPart, Touched
from robocasa_lerobot.demos.planning.costs import IN_CONTACT
from robocasa_lerobot.demos.planning.errors import NoPlanError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

Shift = tuple[float, float]

MOST_TESTED, MOST_DETOURS = 80, 2
# Shares of the line from one pose to the next that are tested, in stretches that count once.
BETWEEN = ((0.2, 0.35), (0.5, 0.7, 0.85))
OFF_M = 0.12  # after which the base no longer leans on what it leant on
BACKS_M = (0.25, 0.5, 0.75)  # that the base goes back before it goes to the side, where it cannot go straight
LEG_STEP_M = 0.08  # between tested places of the base
_POSES, _LINES, _DETOUR = range(3)
# Bends of the home pose, from which first poses are solved, radians: none; let down ahead and to both sides.
AT_HOME = np.zeros((1, 7))
LET_DOWN = np.array([[0, 0, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0, 0], [1.2, 1, 0, 0, 0, 0, 0], [-1.2, 1, 0, 0, 0, 0, 0]])


class ArticulatedPart(Protocol):
    """What turns or slides, as the planner sees it."""

    name: str

    @property
    def body(self) -> int:
        """Number of its body."""

    @property
    def angle(self) -> float:
        """How far it is from shut; positive is open."""

    def joint_value(self, angle: float) -> float:
        """The position of its joint, named as the part, at an angle from shut."""


@dataclass(frozen=True, eq=False)
class Waypoint:
    """A pose of the hand with the part at `angle`, and the base `progress` of its path along (0 to 1)."""

    angle: float
    target: HandTarget
    progress: float = 0.0


@dataclass(frozen=True, eq=False)
class ContactPath:
    """Hand poses off a part and along with it.

    Attributes:
        waypoints: in their order, those off the part first.
        contact: number of the first pose in which the hand may touch the part.
        target_at: wanted pose of the hand with the part at an angle.
        bias: added to the cost of a grasp that is known to hold worse.
    """

    waypoints: tuple[Waypoint, ...]
    contact: int
    target_at: Callable[[float], HandTarget]
    bias: float = 0.0


@dataclass(frozen=True, eq=False)
class ArticulatedPlan:
    """A path, and where the base stands for it.

    Attributes:
        path: of the hand.
        start, end: moves of the base from where it stands now, metres forward and to the left: before, and by the end.
        cost: how bad it is; above 1 it is not possible without a collision or a miss.
        legs: straight moves that make up the first one.
        joints: (k, 7) radians: the joint path to the first pose.
    """

    path: ContactPath
    start: Shift
    end: Shift
    cost: float
    legs: tuple[Shift, ...]
    joints: Array


def plan_contact(
    env: KitchenEnv,
    part: ArticulatedPart,
    paths: Iterable[ContactPath],
    stances: Iterable[tuple[Shift, Shift]],
    *,
    bends: Array = AT_HOME,
    detours: int = MOST_DETOURS,
) -> ArticulatedPlan:
    """The path that costs least of those that can be reached without touching other bodies.

    Args:
        env: its state is read, not touched.
        part: the one to move.
        paths: alternatives, all with the same number of poses.
        stances: moves of the base to try: before, and by the end.
        bends: (n, 7) radians: joint angles, from those of the home pose, from which first poses are solved; from the
            home pose alone the arm misses much of what is low and to the side.
        detours: how often a path to the first pose is searched for, at most.

    Raises:
        NoPlanError: there is none.
    """
    options = list(paths)
    assert options, "no path to plan"
    search = _Search(env, part, options, list(stances))
    found = search.candidates(bends)
    queue = [(candidate.cost, _POSES, number) for number, candidate in enumerate(found)]
    heapq.heapify(queue)
    best: tuple[float, int, Array] | None = None
    tested = 0
    while queue:
        cost, stage, number = heapq.heappop(queue)
        if best is not None and cost >= best[0]:
            break
        candidate = found[number]
        if stage == _POSES:
            if tested >= MOST_TESTED or search.legs(candidate) is None:
                continue
            tested += 1
            heapq.heappush(queue, (cost + search.drive(candidate) + search.poses(candidate), _LINES, number))
        elif stage == _LINES:
            rest = cost + search.between(candidate)
            before = search.straight(candidate)
            if best is None or rest + before < best[0]:
                best = (rest + before, number, candidate.joints[:1])
            if before > 2 * IN_CONTACT.detour:
                heapq.heappush(queue, (rest + IN_CONTACT.detour, _DETOUR, number))
        elif detours > 0:
            detours -= 1
            detour = search.detour(candidate)
            whole = np.inf if detour is None else cost - IN_CONTACT.detour + detour[1]
            if detour is not None and (best is None or whole < best[0]):
                best = (whole, number, detour[0])
    if best is None:
        raise NoPlanError(f"{part.name}: the arm reaches nowhere along its arc")
    candidate = found[best[1]]
    legs = search.legs(candidate)
    assert legs is not None
    return ArticulatedPlan(options[candidate.path], *candidate.stance, best[0], legs, best[2])


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A path from a stance, with joint angles (poses, 7), and what it costs but for what it meets."""

    path: int
    stance: tuple[Shift, Shift]
    cost: float
    joints: Array


class _Search:
    """Candidates, and tests of them."""

    def __init__(
        self, env: KitchenEnv, part: ArticulatedPart, paths: list[ContactPath], stances: list[tuple[Shift, Shift]]
    ) -> None:
        self._env, self._part, self._paths, self._stances = env, part, paths, stances
        self._checker = CollisionChecker(env.scene, env.data)
        self._checker.allow_hand(part.body)
        self._arm, self._present = self._checker.arm, self._checker.present_joints
        self._base = self._checker.present_base
        self._axes = floor_axes(float(self._base[2]))
        angles = sorted({round(angle, 6) for path in paths for angle in self._angles(path)})
        self._states = {angle: number for number, angle in enumerate(angles)}
        values = np.array([part.joint_value(angle) for angle in angles])
        self._moving = MovingPart(env.model, env.data, part.name, values)
        # What it leans on already is no reason not to drive off: the part that it has just let go, for one.
        self._leant_on = self._touched([part.angle], [(0.0, 0.0)], self._present[None], [True], most=8).all()
        self._known: dict[tuple[Shift, Shift], tuple[Shift, ...] | None] = {}

    def _angles(self, path: ContactPath) -> list[float]:
        """Every angle at which something is tested."""
        found = [self._part.angle, *(waypoint.angle for waypoint in path.waypoints)]
        shares = [share for group in BETWEEN for share in group]
        for last, waypoint in itertools.pairwise(path.waypoints):
            found += [last.angle + share * (waypoint.angle - last.angle) for share in shares]
        return found

    def candidates(self, bends: Array) -> list[_Candidate]:
        """What the arm reaches from bends of its home pose (n, 7), the cheapest first."""
        costs, frame = IN_CONTACT, self._env.data.site(self._env.scene.robot.names.arm_center_site)
        turn = frame.xmat.reshape(3, 3)
        paths, count = self._paths, len(self._paths)
        positions = np.array([[w.target.position for w in path.waypoints] for path in paths]) - frame.xpos
        rotations = turn.T @ np.array([[w.target.rotation for w in path.waypoints] for path in paths])
        progress = np.array([[w.progress for w in path.waypoints] for path in paths])
        starts, ends = (np.array([stance[index] for stance in self._stances]) for index in (0, 1))
        which = np.tile(np.arange(count), len(bends) * len(self._stances))
        where = np.tile(np.repeat(np.arange(len(self._stances)), count), len(bends))
        cost = np.array([path.bias for path in paths])[which]
        drive = costs.drive_per_m * np.hypot(*starts.T) + costs.along_per_m * np.hypot(*(ends - starts).T)
        cost = cost + drive[where]
        solved: list[Array] = []
        joints = np.repeat(self._arm.home + bends, count * len(self._stances), axis=0)
        for index in range(positions.shape[1]):
            shift = starts[where] + progress[which, index, None] * (ends - starts)[where]
            position = (positions[which, index] - shift @ self._axes) @ turn
            solution = self._arm.solve(position, rotations[which, index], joints)
            miss = costs.miss_per_m * np.maximum(solution.position_error - costs.free_m, 0.0)
            miss += costs.miss_per_rad * solution.rotation_error
            margin = np.maximum(0.0, costs.near_limit_rad - solution.margin)
            cost = cost + np.minimum(miss, costs.most_miss) + costs.near_limit * margin
            keep = cost < costs.hopeless
            which, where, cost, joints = which[keep], where[keep], cost[keep], solution.joints[keep]
            solved = [*(earlier[keep] for earlier in solved), joints]
        if not len(which):
            return []
        rows = np.stack(solved, axis=1)
        cost = cost + costs.turn * np.abs(rows[:, -1] - self._present).max(axis=1)
        return [
            _Candidate(int(which[row]), self._stances[where[row]], float(cost[row]), rows[row])
            for row in np.argsort(cost, kind="stable")
        ]

    def legs(self, candidate: _Candidate) -> tuple[Shift, ...] | None:
        """Straight moves that end at a stance, with the arm as it is, if the base is clear of the part there."""
        start, end = candidate.stance
        if candidate.stance not in self._known:
            clear = self._clears(self._paths[candidate.path].waypoints[-1].angle, end)
            self._known[candidate.stance] = self._route(start) if clear else None
        return self._known[candidate.stance]

    def drive(self, candidate: _Candidate) -> float:
        """Cost of the drive to a stance beyond that of its straight line."""
        legs = self.legs(candidate) or ()
        longer = sum(float(np.hypot(*leg)) for leg in legs) - float(np.hypot(*candidate.stance[0]))
        return IN_CONTACT.drive_per_m * max(longer, 0.0) + IN_CONTACT.leg * max(len(legs) - 1, 0)

    def _route(self, shift: Shift) -> tuple[Shift, ...] | None:
        ahead, left = shift
        backs = [min(ahead, 0.0) - more for more in BACKS_M]
        round_about = [((back, 0.0), (0.0, left), (ahead - back, 0.0)) for back in backs]
        for legs in ((shift,), ((ahead, 0.0), (0.0, left)), *round_about):
            if self._free(legs):
                return tuple(leg for leg in legs if np.hypot(*leg) > 0.01)
        return None

    def _free(self, legs: tuple[Shift, ...]) -> bool:
        at: Array = np.zeros(2)
        places: list[Array] = []
        for leg in legs:
            count = int(np.ceil(float(np.hypot(*leg)) / LEG_STEP_M))
            places += [at + np.asarray(leg) * step / count for step in range(1, count + 1)]
            at = at + leg
        if not places:
            return True
        shifts = [(float(x), float(y)) for x, y in places]
        angles, may = [self._part.angle] * len(shifts), [True] * len(shifts)
        found = self._touched(angles, shifts, np.tile(self._present, (len(shifts), 1)), may, most=8)
        for place, count, bodies in zip(places, found.counts, found.bodies, strict=True):
            leant_on = self._leant_on if np.hypot(*place) < OFF_M else frozenset[int]()
            if set(bodies[:count].tolist()) - leant_on:
                return False
        return True

    def _clears(self, angle: float, shift: Shift) -> bool:
        """Whether the base is clear of the part at an angle; the arm need not be."""
        found = self._touched([angle], [shift], self._present[None], [False], most=1, links=(0,))
        return not found.counts[0]

    def poses(self, candidate: _Candidate) -> float:
        """Cost of the bodies touched at the poses, and of those that would be if the robot stood a bit higher."""
        costs, path = IN_CONTACT, self._paths[candidate.path]
        angles = [waypoint.angle for waypoint in path.waypoints]
        shifts = [_between(*candidate.stance, waypoint.progress) for waypoint in path.waypoints]
        may = [number >= path.contact for number in range(len(angles))]
        hits = self._touched(angles, shifts, candidate.joints, may).counts.sum()
        near = self._touched(angles, shifts, candidate.joints, may, most=1, raised_m=costs.clearance_m).counts.sum()
        return costs.hit_at_pose * float(hits) + costs.clearance * float(near)

    def between(self, candidate: _Candidate) -> float:
        """Cost of the bodies touched between the poses."""
        path, (start, end) = self._paths[candidate.path], candidate.stance
        angles, shifts, joints, may, groups = [], [], [], [], []
        for number, (last, waypoint) in enumerate(itertools.pairwise(path.waypoints), start=1):
            shift, there = (_between(start, end, at.progress) for at in (last, waypoint))
            one, other = candidate.joints[number - 1 : number + 1]
            for group, shares in enumerate(BETWEEN):
                for share in shares:
                    angles.append(last.angle + share * (waypoint.angle - last.angle))
                    shifts.append(_between(shift, there, share))
                    joints.append(one + share * (other - one))
                    may.append(number >= path.contact)
                    groups.append((number, group))
        if not groups:
            return 0.0
        counts = self._touched(angles, shifts, np.array(joints), may).counts
        worst: dict[tuple[int, int], int] = {}
        for where, count in zip(groups, counts, strict=True):
            worst[where] = max(worst.get(where, 0), int(count))
        return IN_CONTACT.hit * sum(worst.values())

    def straight(self, candidate: _Candidate) -> float:
        """Cost of the straight line to the first pose."""
        return self._approach(candidate).straight(self._present, candidate.joints[0])

    def detour(self, candidate: _Candidate) -> tuple[Array, float] | None:
        """A joint path (k, 7) to the first pose round what the straight line meets, and its cost."""
        key = np.ravel(np.asarray(candidate.stance))
        return self._approach(candidate).detour(self._present, candidate.joints[0], key)

    def _approach(self, candidate: _Candidate) -> Approach:
        may = self._paths[candidate.path].contact == 0

        def counts(joints: Array, margin_m: float) -> NDArray[np.int64]:
            many = len(joints)
            angles, shifts = [self._part.angle] * many, [candidate.stance[0]] * many
            return self._touched(angles, shifts, joints, [may] * many, margin_m=margin_m).counts

        return Approach(self._arm, counts, IN_CONTACT)

    def _touched(
        self,
        angles: list[float],
        shifts: list[Shift],
        joints: Array,
        may: list[bool],
        *,
        most: int = IN_CONTACT.most_hits,
        raised_m: float = 0.0,
        margin_m: float = 0.0,
        links: tuple[int, ...] | None = None,
    ) -> Touched:
        moves = np.asarray(shifts, dtype=np.float64).reshape(-1, 2) @ self._axes[:, :2]
        bases = np.column_stack([self._base[:2] + moves, np.full(len(moves), self._base[2])])
        return self._checker.touched(
            bases,
            joints,
            part=self._moving,
            states=np.array([self._states[round(angle, 6)] for angle in angles]),
            hand_may=np.array(may),
            raised_m=raised_m,
            margin_m=margin_m,
            most=most,
            links=links,
        )


def _between(start: Shift, end: Shift, share: float) -> Shift:
    return (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
