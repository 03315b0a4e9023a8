"""Where to stand and how to hold the hand: candidates are tried by inverse kinematics on a copy of the state."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import (
    FROM_DESIRED,
    Array,
    HandTarget,
    action,
    axis_angle,
    base_pose,
    grip_position,
    hand_rotation,
    limit,
    pose_error,
)
from robocasa_lerobot.demos.motion_style import variety_of
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.control.indices import joint_positions, joint_velocities
from robocasa_lerobot.envs.robots.panda_omron.names import (
    ARM_JOINTS,
    BASE_CENTER_SITE,
    BASE_JOINTS,
    GRIP_SITE,
    MOBILE_BASE,
)
from robocasa_lerobot.envs.scene.bodies import subtree

_ITERATIONS, _DAMPING = 36, 0.05
GOOD_ENOUGH = 0.30  # cost from which no other place to stand is looked at
_WORSE = 0.6  # ways worse than the best by this much are not looked at to their end
_NEAR_LIMIT_RAD = 0.25
# Of base_motion, a command below this moves nothing (docs/robocasa.md, section 2).
_DEAD_ZONE = 0.25
_BASE_TOLERANCE_M = 0.02


@dataclass(frozen=True)
class Plan:
    """A way to reach a row of hand poses.

    Attributes:
        targets: hand poses in their order.
        shift: move of the base before, metres forward and to the left.
        cost: how bad it is; above 1 it is not to be had without a collision or a miss.
    """

    targets: tuple[HandTarget, ...]
    shift: tuple[float, float]
    cost: float


def plan_reach(
    env: KitchenEnv,
    ways: Iterable[tuple[HandTarget, ...]],
    shifts: Iterable[tuple[float, float]],
    *,
    allowed: frozenset[int] = frozenset(),
) -> list[Plan]:
    """Ways to reach, the best first: the arm gets there, far from its joints' limits and from what stands around.

    Of ways that are about equally good, the one comes first that the demonstration's variety prefers.

    Args:
        env: its state is read, not touched.
        ways: alternatives, each a row of hand poses.
        shifts: moves of the base to try in this order, metres forward and to the left.
        allowed: bodies that the robot may touch.
    """
    options = [tuple(way) for way in ways]
    plans: list[Plan] = []
    model, data = env.model, copy.copy(env.data)
    best = np.inf
    for shift in shifts:
        data.qpos[:] = env.data.qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        move_base_to(model, data, shift)
        far = 0.3 * float(np.hypot(*shift))
        for way in options:
            cost = far + _cost(model, data, way, allowed, best + _WORSE - far)
            plans.append(Plan(way, shift, cost))
            best = min(best, cost)
        if best < GOOD_ENOUGH:
            break
    variety = variety_of(env)
    return sorted(plans, key=lambda plan: plan.cost - variety.bonus(plan.targets[-1].rotation))


def untried(plans: list[Plan], tried: list[Array]) -> Plan:
    """The best plan whose hand points otherwise than in those tried before; notes it as tried."""
    for plan in plans:
        rotation = plan.targets[-1].rotation
        if all(float(np.trace(rotation.T @ other)) < 2.5 for other in tried):
            break
    else:
        plan = plans[0]
    tried.append(plan.targets[-1].rotation)
    return plan


def shift_base(env: KitchenEnv, shift: tuple[float, float], gripper: float, max_steps: int = 60) -> Iterator[Array]:
    """Drive by metres forward and to the left; heading kept, the arm rides along."""
    start, yaw = base_pose(env.data)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    goal = start + ahead * shift[0] + left * shift[1]
    for _ in range(max_steps):
        position, now = base_pose(env.data)
        away = goal - position
        if float(np.hypot(away[0], away[1])) < _BASE_TOLERANCE_M:
            break
        ahead, left = np.array([np.cos(now), np.sin(now), 0.0]), np.array([-np.sin(now), np.cos(now), 0.0])
        wanted = limit(np.array([away @ ahead, away @ left]) * 2.5, 0.5)
        turn = float(np.arctan2(np.sin(yaw - now), np.cos(yaw - now)))
        command = [_beyond_dead_zone(float(v)) for v in (*wanted, turn if abs(turn) > 0.02 else 0.0)]
        yield action(gripper=gripper, base=np.array([*command, 0.0]), mode=FROM_DESIRED)
    for _ in range(3):
        yield action(gripper=gripper, mode=FROM_DESIRED)


def _beyond_dead_zone(command: float) -> float:
    if abs(command) < 0.01:
        return 0.0
    return float(np.clip(command + np.sign(command) * _DEAD_ZONE, -1.0, 1.0))


def _cost(
    model: mujoco.MjModel, data: mujoco.MjData, way: tuple[HandTarget, ...], allowed: frozenset[int], bound: float
) -> float:
    """Cost of a way; no more of it is looked at once it exceeds `bound`. Leaves the arm as it was."""
    arm, dofs = joint_positions(model, ARM_JOINTS), joint_velocities(model, ARM_JOINTS)
    home = data.qpos[arm].copy()
    ranges = np.array([model.joint(name).range for name in ARM_JOINTS])
    cost = 0.0
    for target in way:
        solve_arm(model, data, target, arm, dofs, home, ranges)
        error = pose_error(data, target)
        margin = np.minimum(data.qpos[arm] - ranges[:, 0], ranges[:, 1] - data.qpos[arm]).min()
        cost += min(30.0 * error.position + 2.0 * error.rotation, 4.0)
        cost += max(0.0, _NEAR_LIMIT_RAD - float(margin)) * 2.0
        if cost > bound:
            break
        cost += 0.7 * min(collisions(model, data, allowed), 3)
    cost += 0.1 * float(np.abs(data.qpos[arm] - home).max())
    data.qpos[arm] = home
    return cost


def move_base_to(model: mujoco.MjModel, data: mujoco.MjData, shift: tuple[float, float]) -> None:
    """Put the base of a copied state elsewhere, metres forward and to the left; positions are evaluated before."""
    _, yaw = base_pose(data)
    move = np.array([np.cos(yaw) * shift[0] - np.sin(yaw) * shift[1], np.sin(yaw) * shift[0] + np.cos(yaw) * shift[1]])
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site(BASE_CENTER_SITE).id)
    slides = BASE_JOINTS[:2]
    columns = jacobian[:2, joint_velocities(model, slides)]
    data.qpos[joint_positions(model, slides)] += np.linalg.solve(columns, move)
    mujoco.mj_kinematics(model, data)


def solve_arm(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    target: HandTarget,
    arm: NDArray[np.intp],
    dofs: NDArray[np.intp],
    home: Array,
    ranges: Array,
) -> None:
    """Damped least squares towards the target, with what is left over towards `home`, as the arm's controller does."""
    site = model.site(GRIP_SITE).id
    moves, turns = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for iteration in range(_ITERATIONS):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = np.concatenate(
            [
                limit(target.position - grip_position(data), 0.1),
                limit(axis_angle(target.rotation @ hand_rotation(data).T), 0.4),
            ]
        )
        if np.linalg.norm(error[:3]) < 0.002 and np.linalg.norm(error[3:]) < 0.02:
            return
        if iteration == _ITERATIONS // 2 and pose_error(data, target).position > 0.08:
            return  # out of reach
        mujoco.mj_jacSite(model, data, moves, turns, site)
        jacobian = np.vstack([moves[:, dofs], turns[:, dofs]])
        inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + _DAMPING**2 * np.eye(6))
        rest = (np.eye(7) - inverse @ jacobian) @ (home - data.qpos[arm])
        data.qpos[arm] = np.clip(data.qpos[arm] + inverse @ error + 0.2 * rest, ranges[:, 0], ranges[:, 1])
    mujoco.mj_kinematics(model, data)


def collisions(model: mujoco.MjModel, data: mujoco.MjData, allowed: frozenset[int]) -> int:
    """Number of bodies that the robot would touch or enter, but for those allowed."""
    mujoco.mj_collision(model, data)
    if data.ncon == 0:
        return 0
    robot = subtree(model, MOBILE_BASE)
    pairs = model.geom_bodyid[data.contact.geom]
    touched = {
        int(other)
        for (a, b), distance in zip(pairs, data.contact.dist, strict=True)
        for mine, other in ((a, b), (b, a))
        if robot[mine] and not robot[other] and distance < 0.0
    }
    return len(touched - allowed)
