"""Where to stand and how to hold the hand, of hundreds of ways: they are solved at once, the best ones are tested.

The same question as `reach.plan_reach` answers for few ways, one after the other and as closely as the arm's controller
goes there. Planning takes a bounded time here, also for what is out of reach.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import Array, HandTarget, base_pose
from robocasa_lerobot.demos.motion_style import variety_of
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.skills.reach import GOOD_ENOUGH, Plan, collisions
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

_WORSE = 0.6  # what ways worse than the best by this much meet is not tested
_TESTED = 60  # ways from each stand for which it is tested
_UNTESTED = 1.0  # cost of what has not been tested
_NEAR_LIMIT_RAD = 0.25


def plan_reach_of_many(
    env: KitchenEnv,
    ways: Iterable[tuple[HandTarget, ...]],
    shifts: Iterable[tuple[float, float]],
    *,
    allowed: frozenset[int] = frozenset(),
) -> list[Plan]:
    """Ways to reach, the best first; arguments as for `reach.plan_reach`, all ways with the same number of poses."""
    bench = _Bench(env, [tuple(way) for way in ways], allowed)
    plans: list[Plan] = []
    best = np.inf
    for shift in shifts:
        plans += bench.plans(shift, best + _WORSE)
        best = min(plan.cost for plan in plans)
        if best < GOOD_ENOUGH:
            break
    variety = variety_of(env)
    return sorted(plans, key=lambda plan: plan.cost - variety.bonus(plan.targets[-1].rotation))


class _Bench:
    """A copy of the state on which the ways are tried, all of them with the same number of poses."""

    def __init__(self, env: KitchenEnv, ways: list[tuple[HandTarget, ...]], allowed: frozenset[int]) -> None:
        self._model, self._data = env.model, copy.copy(env.data)
        self._ways, self._allowed = ways, allowed
        self._arm = Arm(env.model, env.data)
        self._home = env.data.qpos[self._arm.addresses].copy()
        base, yaw = base_pose(env.data)
        self._base = (float(base[0]), float(base[1]), yaw)
        frame = env.data.site(ARM_CENTER_SITE)
        self._turn = frame.xmat.reshape(3, 3).copy()
        self._positions = np.array([[t.position for t in way] for way in ways]) - frame.xpos
        self._rotations = self._turn.T @ np.array([[t.rotation for t in way] for way in ways])

    def plans(self, shift: tuple[float, float], bound: float) -> list[Plan]:
        """Plans from a stand; what is met is tested only for those that cost no more than about `bound`."""
        x, y, yaw = self._base
        move = np.array(
            [np.cos(yaw) * shift[0] - np.sin(yaw) * shift[1], np.sin(yaw) * shift[0] + np.cos(yaw) * shift[1], 0.0]
        )
        joints = np.tile(self._home, (len(self._ways), 1))
        cost = np.full(len(self._ways), 0.3 * float(np.hypot(*shift)))
        solved = []
        for index in range(self._positions.shape[1]):
            position = (self._positions[:, index] - move) @ self._turn
            solution = self._arm.solve(position, self._rotations[:, index], joints)
            joints = solution.joints
            cost += np.minimum(30.0 * solution.position_error + 2.0 * solution.rotation_error, 4.0)
            cost += np.maximum(0.0, _NEAR_LIMIT_RAD - solution.margin) * 2.0
            solved.append(joints)
        cost += 0.1 * np.abs(joints - self._home).max(axis=1)
        PANDA_OMRON.place_base(self._model, self._data, x + float(move[0]), y + float(move[1]), yaw)
        found: list[Plan] = []
        for number, row in enumerate(np.argsort(cost, kind="stable")):
            total = float(cost[row])
            if number == 0 or (number < _TESTED and total <= bound):
                total += sum(self._hits(poses[row]) for poses in solved)
                bound = min(bound, total + _WORSE)
            else:
                total += _UNTESTED
            found.append(Plan(self._ways[row], shift, total))
        return found

    def _hits(self, joints: Array) -> float:
        self._data.qpos[self._arm.addresses] = joints
        mujoco.mj_kinematics(self._model, self._data)
        return 0.7 * min(collisions(self._model, self._data, self._allowed), 3)
