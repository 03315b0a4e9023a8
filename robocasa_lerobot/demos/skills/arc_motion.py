"""A hinged part led along its arc: pushed with the closed finger tips, or grasped and pulled."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator

import mujoco
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import (
    CLOSED,
    DEAD_ZONE,
    OPEN,
    UP,
    Array,
    HandTarget,
    arm_action,
    base_pose,
    floor_axes,
    frame,
    grip_position,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.planning.articulated import (
    AT_HOME,
    LET_DOWN,
    ArticulatedPlan,
    ContactPath,
    Shift,
    plan_contact,
)
from robocasa_lerobot.demos.planning.contact_paths import STANDOFF_M
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.articulated_part import STALL_RAD, ArticulatedPart, StallDetector
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, draw_back, hold_hand, move_hand
from robocasa_lerobot.demos.skills.force_servo import ForceServo
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

SETTLE_STEPS, GRASP_STEPS, RELEASE_STEPS = 6, 10, 6
INTEGRAL_GAIN = 0.12
_BASE_SPEED = 0.22  # metres a second while the arm moves too: the arm keeps up with about 0.26
TUCKED_AHEAD_M, TUCKED_UP_M = 0.28, 0.58  # of the grip site from the arm's foot
REST_M = 0.40  # height over the arm's foot at which the hand works best
KNOCKED_RAD = 0.08
FRUITLESS_RAD = 0.1  # a push that turns the part by less has come to nothing
LOW_TOP_M = 0.35  # of a low part's upper edge over the arm's foot
FIRM_LEAD_M = 0.09  # of the hand's goal in a firm push
FIRMER_STEPS = 12  # without movement, after which a firm push has twice its lead


def follow_arc(
    env: KitchenEnv,
    part: ArticulatedPart,
    plan: ArticulatedPlan,
    goal: float,
    *,
    gripper: float,
    spot: tuple[Array, Array],
    lead_rad: float,
    speed: float = 0.8,
    max_steps: int = 200,
    until: Callable[[], bool] = lambda: False,
    firm: bool = False,
    stall_rad: float = STALL_RAD,
) -> Iterator[Array]:
    """Go along with a part until it stands at `goal`, `until` holds, or it turns no more.

    Args:
        env: the kitchen.
        part: what turns.
        plan: whose path is followed.
        goal: angle, radians.
        gripper: OPEN or CLOSED.
        spot: where the base stands at the beginning and at the goal, world, metres, (3,) each.
        lead_rad: how far the commanded pose is ahead of the part, radians.
        speed: bound of each command component, in (0, 1].
        max_steps: control steps at most.
        until: ends it too.
        firm: push harder, the harder the longer nothing moves; then neither `lead_rad` nor `speed` has an effect.
        stall_rad: what it must turn by not to have stalled, radians.
    """
    data = env.data
    servo = ForceServo(data)
    first = part.angle
    sign = 1.0 if goal > first else -1.0
    headway = StallDetector(part, sign, stall_rad)
    for _ in range(max_steps):
        if sign * (part.angle - goal) >= 0.0 or until():
            return
        if headway.ends():
            return
        if firm:
            here, near = (plan.path.target_at(part.angle + turn).position for turn in (0.0, 0.01))
            lead = FIRM_LEAD_M / (float(np.linalg.norm(near - here)) / 0.01) * (1.0 + headway.since / FIRMER_STEPS)
            step = servo.action(plan.path.target_at(part.angle + sign * lead), gripper)
        else:
            step = arm_action(data, plan.path.target_at(part.angle + sign * lead_rad), gripper, speed=speed)
        progress = float(np.clip((part.angle - first) / (goal - first) + 0.15, 0.0, 1.0))
        step[contract.ACTION_SLICES["base_motion"]][:2] = _base_command(data, spot[0] + progress * (spot[1] - spot[0]))
        yield step


def pull_arc(
    env: KitchenEnv,
    part: ArticulatedPart,
    plan: ArticulatedPlan,
    goal: float,
    *,
    lead_rad: float = 0.15,
    speed: float = 0.9,
) -> Iterator[Array]:
    """Grasp a part as planned, lead it to an angle, let it go and draw the hand back."""
    data = env.data
    spot = spots(env, plan)
    yield from take_stance(env, plan, OPEN)
    yield from follow_joint_path(env, plan.joints, OPEN)
    before, at = plan.path.waypoints[0].target, plan.path.waypoints[1].target
    yield from move_hand(data, before, OPEN, speed=0.7, tolerance=0.010, integral_gain=INTEGRAL_GAIN)
    yield from hold_hand(data, before, OPEN, SETTLE_STEPS)  # it comes with speed, and there may be little room
    yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.006, max_steps=40, integral_gain=INTEGRAL_GAIN)
    yield from hold_hand(data, at, CLOSED, GRASP_STEPS)
    yield from follow_arc(
        env, part, plan, goal, gripper=CLOSED, spot=spot, lead_rad=lead_rad, speed=speed, max_steps=160
    )
    rest = HandTarget(grip_position(data), hand_rotation(data))
    yield from hold_hand(data, rest, OPEN, RELEASE_STEPS)
    away = HandTarget(rest.position - rest.rotation[:, 2] * (STANDOFF_M + 0.02), rest.rotation)
    yield from move_hand(data, away, OPEN, tolerance=0.03, max_steps=25)


def push_arc(
    env: KitchenEnv,
    part: ArticulatedPart,
    paths: Iterable[ContactPath],
    stances: Iterable[tuple[Shift, Shift]],
    goal: float,
    *,
    lead_rad: float = 0.15,
    speed: float = 0.8,
    firm: bool = False,
    most_cost: float = np.inf,
    stall_rad: float = STALL_RAD,
) -> Generator[Array, None, ContactPath | None]:
    """Push a part to an angle along the best of some paths, and draw the hand back; returns one that came to nothing.

    A hand that knocks the part back before it gets to its place goes no farther: it would push on the wrong side.

    Raises:
        SkillError: none of them is possible, or none for `most_cost`.
    """
    data = env.data
    plan = plan_contact(env, part, paths, stances, bends=arm_bends(env, part))
    if plan.cost > most_cost:
        raise SkillError(f"{part.name}: the arm hardly reaches along its arc")
    spot = spots(env, plan)
    first, way = part.angle, 1.0 if goal > part.angle else -1.0

    def knocked() -> bool:
        return way * (part.angle - first) < -KNOCKED_RAD

    yield from take_stance(env, plan, CLOSED)
    yield from follow_joint_path(env, plan.joints, CLOSED)
    for via in plan.path.waypoints[: plan.path.contact]:
        yield from move_hand(data, via.target, CLOSED, tolerance=0.03, until=knocked)
    if not knocked():
        yield from follow_arc(
            env,
            part,
            plan,
            goal,
            gripper=CLOSED,
            spot=spot,
            lead_rad=lead_rad,
            speed=speed,
            firm=firm,
            stall_rad=stall_rad,
        )
    yield from draw_back(data, CLOSED, 0.10)
    return plan.path if way * (part.angle - first) < FRUITLESS_RAD else None


def retract(env: KitchenEnv, gripper: float) -> Iterator[Array]:
    """Draw the hand back to about where it is at the beginning of an episode, before the base's middle."""
    data = env.data
    base, yaw = base_pose(data)
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    rotation = frame(0.28 * ahead - 0.96 * UP, np.cross(UP, ahead))
    target = HandTarget(base + TUCKED_AHEAD_M * ahead + TUCKED_UP_M * UP, nearer_turn(rotation, hand_rotation(data)))
    yield from move_hand(data, target, gripper, tolerance=0.10, max_steps=40)


def stances_around(
    env: KitchenEnv, door: ArticulatedPart, near: list[Shift], *, follow: float = 0.0
) -> list[tuple[Shift, Shift]]:
    """Moves of the base to try for a door on a vertical hinge: about where it stands, and about the door.

    Args:
        env: the kitchen.
        door: the one to open or close.
        near: moves from where the robot stands now, metres forward and to the left.
        follow: how far the base may go along forwards as the door turns, metres.
    """
    base, yaw = base_pose(env.data)
    axes = floor_axes(yaw)
    side, width = door.side, door.width
    spots = []
    for before in (max(width, 0.25) + 0.35, 0.45, 0.55, 0.7, width + 0.6):
        for aside in (0.5 * width, width, width + 0.35, 0.0, -0.15, -0.3, -0.45, -0.6):
            spot = door.point(np.zeros(3), 0.0) + side * aside * door.rightwards - before * door.inwards
            ahead, left = axes @ (spot - base)
            spots.append((float(ahead), float(left)))
    ends = (0.0, follow) if follow else (0.0,)
    starts = [*near, *sorted(spots, key=lambda spot: float(np.hypot(*spot)))]
    return [((x, y), (x + more, y)) for x, y in starts for more in ends]


def working_height(env: KitchenEnv, door: ArticulatedPart, low: float, high: float) -> float:
    """The height over the door's hinge, between two bounds, that is nearest to where the hand works best, metres."""
    height = base_pose(env.data)[0][2] + REST_M - door.point(np.zeros(3), 0.0)[2]
    return float(np.clip(height, low, high))


def arm_bends(env: KitchenEnv, part: ArticulatedPart) -> Array:
    """Bends (n, 7) of the home pose from which the arm is solved for a part: let down, too, for one that is low."""
    top = float(part.point(np.zeros(3), 0.0)[2] + part.high[2])
    return LET_DOWN if top < base_pose(env.data)[0][2] + LOW_TOP_M else AT_HOME


def take_stance(env: KitchenEnv, plan: ArticulatedPlan, gripper: float) -> Iterator[Array]:
    """Drive to where a plan begins."""
    for leg in plan.legs:
        yield from shift_base(env, leg, gripper)


def spots(env: KitchenEnv, plan: ArticulatedPlan) -> tuple[Array, Array]:
    """World positions (3,) of the base that a plan begins and ends at, from where it stands now."""
    base, yaw = base_pose(env.data)
    axes = floor_axes(yaw)
    return base + np.asarray(plan.start) @ axes, base + np.asarray(plan.end) @ axes


def _base_command(data: mujoco.MjData, spot: Array) -> Array:
    """Slow base command (2,) towards a spot."""
    base, yaw = base_pose(data)
    cos, sin = np.cos(yaw), np.sin(yaw)
    error = np.array([[cos, sin], [-sin, cos]]) @ (spot - base)[:2]
    distance = float(np.linalg.norm(error))
    if distance < 0.02:
        return np.zeros(2)
    command: Array = error / distance * (DEAD_ZONE + min(2.0 * distance, _BASE_SPEED))
    return command
