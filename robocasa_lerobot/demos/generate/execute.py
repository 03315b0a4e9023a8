"""Carrying out a segment in another scene: hand poses as commands, in step with what the hand moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.generate.course import BRIDGE, CONTACT, FREE, SETTLE, Course
from robocasa_lerobot.demos.generate.sources.source import Piece
from robocasa_lerobot.demos.generate.sources.transform import command_to, inverse, make_pose
from robocasa_lerobot.demos.motion import (
    DEAD_ZONE,
    FROM_ACHIEVED,
    FROM_DESIRED,
    TURN_DEAD_ZONE,
    Array,
    HandTarget,
    action,
    axis_angle,
    base_pose,
    grip_position,
    hand_rotation,
    limit,
    pose_error,
    rotation_about,
)
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.skills.common import move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

# The hand waits for itself where it is farther than this from where it was in the source; all waits together.
BEHIND_M, BEHIND_RAD, MOST_WAITS = 0.02, 0.15, 40
HEADWAY = 0.05  # of these, that a wait must bring it nearer by
LOST_M, OFF_M = 0.09, 0.15  # of a hand from where it would hold on to a handle, or push
MOVING_SHARE = 0.002  # of its range in a step: a part that moves by less has stalled
MOST_AHEAD_M = 0.15  # of a goal from the hand, from which on the next one starts from the hand again
# Before the fingers move it comes as near as this, in so many steps at most.
ARRIVED_M, GAIN = 0.012, 0.12  # of the hand at the segment's beginning
BLOCKED_M = 0.08  # of a hand from where it should let go
SETTLED_M, SETTLE_STEPS = 0.006, 16
LATE_WAITS, FIRMER = 90, 0.1  # steps that a part is waited for, and by how much more it is pushed after each
MOST_STALLED = 25  # steps after which a part that has not moved will not
MOST_TWIST_RAD = 0.6
IDLE_M, IDLE_RAD, IDLE_GAP_M = 0.004, 0.03, 0.001  # of a source's hand that waits, or comes to rest; of its fingers
BASE_NEAR_M, BASE_NEAR_RAD, BASE_GAIN, BASE_MOST = 0.012, 0.03, 3.0, 0.45


@dataclass(frozen=True)
class Carried:
    """A segment as it is carried out.

    Attributes:
        piece: the segment.
        target: pose (4, 4) that the controller is led to at a step of the source, as things stand.
        hand: pose (4, 4) that the hand has there.
        late: whether what the hand moves is behind what it was at that step.
        base: where the base belongs at that step: x, y, heading; None keeps it at rest.
        met: whether what the hand goes to has moved already, so that the contact has begun.
        position: of what the hand moves, as a share of its range; it is pushed the harder the longer it has stalled.
        enter: step of the contact that is gone on with, since what the hand moves has come as far already.
        leaves: step from which that is so: before it the fingers close, say.
        twists: whether the hand turns what it holds, a knob, and turns harder where that has stalled.
        keeps: whether a hand that is blocked on its way does not let go of what it holds.
    """

    piece: Piece
    target: Callable[[int], Array]
    hand: Callable[[int], Array]
    late: Callable[[int], bool] = lambda step: False
    base: Callable[[int], Array] | None = None
    met: Callable[[], bool] = lambda: False
    position: Callable[[], float] | None = None
    enter: int = 0
    leaves: int = 0
    twists: bool = False
    keeps: bool = False


def hand_now(env: KitchenEnv) -> Array:
    """World pose (4, 4) of the hand."""
    return make_pose(grip_position(env.data), hand_rotation(env.data))


def as_target(pose: Array) -> HandTarget:
    """A pose (4, 4) as the servo takes it."""
    return HandTarget(pose[:3, 3], pose[:3, :3])


def pose_command(env: KitchenEnv, pose: Array, gripper: float, base: Array | None = None) -> Array:
    """Action (12,), stored order, that sets the controller's goal to a world pose (4, 4), as far as one step may.

    A goal that lies farther from the hand than one command reaches, as that of a firm push, is come to from the goal
    before, in the other control mode.
    """
    to_frame = inverse(make_pose(*env.controller.arm_frame()))
    hand = hand_now(env)
    move, turn = command_to(to_frame @ pose, to_frame @ hand)
    mode = FROM_ACHIEVED
    if max(np.abs(move).max(), np.abs(turn).max()) > 1.0:
        position, rotation = env.controller.goal_in_base()
        site = env.data.site(env.scene.robot.names.grip_site).xmat.reshape(3, 3)
        goal = make_pose(position, rotation @ site.T @ hand[:3, :3])
        if np.linalg.norm(position - (to_frame @ hand)[:3, 3]) < MOST_AHEAD_M:
            move, turn = command_to(to_frame @ pose, goal)
            mode = FROM_DESIRED
    return action(position=limit(move, 1.0), rotation=limit(turn, 1.0), gripper=gripper, base=base, mode=mode)


def carry_out_segment(env: KitchenEnv, course: Course, carried: Carried) -> Iterator[Array]:
    """Actions of a segment from its lead on; it ends early where the hand has lost what it moved, or may not let go."""
    segment, data = carried.piece.segment, carried.piece.data
    number = carried.piece.source.number
    step, waits, late, nearest = segment.lead, MOST_WAITS, LATE_WAITS, np.inf
    course.label = (number, BRIDGE, -1)
    yield from move_hand(
        env.data, as_target(carried.hand(step)), float(data.gripper[step]), tolerance=ARRIVED_M, integral_gain=GAIN
    )
    stalled, before = 0, 0.0 if carried.position is None else carried.position()
    grasps, settled, told = data.gripper[segment.lead] < 0, -1, float(data.gripper[segment.lead])
    while step < segment.end:
        if step < segment.contact and carried.met():
            step = segment.contact
        gripper = float(data.gripper[step])
        if step > settled and gripper != told:
            settled, pose = step, as_target(carried.hand(step))  # the part may swing while the hand comes to rest
            course.label = (number, SETTLE, step)
            yield from move_hand(env.data, pose, told, tolerance=SETTLED_M, max_steps=SETTLE_STEPS, integral_gain=GAIN)
            if carried.keeps and gripper < 0 and pose_error(env.data, pose).position > BLOCKED_M:
                return
        told = gripper
        lets_go = grasps and gripper < 0
        in_contact = segment.contact <= step < segment.release
        course.label = (number, CONTACT if in_contact else FREE, step)
        base = None if carried.base is None else base_command(env, carried.base(step))
        yield pose_command(env, _firmer(carried, step, stalled), gripper, base)
        if in_contact and _lost(env, carried.hand(step), LOST_M if grasps and gripper > 0 else OFF_M):
            return
        if carried.position is not None:
            now = carried.position()
            stalled, before = (stalled + 1, before) if abs(now - before) < MOVING_SHARE else (0, now)
        if in_contact and late and not lets_go and carried.late(step):
            if stalled > MOST_STALLED:
                return
            late -= 1
            continue
        stalled = 0
        if step == carried.leaves and carried.enter > step:
            step = carried.enter
        elif step < segment.contact and waits and (behind := _behind(env, carried, step)) < nearest - HEADWAY:
            waits, nearest = waits - 1, behind
        else:
            step, nearest = _next(carried.piece, step), np.inf


def _next(piece: Piece, step: int) -> int:
    """The step after one; before a contact, where the source's hand hardly moves for a while, the last of these."""
    eef, gripper, gap, contact = piece.data.eef, piece.data.gripper, piece.data.gap, piece.segment.contact
    after = step + 1
    while after < contact - 1 and gripper[after] == gripper[step] and abs(gap[after] - gap[step]) < IDLE_GAP_M:
        moved = np.linalg.norm(eef[after][:3, 3] - eef[step][:3, 3])
        if moved > IDLE_M or np.linalg.norm(axis_angle(eef[after][:3, :3] @ eef[step][:3, :3].T)) > IDLE_RAD:
            break
        after += 1
    return after


def _firmer(carried: Carried, step: int, stalled: int) -> Array:
    """The target of a step, the farther ahead of the hand, the longer nothing has moved."""
    target, hand = carried.target(step), carried.hand(step)
    if not stalled:
        return target
    rotation = target[:3, :3]
    if carried.twists:
        more = limit(axis_angle(rotation @ hand[:3, :3].T) * FIRMER * stalled, MOST_TWIST_RAD)
        angle = float(np.linalg.norm(more))
        rotation = rotation_about(more / angle, angle) @ rotation if angle > 1e-6 else rotation
    return make_pose(target[:3, 3] + (target[:3, 3] - hand[:3, 3]) * FIRMER * stalled, rotation)


def _lost(env: KitchenEnv, pose: Array, most_m: float) -> bool:
    """Whether the hand has slipped off what it held, or pushed."""
    return pose_error(env.data, as_target(pose)).position > most_m


def _behind(env: KitchenEnv, carried: Carried, step: int) -> float:
    """How far the hand is behind where it should have come to by a step, in `BEHIND_M`; infinite where it is not.

    A hand that has run ahead would run farther while it waits.
    """
    pose = carried.hand(min(step + 1, carried.piece.segment.end - 1))
    error, now = pose_error(env.data, as_target(pose)), grip_position(env.data)
    late = error.position > BEHIND_M and float((pose[:3, 3] - now) @ (carried.target(step)[:3, 3] - now)) > 0.0
    if not late and error.rotation < BEHIND_RAD:
        return np.inf
    return error.position / BEHIND_M + error.rotation / BEHIND_RAD


def base_command(env: KitchenEnv, goal: Array) -> Array:
    """Base command (4,) towards x, y and heading, with the dead zones made up for."""
    position, yaw = base_pose(env.data)
    cos, sin = np.cos(yaw), np.sin(yaw)
    away = np.array([[cos, sin], [-sin, cos]]) @ (goal[:2] - position[:2])
    turn = wrap(float(goal[2]) - yaw)
    command = np.zeros(4)
    if float(np.hypot(*away)) > BASE_NEAR_M:
        speed = limit(away * BASE_GAIN, BASE_MOST)
        command[:2] = speed + np.sign(speed) * DEAD_ZONE * (np.abs(speed) > 0.02)
    if abs(turn) > BASE_NEAR_RAD:
        command[2] = np.clip(turn * BASE_GAIN, -0.4, 0.4) + np.sign(turn) * TURN_DEAD_ZONE
    return command
