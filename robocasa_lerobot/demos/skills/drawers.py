"""Drawers: pulled open by their handle, pushed shut at their front."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    floor_axes,
    frame,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.motion_style import motion_style_of
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, require_near
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.navigation import Room, drive_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
GRASP_STEPS = 10  # the gripper needs ten control steps for its whole stroke
# A pull that begins just when the fingers arrive teaches to pull a little too early, and the bar slips out.
FIRM_STEPS = 6
APPROACH_PITCH_RAD = np.deg2rad(15.0)  # downwards: keeps the forearm above the handle
# A hand that waits beside its goal (`MotionStyle.wait_m`) first goes in front of it: a slant up to the handle
# is a small share of each command, which a policy does not learn.
STANDOFF_M, ALIGNED_M = 0.15, 0.08
ALIGN_SPEED, APPROACH_SPEED = 0.7, 0.45
PULL_SPEED = 0.55
# Well beyond what tasks ask for: a demonstration that stops at the threshold teaches to stop short of it.
OPEN_GOAL, CLOSED_GOAL = 1.15, 0.0
# A robot that stands less far beside a drawer is in its way; where it goes then, from the drawer's side.
LEAST_ASIDE_M, ASIDES_M = 0.03, (0.20, 0.28, 0.12, 0.36, 0.06)
LEAST_TO_PUSH_M = 0.15  # the same of one that could not be pushed shut: its front is too near to push at
# Of a drawer that is dragged: how far it is in before it is worth while, and what the hand needs of it.
PUSHED_IN_M, HAND_ROOM_M = 0.03, 0.08
LEAST_OPEN_M = 0.20  # a hand with something long in it wants more than half of most drawers
# Of a drawer's handle from the base, ahead and in all, for its front to be in reach.
LEAST_TO_DRAG_M, MOST_TO_DRAG_M = -0.05, 0.75
# The hand comes from over the front's upper edge, goes below it close behind it, and is led beyond where it ends.
OVER_M, INTO_M, BEHIND_M, DRAG_FARTHER_M = 0.10, 0.035, 0.025, 0.04


def open_drawer(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Grasp the handle from the front, fingers above and below the bar, and pull.

    Raises:
        SkillError: the drawer is not open after three attempts.
    """
    data, drawer = env.data, env.scene.fixture(stage.target, Drawer)
    inwards = _inwards(drawer)
    yield from _drive_beside(env, stage.target, drawer)
    rotation = _facing(env, drawer, inwards)
    approach = rotation[:, 2]
    for _ in range(ATTEMPTS):
        handle = data.geom(drawer.handle_geom).xpos.copy()
        before = HandTarget(handle - approach * STANDOFF_M + motion_style_of(env).beside(approach), rotation)
        aligned = HandTarget(handle - approach * ALIGNED_M, rotation)
        at = HandTarget(handle, rotation)
        yield from move_hand(data, before, OPEN, tolerance=0.02)
        yield from move_hand(data, aligned, OPEN, speed=ALIGN_SPEED, max_steps=40)
        yield from move_hand(data, at, OPEN, speed=APPROACH_SPEED, max_steps=60)
        yield from hold_hand(data, at, CLOSED, GRASP_STEPS + FIRM_STEPS)
        reach = drawer.full_travel * (OPEN_GOAL + 0.1 - drawer.openness(data))
        start = grip_position(data)
        # The hand keeps the turn that the grasp left it with: a stiff bar turns the wrist, not the wrist the bar.
        goal = HandTarget(start - inwards * reach, rotation)
        yield from move_hand(
            data, goal, CLOSED, speed=PULL_SPEED, max_steps=130, until=lambda: drawer.openness(data) >= OPEN_GOAL
        )
        if drawer.openness(data) >= OPEN_GOAL:
            return
        away = HandTarget(grip_position(data) - approach * STANDOFF_M, rotation)
        yield from hold_hand(data, HandTarget(grip_position(data), rotation), OPEN, GRASP_STEPS)
        yield from move_hand(data, away, OPEN, max_steps=30)
    raise SkillError(f"{drawer.name} is {drawer.openness(data):.0%} open after {ATTEMPTS} attempts")


def _drive_beside(env: KitchenEnv, role: str, drawer: Drawer, least_m: float = LEAST_ASIDE_M) -> Iterator[Array]:
    """Drive out of the way of a drawer that is to be moved: to the nearer side of it that is free, if there is one.

    Nothing is done from `least_m` beside it on.
    """
    base, _ = base_pose(env.data)
    rightwards = np.cross(_inwards(drawer), UP)
    aside = float((base - np.asarray(drawer.pos)) @ rightwards)
    if abs(aside) > drawer.width / 2 + least_m:
        return
    before, room = env.scene.standing_pose(role), Room(env.scene)
    ways = (1.0, -1.0) if aside >= 0.0 else (-1.0, 1.0)
    for more, way in itertools.product(ASIDES_M, ways):
        x, y, _ = np.array([before.x, before.y, 0.0]) + way * (drawer.width / 2 + more) * rightwards
        beside = RobotPose(float(x), float(y), before.yaw)
        if room.free(beside):
            with contextlib.suppress(SkillError):
                yield from drive_to(env, beside.x, beside.y, beside.yaw)
            return


def make_room(env: KitchenEnv, drawer: Drawer, again: bool) -> Iterator[Array]:
    """With an empty hand, drag a drawer near the robot farther out that has been pushed in, or has had no room."""
    if again or drawer.openness(env.data) * drawer.full_travel < LEAST_OPEN_M:
        base, yaw = base_pose(env.data)
        ahead, left = floor_axes(yaw) @ (env.data.geom(drawer.handle_geom).xpos - base)
        if ahead > LEAST_TO_DRAG_M and np.hypot(ahead, left) < MOST_TO_DRAG_M:
            yield from drag_open(env, drawer)


def drag_open(env: KitchenEnv, drawer: Drawer, openness: float = 1.0) -> Iterator[Array]:
    """Pull a drawer that is partly open farther out, with the finger tips behind its front; as far as that gets.

    Nothing is done where it is open, or where it is so far in that there is no room for the hand before the counter.
    """
    data = env.data
    missing = drawer.full_travel * (openness - drawer.openness(data))
    if missing < PUSHED_IN_M or drawer.openness(data) * drawer.full_travel < HAND_ROOM_M:
        return
    inwards = _inwards(drawer)
    front = env.model.geom(f"{drawer.name}_front").id
    half = data.geom_xmat[front].reshape(3, 3) * env.model.geom_size[front]  # its half axes as columns, world
    tall, thick = (float(np.abs(way @ half).max()) for way in (UP, inwards))
    edge = data.geom_xpos[front] + tall * UP + (thick + BEHIND_M) * inwards
    rotation = frame(
        -UP, np.cross(inwards, UP) * (1.0 if hand_rotation(data)[:, 1] @ np.cross(inwards, UP) > 0 else -1.0)
    )
    over, at = HandTarget(edge + OVER_M * UP, rotation), HandTarget(edge - INTO_M * UP, rotation)
    yield from move_hand(data, over, CLOSED, tolerance=0.02)
    yield from move_hand(data, at, CLOSED, speed=0.6, tolerance=0.015, max_steps=40)
    goal = HandTarget(at.position - (missing + BEHIND_M + DRAG_FARTHER_M) * inwards, rotation)
    yield from move_hand(
        data,
        goal,
        CLOSED,
        speed=PULL_SPEED,
        tolerance=0.01,
        max_steps=90,
        until=lambda: drawer.openness(data) >= openness,
    )
    up = HandTarget(grip_position(data) + (OVER_M + INTO_M) * UP + BEHIND_M * inwards, rotation)
    yield from move_hand(data, up, CLOSED, tolerance=0.04, max_steps=30)


def close_drawer(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push the front beside the handle with closed fingers.

    Raises:
        SkillError: the drawer is not shut after three attempts.
    """
    data, drawer = env.data, env.scene.fixture(stage.target, Drawer)
    inwards = _inwards(drawer)
    rotation = _facing(env, drawer, inwards)
    sideways = np.cross(inwards, UP)
    base, _ = base_pose(data)
    for attempt in range(ATTEMPTS):
        if attempt > 0:
            yield from fold_arm(env)
            yield from _drive_beside(env, stage.target, drawer, LEAST_TO_PUSH_M)
            rotation, (base, _) = _facing(env, drawer, inwards), base_pose(data)
        front = data.geom(f"{drawer.name}_front").xpos.copy()
        # Between the handle and the edge, on the side of the robot.
        side = float(np.sign((base - front) @ sideways))
        point = front + sideways * side * 0.32 * drawer.width
        over = HandTarget(point - inwards * 0.12 + UP * 0.18, rotation)
        before = HandTarget(point - inwards * 0.09, rotation)
        yield from move_hand(data, over, CLOSED, tolerance=0.05)
        yield from move_hand(data, before, CLOSED, tolerance=0.02)
        try:
            require_near(data, before, 0.10, f"in front of {drawer.name}")
        except SkillError:
            if attempt + 1 < ATTEMPTS:
                continue  # a robot that stands before the front has no room to come to it
            raise
        goal = HandTarget(point + inwards * (drawer.openness(data) * drawer.full_travel + 0.06), rotation)
        yield from move_hand(
            data, goal, CLOSED, speed=PULL_SPEED, max_steps=130, until=lambda: drawer.openness(data) <= CLOSED_GOAL
        )
        if drawer.openness(data) <= CLOSED_GOAL:
            return
        back = HandTarget(grip_position(data) - inwards * 0.12, hand_rotation(data))
        yield from move_hand(data, back, CLOSED, max_steps=30)
    raise SkillError(f"{drawer.name} is still {drawer.openness(data):.0%} open after {ATTEMPTS} attempts")


def _inwards(drawer: Drawer) -> Array:
    return np.array([-np.sin(drawer.yaw), np.cos(drawer.yaw), 0.0])


def _facing(env: KitchenEnv, drawer: Drawer, inwards: Array) -> Array:
    """Hand rotation that looks into the drawer, the fingers one above the other.

    Of the two rolls of the hand, the one that turns the wrist back over the robot's own middle: the other runs
    the wrist into its limit.
    """
    base, _ = base_pose(env.data)
    rightwards = np.cross(inwards, UP)
    stands_left = float((base - np.asarray(drawer.pos)) @ rightwards) < 0
    approach = np.cos(APPROACH_PITCH_RAD) * inwards - np.sin(APPROACH_PITCH_RAD) * UP
    return frame(approach, -UP if stands_left else UP)
