"""The arc of a hinged part as the robot goes along with it, planned on a copy of the state.

A plan says where the base stands when the hand first touches the part and where it stands at the end of the arc: long
doors are followed with the base as well as with the arm.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array, HandTarget, base_pose, floor_axes
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.hinged import Hinged
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE, HAND, MOBILE_BASE, TORSO_JOINT
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

Shift = tuple[float, float]

# Half extents of the closed finger tips along the hand's axes, metres, from the grip site.
CLOSED_FINGERS_HALF_M = np.array(PANDA_OMRON.gripper.closed_half)
STANDOFF_M = 0.09  # of the hand before it grasps
ARM_FOOT = "robot0_link0"
HOPELESS, MOST_TESTED = 2.0, 80
# Shares of the way to the first pose, and from one pose to the next, that are tested, with the cost of what is met.
BEFORE, BETWEEN = ((0.3, 0.3), (0.6, 0.3), (0.8, 0.3), (1.0, 0.8)), ((0.33, 0.3), (0.67, 0.3), (1.0, 0.8))
CLEAR_M, CLEARANCE = 0.018, 0.25  # kept from what is above, with the cost of less
_DRIVE, _ALONG = 0.15, 0.10  # cost of a metre that the base goes before, and as the part turns
_NEAR_LIMIT_RAD = 0.2
OFF_M = 0.12  # after which the base no longer leans on what it leant on
BACKS_M = (0.25, 0.5, 0.75)  # that the base goes back before it goes to the side, where it cannot go straight


@dataclass(frozen=True, eq=False)
class Via:
    """A pose of the hand on the way: with the part at `angle`, and the base `progress` of its way along (0 to 1)."""

    angle: float
    target: HandTarget
    progress: float = 0.0


@dataclass(frozen=True, eq=False)
class Way:
    """One way to do it.

    Attributes:
        vias: poses in their order, those off the part first.
        contact: number of the first pose in which the hand may touch the part.
        target_at: wanted pose of the hand with the part at an angle.
        bias: added to the cost of what is known to hold worse.
    """

    vias: tuple[Via, ...]
    contact: int
    target_at: Callable[[float], HandTarget]
    bias: float = 0.0


@dataclass(frozen=True, eq=False)
class ArcPlan:
    """A way, and where the base stands for it.

    Attributes:
        way: of the hand.
        start, end: moves of the base from where it stands now, metres forward and to the left: before, and by the end.
        cost: how bad it is; above 1 it is not to be had without a collision or a miss.
        legs: straight moves that make up the first one.
        joints: of the arm at the first pose, (7,) radians.
    """

    way: Way
    start: Shift
    end: Shift
    cost: float
    legs: tuple[Shift, ...]
    joints: Array


def plan_arc(env: KitchenEnv, part: Hinged, ways: Iterable[Way], stances: Iterable[tuple[Shift, Shift]]) -> ArcPlan:
    """The way that costs least of those that can be reached without touching what is not meant.

    All ways are solved at once from all stances; only the cheapest ones are tested for what they meet. So planning
    takes a bounded time, also for what is out of reach.

    Args:
        env: its state is read, not touched.
        part: what is moved.
        ways: alternatives, all with the same number of poses.
        stances: moves of the base to try: before, and by the end.

    Raises:
        SkillError: there is none.
    """
    options = list(ways)
    assert options, "no way to plan"
    bench = _Bench(env, part, options, list(stances))
    best: ArcPlan | None = None
    tested = 0
    for candidate in bench.reached():
        if tested >= MOST_TESTED or (best is not None and candidate.cost >= best.cost):
            break
        legs = bench.legs(candidate)
        if legs is None:
            continue
        tested += 1
        cost = candidate.cost + bench.hits(candidate, HOPELESS if best is None else best.cost - candidate.cost)
        if best is None or cost < best.cost:
            joints = candidate.joints[0]
            best = ArcPlan(options[candidate.way], *candidate.stance, cost, legs, joints)
    if best is None:
        raise SkillError(f"{part.name}: the arm reaches nowhere along its arc")
    return best


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A way from a stance, with joint angles (poses, 7), and what it costs but for what it meets."""

    way: int
    stance: tuple[Shift, Shift]
    cost: float
    joints: Array


class _Bench:
    """A copy of the state on which poses are tried."""

    def __init__(self, env: KitchenEnv, part: Hinged, ways: list[Way], stances: list[tuple[Shift, Shift]]) -> None:
        self._env, self._part, self._ways, self._stances = env, part, ways, stances
        self._model, self._data = env.model, copy.copy(env.data)
        self._arm = Arm(env.model, env.data)
        self._present = env.data.qpos[self._arm.addresses].copy()
        self._robot = env.scene.subtree(MOBILE_BASE)
        self._hand = env.scene.subtree(HAND)
        self._reaching = env.scene.subtree(ARM_FOOT)
        self._own = self._robot & ~self._reaching  # the base
        base, yaw = base_pose(env.data)
        self._base = (float(base[0]), float(base[1]), yaw)
        self._axes = floor_axes(yaw)
        # What it leans on already is no reason not to drive off: the part that it has just let go, for one.
        self._leant_on = self._touched(hand_may=True)
        self._known: dict[tuple[Shift, Shift], tuple[Shift, ...] | None] = {}

    def reached(self) -> list[_Candidate]:
        """What the arm reaches, the cheapest first."""
        frame = self._env.data.site(ARM_CENTER_SITE)
        turn = frame.xmat.reshape(3, 3)
        ways, count = self._ways, len(self._ways)
        vias = len(ways[0].vias)
        positions = np.array([[via.target.position for via in way.vias] for way in ways]) - frame.xpos
        rotations = turn.T @ np.array([[via.target.rotation for via in way.vias] for way in ways])
        progress = np.array([[via.progress for via in way.vias] for way in ways])
        starts, ends = (np.array([stance[index] for stance in self._stances]) for index in (0, 1))
        which = np.tile(np.arange(count), len(self._stances))
        where = np.repeat(np.arange(len(self._stances)), count)
        drive = np.hypot(*(ends - starts).T)
        cost = np.array([way.bias for way in ways])[which]
        cost = cost + (_DRIVE * np.hypot(*starts.T) + _ALONG * drive)[where]
        solved: list[Array] = []
        joints = np.tile(np.array(PANDA_OMRON.home.arm), (len(which), 1))
        for index in range(vias):
            shift = starts[where] + progress[which, index, None] * (ends - starts)[where]
            position = (positions[which, index] - shift @ self._axes) @ turn
            solution = self._arm.solve(position, rotations[which, index], joints)
            miss = 20.0 * np.maximum(solution.position_error - 0.005, 0.0) + solution.rotation_error
            cost = cost + np.minimum(miss, 4.0) + np.maximum(0.0, _NEAR_LIMIT_RAD - solution.margin)
            keep = cost < HOPELESS
            which, where, cost, joints = which[keep], where[keep], cost[keep], solution.joints[keep]
            solved = [*(earlier[keep] for earlier in solved), joints]
        if not len(which):
            return []
        cost = cost + 0.05 * np.abs(joints - self._present).max(axis=1)
        rows = np.stack(solved, axis=1)
        return [
            _Candidate(int(which[row]), self._stances[where[row]], float(cost[row]), rows[row])
            for row in np.argsort(cost, kind="stable")
        ]

    def legs(self, candidate: _Candidate) -> tuple[Shift, ...] | None:
        """Straight moves that end at a stance, with the arm as it is, if the base is out of the part's way there."""
        start, end = candidate.stance
        if candidate.stance not in self._known:
            clear = self._clears(self._ways[candidate.way].vias[-1].angle, end)
            self._known[candidate.stance] = self._route(start) if clear else None
        return self._known[candidate.stance]

    def _route(self, shift: Shift) -> tuple[Shift, ...] | None:
        ahead, left = shift
        backs = [min(ahead, 0.0) - more for more in BACKS_M]
        round_about = [((back, 0.0), (0.0, left), (ahead - back, 0.0)) for back in backs]
        for legs in ((shift,), ((ahead, 0.0), (0.0, left)), *round_about):
            if self._free(legs):
                return tuple(leg for leg in legs if np.hypot(*leg) > 0.01)
        return None

    def _free(self, legs: tuple[Shift, ...]) -> bool:
        at = np.zeros(2)
        for leg in legs:
            count = int(np.ceil(float(np.hypot(*leg)) / 0.08))
            for step in range(1, count + 1):
                x, y = at + np.asarray(leg) * step / count
                self._place(self._part.angle, (float(x), float(y)), self._present)
                leant_on = self._leant_on if np.hypot(x, y) < OFF_M else set()
                if self._touched(hand_may=True) - leant_on:
                    return False
            at += leg
        return True

    def _clears(self, angle: float, shift: Shift) -> bool:
        """Whether the base is out of the part's way at an angle; the arm may still be."""
        self._place(angle, shift, self._present)
        return not self._touched(hand_may=False, only=self._own)

    def hits(self, candidate: _Candidate, bound: float) -> float:
        """Cost of what is met at the poses of a candidate and half-way between them, up to about `bound`."""
        way, (start, end) = self._ways[candidate.way], candidate.stance
        cost = 0.0
        before, angle, shift = self._present, self._part.angle, start
        for number, (via, joints) in enumerate(zip(way.vias, candidate.joints, strict=True)):
            there = self._shift(start, end, via.progress)
            for share, weight in BEFORE if number == 0 else BETWEEN:
                at = (shift[0] + share * (there[0] - shift[0]), shift[1] + share * (there[1] - shift[1]))
                self._place(angle + share * (via.angle - angle), at, before + share * (joints - before))
                cost += weight * min(len(self._touched(hand_may=number >= way.contact)), 3)
                if share == 1.0:
                    self._raise()
                    cost += CLEARANCE * min(len(self._touched(hand_may=number >= way.contact)), 1)
            before, angle, shift = joints, via.angle, there
            if cost > bound:
                break
        return cost

    @staticmethod
    def _shift(start: Shift, end: Shift, progress: float) -> Shift:
        return (start[0] + progress * (end[0] - start[0]), start[1] + progress * (end[1] - start[1]))

    def _place(self, angle: float, shift: Shift, joints: Array) -> None:
        x, y, yaw = self._base
        ahead, left = self._axes[:, :2]
        to = shift[0] * ahead + shift[1] * left
        self._data.qpos[:] = self._env.data.qpos
        self._data.qpos[self._arm.addresses] = joints
        self._part.place(self._data, angle)
        PANDA_OMRON.place_base(self._model, self._data, x + float(to[0]), y + float(to[1]), yaw)
        mujoco.mj_kinematics(self._model, self._data)

    def _raise(self) -> None:
        """Put the robot a bit higher: what it would meet then is too near, most of all wall cabinets."""
        self._data.joint(TORSO_JOINT).qpos[0] += CLEAR_M
        mujoco.mj_kinematics(self._model, self._data)

    def _touched(self, *, hand_may: bool, only: NDArray[np.bool_] | None = None) -> set[int]:
        """The bodies that the robot, or `only` these of it, touch; the hand may touch the part, if `hand_may`.

        The robot's own base is among them where the hand comes down on it.
        """
        mine_all = self._robot if only is None else only
        mujoco.mj_collision(self._model, self._data)
        touched: set[int] = set()
        if self._data.ncon == 0:
            return touched
        pairs = self._model.geom_bodyid[self._data.contact.geom]
        deep = self._data.contact.dist < 0.0
        on_base = (self._hand[pairs].sum(axis=1) == 1) & (self._own[pairs].sum(axis=1) == 1)
        touched.update(int(body) for body in pairs[deep & on_base].ravel() if self._own[body])
        crossed = deep & (self._robot[pairs].sum(axis=1) == 1)
        for a, b in pairs[crossed]:
            mine, other = (int(a), int(b)) if self._robot[a] else (int(b), int(a))
            if mine_all[mine] and not (hand_may and self._hand[mine] and other == self._part.body):
                touched.add(other)
        return touched


def arc_vias(
    start: float, end: float, target_at: Callable[[float], HandTarget], shares: tuple[float, ...]
) -> list[Via]:
    """Poses at some shares of the way from one angle to another, radians."""
    angles = [start + (end - start) * share for share in shares]
    return [Via(angle, target_at(angle), share) for angle, share in zip(angles, shares, strict=True)]


def face_way(
    part: Hinged,
    local: Array,
    normal: Array,
    rotation_at: Callable[[float], Array],
    end: float,
    *,
    off_m: float = 0.06,
    back_m: float = 0.10,
    bias: float = 0.0,
) -> Way:
    """A way to push on a face with the closed finger tips.

    Args:
        part: what is pushed, from where it stands now.
        local: the point of the face, in the fixture's axes from the hinge as it lies when shut, metres, (3,).
        normal: of the face towards the hand, same axes, (3,).
        rotation_at: hand rotation (3, 3) wanted at an angle.
        end: angle at which it ends, radians.
        off_m: how far off the face the hand comes, before it touches it.
        back_m: how far back from there along its fingers it comes from.
        bias: of the way.
    """

    def target_at(angle: float) -> HandTarget:
        rotation, out = rotation_at(angle), part.turned(angle) @ normal
        support = float(CLOSED_FINGERS_HALF_M @ np.abs(rotation.T @ out))
        return HandTarget(part.point(local, angle) + out * support, rotation)

    start = part.angle
    at = target_at(start)
    off = HandTarget(at.position + part.turned(start) @ normal * off_m, at.rotation)
    back = HandTarget(off.position - at.rotation[:, 2] * back_m, at.rotation)
    arc = arc_vias(start, end, target_at, (0.0, 0.5, 1.0))
    return Way((Via(start, back), Via(start, off), *arc), 2, target_at, bias)


def grip_way(
    part: Hinged, local: Array, rotation_at: Callable[[float], Array], end: float, *, bias: float = 0.0
) -> Way:
    """A way to hold a point of a part between the finger tips and lead it; arguments as for `face_way`."""

    def target_at(angle: float) -> HandTarget:
        return HandTarget(part.point(local, angle), rotation_at(angle))

    start = part.angle
    at = target_at(start)
    before = HandTarget(at.position - at.rotation[:, 2] * STANDOFF_M, at.rotation)
    arc = arc_vias(start, end, target_at, (0.5, 1.0))
    return Way((Via(start, before), Via(start, at), *arc), 1, target_at, bias)
