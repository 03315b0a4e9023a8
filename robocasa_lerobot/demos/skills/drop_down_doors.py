"""Doors that fold down, opened: pulled ajar by their handle, then pushed down from inside."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    UP,
    Array,
    HandTarget,
    base_pose,
    frame,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.articulated import ContactPath, Shift, Waypoint, plan_contact
from robocasa_lerobot.demos.planning.contact_paths import arc_waypoints, grip_path
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.arc_motion import follow_arc, pull_arc, spots, take_stance
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

ATTEMPTS = 4
GAP_M, ENOUGH_GAP_M = 0.20, 0.11  # between the case and the upper edge: wanted of a pull, and enough for a hand
OPEN_SHARE = 0.95  # beyond the 0.90 that tasks ask for
PUSH_LEAD_RAD = 0.20
# Of a grasp: how far down and to the side the hand points, degrees; share of the door's angle that it turns with it.
GRASPS = ((15, 0, 0.3), (40, 0, 0.3), (40, 35, 0.3), (40, -35, 0.3), (65, 0, 0.3), (20, 50, 0.3), (20, -50, 0.3))
# Of a push from inside: share of the door's height, how far the hand leans inwards and sideways, degrees.
PUSHES = tuple(
    (share, lean, aside) for share in (0.97, 0.9, 0.65) for lean, aside in ((10, 0), (30, 0), (10, 30), (10, -30))
)


def fold_down(env: KitchenEnv, door: ArticulatedPart) -> Iterator[Array]:
    """Open a door that folds down.

    Raises:
        SkillError: it is not open after four attempts.
    """
    height = door.high[2]
    wanted = float(np.arcsin(min(GAP_M / height, np.sin(np.deg2rad(50.0)))))
    enough = float(np.arcsin(min(ENOUGH_GAP_M / height, np.sin(np.deg2rad(32.0)))))
    for _ in range(ATTEMPTS):
        if door.share >= OPEN_SHARE:
            return
        if door.angle < enough:
            yield from _pull(env, door, wanted)
        if door.angle >= enough:
            yield from _push(env, door)
    if door.share < OPEN_SHARE:
        raise SkillError(f"{door.name} is {door.share:.0%} open after {ATTEMPTS} attempts")


def stances_beside(env: KitchenEnv, door: ArticulatedPart) -> list[tuple[Shift, Shift]]:
    """Moves of the base to try: about where it stands, beside the area that the door sweeps, and before it."""
    shape = env.robot.shape
    base, _ = base_pose(env.data)
    offset = base - door.point(np.zeros(3), 0.0)
    x, y = float(offset @ door.rightwards), float(offset @ door.inwards)
    near = [(0.0, 0.0), (-0.15, 0.0), (0.0, 0.15), (0.0, -0.15), (-0.3, 0.0), (-0.2, 0.25), (-0.2, -0.25)]
    side = 1.0 if x > 0 else -1.0
    beside = [x - side * (door.high[0] + shape.base_y[1] + more) for more in (0.03, 0.10)]
    before = -(door.high[2] + shape.base_x[1] + 0.05) - y
    near += [(back, aside) for aside in beside for back in (0.0, -0.2, -0.4)]
    near += [(before, x - side * aside) for aside in (0.3, 0.15, 0.0)]
    return [(shift, shift) for shift in near]


def _pull(env: KitchenEnv, door: ArticulatedPart, wanted: float) -> Iterator[Array]:
    """Grasp the handle and pull the door ajar."""
    data = env.data
    paths = [_pull_path(env, door, grasp, flip, wanted) for grasp in GRASPS for flip in (1.0, -1.0)]
    plan = plan_contact(env, door, paths, stances_beside(env, door))
    yield from pull_arc(env, door, plan, wanted + 0.02)
    rest = HandTarget(grip_position(data), hand_rotation(data))
    edge = door.point(np.array([0.0, 0.0, door.high[2]]), door.angle)
    over = np.array([*rest.position[:2], edge[2] + 0.12])
    yield from move_hand(data, HandTarget(over, rest.rotation), CLOSED, tolerance=0.05, max_steps=30)


def _along(env: KitchenEnv, door: ArticulatedPart, low: float, high: float) -> float:
    """The place along the hinge, between bounds, that is nearest to the robot."""
    base, _ = base_pose(env.data)
    return float(np.clip((base - door.point(np.zeros(3), 0.0)) @ door.rightwards, low, high))


def _pull_path(
    env: KitchenEnv, door: ArticulatedPart, grasp: tuple[float, float, float], flip: float, wanted: float
) -> ContactPath:
    low, high = door.handle()
    room = 0.5 * (high[0] - low[0]) - 0.07
    middle = (low[0] + high[0]) / 2
    x = _along(env, door, middle - room, middle + room)
    grip = np.array([x, low[1] + min((high[1] - low[1]) / 2, 0.010), (low[2] + high[2]) / 2])
    down, aside = np.deg2rad(grasp[:2])
    local = np.array([np.sin(aside) * np.cos(down), np.cos(aside) * np.cos(down), -np.sin(down)])

    def rotation_at(angle: float) -> Array:
        turn = door.turned(grasp[2] * angle)
        return frame(turn @ local, flip * turn[:, 2])

    return grip_path(door, grip, rotation_at, wanted)


def _push(env: KitchenEnv, door: ArticulatedPart) -> Iterator[Array]:
    """Push the door down, from inside."""
    data = env.data
    paths = [_push_path(env, door, push, roll) for push in PUSHES for roll in range(4)]
    plan = plan_contact(env, door, paths, stances_beside(env, door))
    spot = spots(env, plan)
    yield from take_stance(env, plan, CLOSED)
    yield from follow_joint_path(env, plan.joints, CLOSED)
    for via in plan.path.waypoints[: plan.path.contact]:
        yield from move_hand(data, via.target, CLOSED, tolerance=0.04)
    yield from follow_arc(
        env,
        door,
        plan,
        (OPEN_SHARE + 0.01) * door.full,
        gripper=CLOSED,
        spot=spot,
        lead_rad=PUSH_LEAD_RAD,
        max_steps=160,
    )
    away = HandTarget(grip_position(data) + 0.10 * UP, hand_rotation(data))
    yield from move_hand(data, away, CLOSED, max_steps=20)


def _push_path(env: KitchenEnv, door: ArticulatedPart, push: tuple[float, float, float], roll: int) -> ContactPath:
    share, lean, aside = push
    x = _along(env, door, 0.75 * door.low[0], 0.75 * door.high[0])
    local = np.array([x, door.inside, share * door.high[2]])
    tilt, side = np.deg2rad(lean), np.deg2rad(aside)
    approach = (
        np.sin(tilt) * np.cos(side) * door.inwards + np.sin(side) * door.rightwards - np.cos(tilt) * np.cos(side) * UP
    )
    opening = (door.rightwards, door.inwards, -door.rightwards, -door.inwards)[roll]
    rotation = frame(approach, opening)
    fingers = env.robot.gripper.tips_below_grip

    def target_at(angle: float) -> HandTarget:
        return HandTarget(door.point(local, angle) + door.turned(angle)[:, 1] * fingers, rotation)

    start = door.angle
    at = target_at(start)
    beside = HandTarget(at.position + 0.4 * min(ENOUGH_GAP_M, door.high[2] * np.sin(start)) * door.inwards, rotation)
    edge = door.point(np.array([x, door.inside, door.high[2]]), start)
    over = np.array([*beside.position[:2], edge[2] + 0.08])
    end = OPEN_SHARE * door.full
    arc = arc_waypoints(start, end, target_at, (0.0, 0.5, 1.0))
    return ContactPath((Waypoint(start, HandTarget(over, rotation)), Waypoint(start, beside), *arc), 2, target_at)
