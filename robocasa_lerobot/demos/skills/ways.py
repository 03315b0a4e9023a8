"""Which way the hand goes, and from where the robot stands: many ways are solved at once, the best ones are tested.

A way is a row of hand poses. Its cost counts misses, joints near their limits, far drives, and what the robot, or an
object that it holds, would meet at the poses and half-way between them.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import (
    Array,
    HandTarget,
    arm_action,
    base_pose,
    grip_position,
    hand_rotation,
    pose_error,
)
from robocasa_lerobot.demos.motion_style import variety_of
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.navigation import Room, drive_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE, MOBILE_BASE
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

GOOD_ENOUGH = 0.8  # cost up to which no other place to stand is looked at
_SHORTLIST, _TESTED = 160, 60
_NEAR_LIMIT_RAD = 0.25
_MISS_PER_M, _MISS_PER_RAD, _MOST_MISS = 30.0, 2.0, 4.0
_HIT, _MOST_HITS = 0.5, 3
_DRIVE, _DRIVE_PER_M = 0.25, 0.4
AHEAD_M, LEFT_M = (0.45, 0.55, 0.65, 0.75), (0.0, -0.15, 0.15, -0.3, 0.3)
NEAR_M = 0.08  # a drive as short as this is not tested
FOLDED_RAD = 0.35
LEAD_M, LEAD_RAD, LEAD_STEPS = 0.06, 0.5, 10  # between the poses that the hand is led along
ARRIVED_M, BLOCKED_M, MOST_DRIVES = 0.05, 0.10, 3


@dataclass(frozen=True)
class Held:
    """A body in the gripper: it goes where the hand goes.

    Attributes:
        name: of the body.
        position: of its origin from the grip site, in the hand's axes, metres.
        rotation: in the hand's axes.
        contents: what lies in it, and goes along.
    """

    name: str
    position: Array
    rotation: Array
    contents: tuple[Held, ...] = ()

    @classmethod
    def now(cls, data: mujoco.MjData, name: str, contents: tuple[str, ...] = ()) -> Held:
        """As it lies in the hand at present, with the bodies that lie in it."""
        hand, body = hand_rotation(data), data.body(name)
        position, rotation = hand.T @ (body.xpos - grip_position(data)), hand.T @ body.xmat.reshape(3, 3)
        return cls(name, position, rotation, tuple(cls.now(data, other) for other in contents))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all bodies that go along."""
        return (self.name, *(other.name for other in self.contents))


@dataclass(frozen=True)
class Way:
    """A row of hand poses.

    Attributes:
        targets: all ways that are compared have the same number.
        extra: cost that it has in any case.
        takes: what is in the gripper after the pose that is solved first, as it will be.
    """

    targets: tuple[HandTarget, ...]
    extra: float = 0.0
    takes: Held | None = None


@dataclass(frozen=True)
class Choice:
    """A way, where to stand, the cost (from about 2 on it will not do), and the joint angles of the first pose."""

    way: Way
    stand: RobotPose | None
    cost: float
    joints: Array


def choose(
    env: KitchenEnv,
    ways: Sequence[Way],
    point: Array,
    *,
    key: int,
    held: Held | None = None,
    loaded: int = 0,
    allowed: frozenset[int] = frozenset(),
    blocked: Sequence[RobotPose] = (),
) -> list[Choice]:
    """The ways that cost least, best first, from where the robot stands or from where it could.

    Args:
        env: its state is read, not touched.
        ways: alternatives.
        point: what the robot stands before, world, metres.
        key: index of the pose that is solved first.
        held: what is in the gripper.
        loaded: number of poses, from the first on, at which it still is.
        allowed: bodies that the robot may touch.
        blocked: places that the base did not get to.
    """
    if not ways:
        return []
    planner = _Planner(env, list(ways), key, held, loaded, allowed)
    found = planner.best([None])
    if (found and found[0].cost <= GOOD_ENOUGH) or len(blocked) >= MOST_DRIVES:
        return found
    stands = [s for s in _stands(env, point) if all(np.hypot(s.x - b.x, s.y - b.y) > BLOCKED_M for b in blocked)]
    return sorted(found + planner.best(stands), key=lambda choice: choice.cost)


def approach(
    env: KitchenEnv, plan: Callable[[Sequence[RobotPose]], Choice], gripper: float
) -> Generator[Array, None, Choice]:
    """Choose a way and drive to where it begins; choose another one where the base does not get there."""
    blocked: list[RobotPose] = []
    while True:
        choice = plan(blocked)
        if choice.stand is None:
            return choice
        yield from go_to(env, choice.stand, gripper)
        base, _ = base_pose(env.data)
        if np.hypot(choice.stand.x - base[0], choice.stand.y - base[1]) < ARRIVED_M:
            return choice
        blocked.append(choice.stand)


def lead(env: KitchenEnv, joints: Array, gripper: float) -> Iterator[Array]:
    """Lead the hand as it goes when all joints turn evenly to `joints`, (7,) radians: the way that has been tested."""
    arm = Arm(env.model, env.data)
    start = np.array(env.data.qpos[arm.addresses])
    ends, turns, _ = arm.forward(np.stack([start, joints]))
    far = float(np.linalg.norm(ends[1] - ends[0])) + 0.15 * float(np.abs(joints - start).max())
    count = max(int(np.ceil(far / LEAD_M)), 1)
    shares = np.arange(1, count + 1)[:, None] / count
    positions, turns, _ = arm.forward(start + shares * (joints - start))
    for position, turn in zip(positions, turns, strict=True):
        frame = env.data.site(ARM_CENTER_SITE)
        axes = frame.xmat.reshape(3, 3)
        target = HandTarget(frame.xpos + axes @ position, axes @ turn)
        for _ in range(LEAD_STEPS):
            error = pose_error(env.data, target)
            if error.position < LEAD_M and error.rotation < LEAD_RAD:
                break
            yield arm_action(env.data, target, gripper)


def go_to(env: KitchenEnv, stand: RobotPose, gripper: float) -> Iterator[Array]:
    """Drive with the arm folded as at the start, as near as it gets."""
    home, arm = np.array(PANDA_OMRON.home.arm), Arm(env.model, env.data)
    if np.abs(env.data.qpos[arm.addresses] - home).max() > FOLDED_RAD:
        yield from lead(env, home, gripper)
    with contextlib.suppress(SkillError):
        yield from drive_to(env, stand.x, stand.y, stand.yaw, gripper=gripper, tolerance_m=0.025)


def _stands(env: KitchenEnv, point: Array) -> Iterator[RobotPose]:
    """Free places from where a point is ahead, the heading kept."""
    _, yaw = base_pose(env.data)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    room = Room(env.scene)
    for far in AHEAD_M:
        for aside in LEFT_M:
            x, y = (point[:2] - far * ahead - aside * left).tolist()
            pose = RobotPose(x, y, yaw)
            if room.free(pose):
                yield pose


class _Planner:
    def __init__(
        self,
        env: KitchenEnv,
        ways: list[Way],
        key: int,
        held: Held | None,
        loaded: int,
        allowed: frozenset[int],
    ) -> None:
        model = env.model
        self._env, self._ways, self._key = env, ways, key
        self._held, self._loaded, self._allowed = held, loaded, allowed
        self._arm = Arm(model, env.data)
        self._scratch = copy.copy(env.data)
        self._robot = env.scene.subtree(MOBILE_BASE)
        # What it leans on already is no reason not to go: an open drawer before the base, for one.
        self._allowed |= self._touched(model, self._scratch, self._robot)
        # (ways, poses, 3) and (ways, poses, 3, 3)
        self._positions = np.array([[t.position for t in way.targets] for way in ways])
        self._rotations = np.array([[t.rotation for t in way.targets] for way in ways])
        variety = variety_of(env)
        self._extra = np.array([way.extra - variety.bonus(way.targets[key].rotation) for way in ways])
        keys = np.column_stack([self._positions[:, key], self._rotations[:, key].reshape(len(ways), 9)])
        self._same = np.unique(keys.round(4), axis=0, return_inverse=True)[1].reshape(-1)

    def best(self, stands: Sequence[RobotPose | None]) -> list[Choice]:
        """Choices among all ways from all stands; the costs of the first ones are complete."""
        if not stands:
            return []
        poses = [self._pose(stand) for stand in stands]
        starts = [self._start(stand) for stand in stands]
        count = len(self._ways)
        which = np.tile(np.arange(count), len(stands))
        where = np.repeat(np.arange(len(stands)), count)
        drive = np.array([self._drive(stand) for stand in stands])
        cost = self._extra[which] + drive[where]
        start = np.array(starts)[where]
        # Many ways differ in how they come and go only.
        same = self._same[which] + where * count
        _, first, back = np.unique(same, return_index=True, return_inverse=True)
        joints, missed = self._solve(which[first], where[first], poses, self._key, start[first])
        joints, missed = joints[back], missed[back]
        cost = cost + missed + 0.1 * np.abs(joints - start).max(axis=1)
        short = np.argsort(cost)[:_SHORTLIST]
        which, where, cost, start = which[short], where[short], cost[short], start[short]
        solved = [start]
        for index in range(self._positions.shape[1]):
            joints, more = self._solve(which, where, poses, index, solved[-1])
            solved.append(joints)
            if index != self._key:
                cost = cost + 0.7 * more
        found: list[Choice] = []
        least = np.inf
        for number, row in enumerate(np.argsort(cost)):
            if cost[row] > least or number >= _TESTED:
                break
            hits = self._hits(self._ways[which[row]], poses[where[row]], [joints[row] for joints in solved])
            total = float(cost[row]) + hits
            least = min(least, total)
            found.append(Choice(self._ways[which[row]], stands[where[row]], total, solved[1][row]))
        return sorted(found, key=lambda choice: choice.cost)

    def _pose(self, stand: RobotPose | None) -> tuple[float, float, float]:
        if stand is not None:
            return stand.x, stand.y, stand.yaw
        base, yaw = base_pose(self._env.data)
        return float(base[0]), float(base[1]), yaw

    def _start(self, stand: RobotPose | None) -> Array:
        if stand is not None:
            return np.array(PANDA_OMRON.home.arm)
        return np.array(self._env.data.qpos[self._arm.addresses])

    def _drive(self, stand: RobotPose | None) -> float:
        if stand is None:
            return 0.0
        base, _ = base_pose(self._env.data)
        return _DRIVE + _DRIVE_PER_M * float(np.hypot(stand.x - base[0], stand.y - base[1]))

    def _solve(
        self,
        which: NDArray[np.intp],
        where: NDArray[np.intp],
        poses: list[tuple[float, float, float]],
        index: int,
        start: Array,
    ) -> tuple[Array, Array]:
        """Joints (n, 7) at one pose of each way, and what they cost (n,)."""
        x, y, yaw = np.array(poses)[where].T
        height = self._env.data.site(ARM_CENTER_SITE).xpos[2]
        origin = np.column_stack([x, y, np.full_like(x, height)])
        turn = np.zeros((len(where), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw)
        turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = np.sin(yaw), -np.sin(yaw), 1.0
        position = (turn @ (self._positions[which, index] - origin)[..., None])[..., 0]
        solution = self._arm.solve(position, turn @ self._rotations[which, index], start)
        miss = _MISS_PER_M * np.maximum(solution.position_error - 0.003, 0.0)
        miss += _MISS_PER_RAD * np.maximum(solution.rotation_error - 0.03, 0.0)
        cost = np.minimum(miss, _MOST_MISS) + 2.0 * np.maximum(0.0, _NEAR_LIMIT_RAD - solution.margin)
        return solution.joints, cost

    def _hits(self, way: Way, pose: tuple[float, float, float], joints: list[Array]) -> float:
        """Cost of what is met from the start to the last pose."""
        model, data = self._env.model, self._scratch
        data.qpos[:] = self._env.data.qpos
        cost = self._hits_on_drive(pose, joints[0])
        PANDA_OMRON.place_base(model, data, *pose)
        for index in range(1, len(joints)):
            for share in (0.2, 0.4, 0.6, 0.8, 1.0) if index == 1 else (0.5, 1.0):
                data.qpos[self._arm.addresses] = (1 - share) * joints[index - 1] + share * joints[index]
                mujoco.mj_kinematics(model, data)
                mine = self._robot
                held = self._held if index <= self._loaded else way.takes if index > self._key + 1 else None
                if held is not None:
                    self._bring(data, held)
                    mine = self._robot | self._env.scene.subtree(*held.names)
                cost += _HIT * min(self._met(model, data, mine), _MOST_HITS)
        return cost

    def _hits_on_drive(self, pose: tuple[float, float, float], joints: Array) -> float:
        """Cost of what the robot meets half-way to where it will stand, open doors for instance."""
        here = self._pose(None)
        if np.hypot(pose[0] - here[0], pose[1] - here[1]) < NEAR_M:
            return 0.0
        model, data = self._env.model, self._scratch
        data.qpos[self._arm.addresses] = joints
        cost = 0.0
        for share in (0.35, 0.7, 1.0):
            PANDA_OMRON.place_base(model, data, *((1 - share) * a + share * b for a, b in zip(here, pose, strict=True)))
            mujoco.mj_kinematics(model, data)
            cost += _HIT * min(self._met(model, data, self._robot), _MOST_HITS)
        return cost

    def _bring(self, data: mujoco.MjData, held: Held) -> None:
        hand, grip = hand_rotation(data), grip_position(data)
        for body in (held, *held.contents):
            quat = np.empty(4)
            mujoco.mju_mat2Quat(quat, np.ascontiguousarray(hand @ body.rotation).reshape(9))
            data.joint(f"{body.name}_joint0").qpos[:] = [*(grip + hand @ body.position), *quat]
        mujoco.mj_kinematics(self._env.model, data)

    def _met(self, model: mujoco.MjModel, data: mujoco.MjData, mine: NDArray[np.bool_]) -> int:
        return len(self._touched(model, data, mine) - self._allowed)

    @staticmethod
    def _touched(model: mujoco.MjModel, data: mujoco.MjData, mine: NDArray[np.bool_]) -> set[int]:
        mujoco.mj_collision(model, data)
        if data.ncon == 0:
            return set()
        pairs = model.geom_bodyid[data.contact.geom]
        inside = mine[pairs]
        crossed = (inside[:, 0] != inside[:, 1]) & (data.contact.dist < 0.0)
        others = np.where(inside[:, 0], pairs[:, 1], pairs[:, 0])[crossed]
        return set(others.tolist())
