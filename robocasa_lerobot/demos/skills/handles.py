"""Doors on a vertical hinge, opened: pulled by their handle, and pushed on from inside at their free edge.

What takes long are fridges before an island or a wall, which leave the base little room.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    OPEN,
    UP,
    Array,
    HandTarget,
    frame,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.articulated import ContactPath, Shift, Waypoint, plan_contact
from robocasa_lerobot.demos.planning.contact_paths import arc_waypoints, grip_path
from robocasa_lerobot.demos.skills.arc_motion import (
    arm_bends,
    pull_arc,
    push_arc,
    retract,
    stances_around,
    working_height,
)
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.demos.skills.doors import doors
from robocasa_lerobot.demos.skills.drop_down_doors import fold_down
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
# Wanted of a pull, with ease or at least; enough to get behind the edge.
FAR_RAD, AJAR_RAD, ENOUGH_RAD = np.deg2rad(65.0), np.deg2rad(40.0), np.deg2rad(22.0)
KNOB_M = 0.06  # a handle as low as this may be held from above and below, too
SLIPPED = 0.5  # cost of a tilt of the hand in which it has lost the handle, and of a push that has come to nothing
EASY = 0.6  # cost of a pull
# How the base may go along with a pull: ahead, and to the side of the hinge, metres.
PULL_ALONG = ((0.0, 0.0), (-0.25, 0.0), (-0.3, 0.25))
RETREAT: Shift = (-0.2, 0.0)
FARTHER_RAD = 0.5  # that it is pulled on where the hand does not get behind it
MOST_COST = 1.4  # of a push: where the hand hardly gets behind the door, it is pulled farther
OPEN_SHARE, ENOUGH_SHARE = 0.95, 0.91  # wanted, and enough: tasks ask for 0.90
TURN = 0.5  # share of the door's angle by which the hand turns with its handle
# Of the hand's approach from the door's normal: to the side of the hinge and upwards, radians.
GRASP_TILTS = ((0.0, 0.0), (0.0, -0.35), (0.0, 0.35), (-0.44, 0.0), (0.44, 0.0), (0.0, -0.75))
# Where the hand pushes from inside: share of the width, how far its tip is past that point, turn towards the hinge and
# pitch in degrees, and the bias against it.
PUSHES = (
    (1.0, 0.07, 0.0, 0.0, 0.0),
    (1.0, 0.07, 30.0, 0.0, 0.0),
    (1.0, 0.07, -25.0, 0.0, 0.0),
    (1.0, 0.07, 20.0, -35.0, 0.0),
    (1.0, 0.09, 0.0, -60.0, 0.05),
    (1.0, 0.09, 30.0, -60.0, 0.05),
    (1.0, 0.09, 0.0, -80.0, 0.05),
    (0.9, 0.04, 50.0, 0.0, 0.1),
    (0.65, 0.0, 60.0, 0.0, 0.2),
)
HAND_THICK_M = 0.022
WIDE_RAD, BEYOND_M, BESIDE_M = np.deg2rad(50.0), 0.18, 0.10
ROUND_M = 0.10  # how far from the free edge the hand goes round it
PULL_NEAR: list[Shift] = [
    (0.0, 0.0),
    (-0.12, 0.0),
    (-0.12, 0.2),
    (-0.12, -0.2),
    (-0.25, 0.0),
    (-0.2, 0.35),
    (-0.2, -0.35),
]
PUSH_NEAR: list[Shift] = [
    (0.0, 0.0), (-0.15, 0.0), (0.0, 0.2), (0.0, -0.2), (-0.15, 0.25), (-0.15, -0.25), (-0.3, 0.0), (0.15, 0.0),
    (0.15, 0.25), (0.15, -0.25), (-0.3, 0.35), (-0.3, -0.35), (-0.15, 0.5), (-0.15, -0.5), (-0.45, 0.2), (-0.45, -0.2),
]  # fmt: skip


def open_doors(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Open every door of the stage's fixture, or of its part.

    Raises:
        SkillError: a door is not open after four attempts.
    """
    # The lower of two doors first: an open one above hems the arm in.
    order = sorted(doors(env, stage), key=lambda door: round(door.point(np.zeros(3), 0.0)[2], 2))
    moved = False
    for door in (*order, *order):  # one that is open may be pushed to while the other is opened
        if not door.upright:
            yield from fold_down(env, door)
            continue
        slipped: list[tuple[float, ...]] = []
        for attempt in range(ATTEMPTS):
            if door.share >= ENOUGH_SHARE:
                break
            if moved:
                yield from retract(env, OPEN)
            moved = True
            try:
                yield from _attempt(env, door, slipped)
            except SkillError:
                if attempt == ATTEMPTS - 1:
                    raise
                yield from shift_base(env, RETREAT, OPEN)  # from elsewhere other places are reached
        if door.share < ENOUGH_SHARE:
            raise SkillError(f"{door.name} is {door.share:.0%} open after {ATTEMPTS} attempts")


def _attempt(env: KitchenEnv, door: ArticulatedPart, slipped: list[tuple[float, ...]]) -> Iterator[Array]:
    """Pull the door ajar if it is not, and push it open, or pull it farther where the hand does not get behind it."""
    if door.angle < ENOUGH_RAD:
        yield from _pull(env, door, slipped)
    if ENOUGH_RAD <= door.angle < OPEN_SHARE * door.full:
        try:
            yield from _push(env, door, slipped)
        except SkillError:
            yield from _pull(env, door, slipped)


def _pull(env: KitchenEnv, door: ArticulatedPart, slipped: list[tuple[float, ...]]) -> Iterator[Array]:
    """Grasp the handle and pull the door open, as far as the arm gets with ease.

    A tilt of the hand in which the handle slips out of it is noted in `slipped`, and is the last choice from then on.

    Raises:
        SkillError: it does not even get it farther by a bit.
    """
    stances = [
        (start, (start[0] + ahead, start[1] + door.side * aside))
        for start, _ in stances_around(env, door, PULL_NEAR)
        for ahead, aside in PULL_ALONG
    ]
    bends = arm_bends(env, door)
    low, high = door.handle()
    rolls = (0, 2, 1, 3) if high[2] - low[2] < KNOB_M else (0, 2)
    least = max(AJAR_RAD, door.angle + FARTHER_RAD)
    goals = sorted({goal for goal in (OPEN_SHARE * door.full, FAR_RAD) if goal > least}, reverse=True)
    for goal in (*goals, min(least, OPEN_SHARE * door.full)):
        options = [(tilt, roll) for tilt in GRASP_TILTS for roll in rolls]
        paths = [_pull_path(env, door, *option, goal, bias=SLIPPED * (option[0] in slipped)) for option in options]
        try:
            plan = plan_contact(env, door, paths, stances, bends=bends)
        except SkillError:
            if goal <= least:
                raise
            continue
        if plan.cost < EASY or goal <= least:
            first = door.angle
            yield from pull_arc(env, door, plan, goal + 0.02)
            if door.angle < first + 0.5 * (goal - first):
                slipped.append(options[paths.index(plan.path)][0])
            yield from _come_round(env, door)
            return


def _come_round(env: KitchenEnv, door: ArticulatedPart) -> Iterator[Array]:
    """Bring the hand that has pulled a door wide open back round its free edge, not against it."""
    data = env.data
    if door.angle < WIDE_RAD:
        return
    hand = grip_position(data)
    z = hand[2] - door.point(np.zeros(3), 0.0)[2]
    for beside in (-BESIDE_M, BESIDE_M):
        beyond = door.point(np.array([door.side * (door.width + BEYOND_M), beside, z]), door.angle)
        yield from move_hand(data, HandTarget(beyond, hand_rotation(data)), OPEN, tolerance=0.05, max_steps=30)


def _pull_path(
    env: KitchenEnv, door: ArticulatedPart, tilt: tuple[float, float], roll: int, goal: float, *, bias: float
) -> ContactPath:
    low, high = door.handle()
    middle, room = (low[2] + high[2]) / 2, 0.2 * (high[2] - low[2])
    z = working_height(env, door, middle - room, middle + room)
    grip = np.array([(low[0] + high[0]) / 2, low[1] + min((high[1] - low[1]) / 2, 0.012), z])
    aside, up = tilt
    side = door.side

    def rotation_at(angle: float) -> Array:
        turn = door.turned(TURN * angle)
        approach = turn @ np.array([-side * np.sin(aside) * np.cos(up), np.cos(aside) * np.cos(up), np.sin(up)])
        return frame(approach, (turn[:, 0], UP, -turn[:, 0], -UP)[roll])

    return grip_path(door, grip, rotation_at, goal, bias=bias + 0.1 * (roll % 2))


def _push(env: KitchenEnv, door: ArticulatedPart, slipped: list[tuple[float, ...]]) -> Iterator[Array]:
    """Push the door open, from inside; a push that comes to nothing is noted in `slipped`."""
    options = [(push, flip) for push in PUSHES for flip in (1.0, -1.0)]
    paths = [_push_path(env, door, *option, more=SLIPPED * (option[0] in slipped)) for option in options]
    stances, goal = stances_around(env, door, PUSH_NEAR), (OPEN_SHARE + 0.01) * door.full
    fruitless = yield from push_arc(env, door, paths, stances, goal, firm=True, most_cost=MOST_COST)
    if fruitless is not None:
        slipped.append(options[paths.index(fruitless)][0])


def _push_path(
    env: KitchenEnv, door: ArticulatedPart, push: tuple[float, float, float, float, float], flip: float, *, more: float
) -> ContactPath:
    share, past, degrees, pitch, bias = push
    side = door.side
    z = working_height(env, door, door.low[2] + 0.06, door.high[2] - (0.06 if pitch > -50.0 else 0.02))
    # Bins stand out of the inside of fridges' doors, but not at the edge.
    local = np.array([side * share * door.width, 0.0 if share > 0.95 else door.inside, z])
    turn, up = np.deg2rad(degrees), np.deg2rad(pitch)
    level = np.cos(turn) * door.inwards - side * np.sin(turn) * door.rightwards
    approach = np.cos(up) * level + np.sin(up) * UP
    aside = side * np.cos(turn) * door.rightwards + np.sin(turn) * door.inwards  # away from the hinge
    rotation = frame(approach, flip * UP)

    def target_at(angle: float) -> HandTarget:
        return HandTarget(door.point(local, angle) + aside * HAND_THICK_M + approach * past, rotation)

    start = door.angle
    at = target_at(start)
    beside = HandTarget(at.position + aside * 0.07, rotation)
    # Round the free edge, not through the door.
    beyond = door.point(np.array([side * (door.width + ROUND_M), -0.06, z]), start)
    end = OPEN_SHARE * door.full
    arc = arc_waypoints(start, end, target_at, (0.0, 0.5, 1.0))
    return ContactPath(
        (Waypoint(start, HandTarget(beyond, rotation)), Waypoint(start, beside), *arc), 2, target_at, bias + more
    )
