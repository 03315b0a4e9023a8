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

from robocasa_lerobot.demos.motion import (
    Array,
    HandTarget,
    base_pose,
    pose_error,
)
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.hinged import Hinged
from robocasa_lerobot.demos.skills.reach import move_base_to, solve_arm
from robocasa_lerobot.envs.control.indices import joint_positions, joint_velocities
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_names import ARM_JOINTS, HAND, MOBILE_BASE

Shift = tuple[float, float]

# Half extents of the closed finger tips along the hand's axes, metres, from the grip site.
FINGER_HALF_M = np.array([0.011, 0.026, 0.011])
STANDOFF_M = 0.09  # of the hand before it grasps
ARM_FOOT = "robot0_link0"
GOOD_ENOUGH, HOPELESS = 0.35, 2.0
REACH_M = 1.05  # from the arm's shoulder to the grip site
SHOULDER_M = 0.333  # above the arm's foot
_NEAR_LIMIT_RAD = 0.2
BACK_M = 0.25  # that the base goes back before it goes to the side, where it cannot go straight


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
    """

    way: Way
    start: Shift
    end: Shift
    cost: float
    legs: tuple[Shift, ...]


def plan_arc(env: KitchenEnv, part: Hinged, ways: Iterable[Way], stances: Iterable[tuple[Shift, Shift]]) -> ArcPlan:
    """The best way, or the first that is good enough, of those that can be reached without touching what is not meant.

    Args:
        env: its state is read, not touched.
        part: what is moved.
        ways: alternatives.
        stances: moves of the base to try in this order: before, and by the end.

    Raises:
        SkillError: there is none.
    """
    bench = _Bench(env, part)
    options = list(ways)
    assert options, "no way to plan"
    best = ArcPlan(options[0], (0.0, 0.0), (0.0, 0.0), np.inf, ())
    for start, end in stances:
        far = 0.15 * float(np.hypot(*start)) + 0.1 * float(np.hypot(end[0] - start[0], end[1] - start[1]))
        legs = bench.route(start) if bench.clears(options[0].vias[-1].angle, end) else None
        if legs is None:
            continue
        for way in options:
            cost = far + bench.cost(way, start, end, min(best.cost, HOPELESS) - far)
            if cost < best.cost:
                best = ArcPlan(way, start, end, cost, legs)
        if best.cost < GOOD_ENOUGH:
            break
    if not np.isfinite(best.cost):
        raise SkillError(f"{part.name}: the arm reaches nowhere along its arc")
    return best


class _Bench:
    """A copy of the state on which poses are tried."""

    def __init__(self, env: KitchenEnv, part: Hinged) -> None:
        self._env, self._part = env, part
        self._model, self._data = env.model, copy.copy(env.data)
        self._arm = joint_positions(env.model, ARM_JOINTS)
        self._dofs = joint_velocities(env.model, ARM_JOINTS)
        self._home = env.data.qpos[self._arm].copy()
        self._ranges = np.array([env.model.joint(name).range for name in ARM_JOINTS])
        self._robot = env.scene.subtree(MOBILE_BASE)
        self._hand = env.scene.subtree(HAND)
        self._reaching = env.scene.subtree(ARM_FOOT)
        base, yaw = base_pose(env.data)
        self._shoulder = base + np.array([0.0, 0.0, SHOULDER_M])
        self._axes = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])

    def route(self, shift: Shift) -> tuple[Shift, ...] | None:
        """Straight moves, with the arm as it is, that end at a shift without touching anything; None if not found."""
        ahead, left = shift
        back = min(ahead, 0.0) - BACK_M
        for legs in (
            (shift,),
            ((ahead, 0.0), (0.0, left)),
            ((back, 0.0), (0.0, left), (ahead - back, 0.0)),
        ):
            if self._free(legs):
                return tuple(leg for leg in legs if np.hypot(*leg) > 0.01)
        return None

    def _free(self, legs: tuple[Shift, ...]) -> bool:
        self._data.qpos[:] = self._env.data.qpos
        at = np.zeros(2)
        for leg in legs:
            count = int(np.ceil(float(np.hypot(*leg)) / 0.08))
            for step in range(1, count + 1):
                x, y = at + np.asarray(leg) * step / count
                self._place(self._part.angle, (x, y))
                if self._touched(hand_may=True):
                    return False
            at += leg
        return True

    def clears(self, angle: float, shift: Shift) -> bool:
        """Whether the base is out of the part's way at an angle; the arm may still be."""
        self._place(angle, shift)
        return not self._touched(hand_may=False, only=self._robot & ~self._reaching)

    def cost(self, way: Way, start: Shift, end: Shift, bound: float) -> float:
        """Cost of a way; no more of it is looked at once it exceeds `bound`."""
        cost = way.bias
        for via in way.vias:
            shift = self._shift(start, end, via.progress)
            shoulder = self._shoulder + shift[0] * self._axes[0] + shift[1] * self._axes[1]
            if np.linalg.norm(via.target.position - shoulder) > REACH_M:
                return np.inf
        self._data.qpos[:] = self._env.data.qpos
        for number, via in enumerate(way.vias):
            self._place(via.angle, self._shift(start, end, via.progress))
            solve_arm(self._model, self._data, via.target, self._arm, self._dofs, self._home, self._ranges)
            error = pose_error(self._data, via.target)
            joints = self._data.qpos[self._arm]
            margin = float(np.minimum(joints - self._ranges[:, 0], self._ranges[:, 1] - joints).min())
            cost += min(20.0 * max(error.position - 0.005, 0.0) + 1.0 * error.rotation, 4.0)
            cost += max(0.0, _NEAR_LIMIT_RAD - margin) * 1.0
            if cost > bound:
                return np.inf
            cost += 0.8 * min(self._touched(hand_may=number >= way.contact), 3)
        return cost + 0.05 * float(np.abs(self._data.qpos[self._arm] - self._home).max())

    @staticmethod
    def _shift(start: Shift, end: Shift, progress: float) -> Shift:
        return (start[0] + progress * (end[0] - start[0]), start[1] + progress * (end[1] - start[1]))

    def _place(self, angle: float, shift: Shift) -> None:
        arm = self._data.qpos[self._arm].copy()
        self._data.qpos[:] = self._env.data.qpos
        self._data.qpos[self._arm] = arm
        self._part.place(self._data, angle)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        move_base_to(self._model, self._data, shift)

    def _touched(self, *, hand_may: bool, only: NDArray[np.bool_] | None = None) -> int:
        """Number of bodies that the robot, or `only` these of it, touch; the hand may touch the part, if `hand_may`."""
        mine_all = self._robot if only is None else only
        mujoco.mj_collision(self._model, self._data)
        touched = set()
        pairs = self._model.geom_bodyid[self._data.contact.geom]
        for (a, b), distance in zip(pairs, self._data.contact.dist, strict=True):
            for mine, other in ((int(a), int(b)), (int(b), int(a))):
                if not mine_all[mine] or self._robot[other] or distance >= 0.0:
                    continue
                if not (hand_may and self._hand[mine] and other == self._part.body):
                    touched.add(other)
        return len(touched)


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
    """

    def target_at(angle: float) -> HandTarget:
        rotation, out = rotation_at(angle), part.turned(angle) @ normal
        support = float(FINGER_HALF_M @ np.abs(rotation.T @ out))
        return HandTarget(part.point(local, angle) + out * support, rotation)

    start = part.angle
    at = target_at(start)
    off = HandTarget(at.position + part.turned(start) @ normal * off_m, at.rotation)
    back = HandTarget(off.position - at.rotation[:, 2] * back_m, at.rotation)
    arc = arc_vias(start, end, target_at, (0.0, 0.5, 1.0))
    return Way((Via(start, back), Via(start, off), *arc), 2, target_at)


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
