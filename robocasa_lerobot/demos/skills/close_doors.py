"""Doors pushed shut along their whole arc: on a vertical hinge from outside, folding ones lifted from below.

What fails is the second of two doors where walls and islands leave no place beyond it, and a door whose opening angle
puts it inside its neighbour, where no finger gets behind it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, frame
from robocasa_lerobot.demos.planning.articulated import ContactPath, Shift
from robocasa_lerobot.demos.planning.contact_paths import push_path
from robocasa_lerobot.demos.skills.arc_motion import push_arc, retract, stances_around, working_height
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.doors import SHUT_GOAL, doors
from robocasa_lerobot.demos.skills.drop_down_doors import stances_beside
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
FORWARDS = np.array([0.0, -1.0, 0.0])  # to the room, in the fixture's axes: outwards for a door that is shut
# From below: share of the door's height, turn of the hand from across the door to inwards, its pitch, degrees.
LIFTS = tuple(
    (share, turn, pitch) for share in (0.65, 0.45) for turn, pitch in ((0, 0), (0, -18), (30, 0), (30, -18), (55, 0))
)
# From before a door that is ajar: place along it as a share of its half width, share of its height, turn of the hand
# from inwards to the right, degrees.
SHOVES = tuple((place, share, turn) for place in (0.0, -0.5, 0.5) for share in (0.85, 0.6) for turn in (0, 30, -30))
AJAR_SHARE, LIFT_BIAS = 0.15, 0.5  # and the bias against lifting a door that is ajar
CREEP_RAD = 0.015  # in the time of a stall: a hand that is held up by something else gains no more
# From outside: share of the door's width, turn of the hand from inwards to the side of the free edge, its pitch,
# degrees. Round the free edge the hand comes from where the door opens to; low doors are pushed from above.
PUSHES = (
    *((share, turn, pitch) for share in (0.75, 0.5) for turn, pitch in ((45, 0), (25, 0), (65, 0), (45, -20))),
    *((0.75, turn, pitch) for pitch in (-50, -75) for turn in (0, 45)),
    *((0.93, turn, 0) for turn in (0, -30, -60)),
    *((share, turn, 0) for share in (0.75, 0.5) for turn in (0, -25)),
)
ROUND_BIAS = 0.4  # against reaching round the free edge: the hand may meet it
FAILED_BIAS = 0.5  # against a push that has come to nothing
NEAR: list[Shift] = [(0.0, 0.0), (-0.2, 0.0), (-0.2, 0.25), (-0.2, -0.25), (-0.4, 0.0)]


def close_doors(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push each door of the stage's fixture, or of its part, shut from outside, the base going along.

    Raises:
        SkillError: a door is not shut after four attempts.
    """
    for number, door in enumerate(doors(env, stage)):
        failed: list[tuple[float, float, float]] = []
        for attempt in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            if attempt > 0 or number > 0:
                yield from retract(env, CLOSED)
            yield from _push(env, door, failed)
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def lift_shut(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Lift a door that folds down, the fingers under it from the side, and push it shut.

    Raises:
        SkillError: it is not shut after four attempts.
    """
    for door in doors(env, stage):
        for _ in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            ajar = door.share < AJAR_SHARE
            paths = [
                _lift_path(env.robot.gripper, door, lift, side, roll, bias=LIFT_BIAS * ajar)
                for lift in LIFTS
                for side in (1.0, -1.0)
                for roll in (1.0, -1.0)
            ]
            if ajar:
                paths += [_shove_path(env.robot.gripper, door, shove, roll) for shove in SHOVES for roll in (1.0, -1.0)]
            goal, stances = SHUT_GOAL * door.full, stances_beside(env, door)
            yield from push_arc(env, door, paths, stances, goal, firm=True, stall_rad=CREEP_RAD)
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def _push(env: KitchenEnv, door: ArticulatedPart, failed: list[tuple[float, float, float]]) -> Iterator[Array]:
    """Push a door shut from outside; a push that comes to nothing is noted in `failed`."""
    options = [(push, roll) for push in PUSHES for roll in (1.0, -1.0)]
    paths = [_push_path(env, door, *option, more=FAILED_BIAS * failed.count(option[0])) for option in options]
    stances = stances_around(env, door, NEAR, follow=0.25)
    fruitless = yield from push_arc(env, door, paths, stances, SHUT_GOAL * door.full, firm=True)
    if fruitless is not None:
        failed.append(options[paths.index(fruitless)][0])


def _push_path(
    env: KitchenEnv, door: ArticulatedPart, push: tuple[float, float, float], roll: float, *, more: float
) -> ContactPath:
    share, turn, pitch = push
    side = door.side
    z = working_height(env, door, door.low[2] + 0.06, door.high[2] - 0.06)
    local = np.array([side * share * door.width, door.outside, z])
    aside, up = np.deg2rad(turn), np.deg2rad(pitch)
    level = np.cos(aside) * door.inwards + side * np.sin(aside) * door.rightwards
    rotation = frame(np.cos(up) * level + np.sin(up) * UP, roll * UP)
    bias = more + (ROUND_BIAS if share > 0.9 else 0.0)
    return push_path(env.robot.gripper, door, local, FORWARDS, lambda _: rotation, SHUT_GOAL * door.full, bias=bias)


def _lift_path(
    gripper: GripperGeometry,
    door: ArticulatedPart,
    lift: tuple[float, float, float],
    side: float,
    roll: float,
    *,
    bias: float,
) -> ContactPath:
    """From the right (side 1) or the left."""
    share, turn, pitch = lift
    reach = door.high[0] if side > 0 else -door.low[0]
    local = np.array([side * (reach - 0.05), door.outside, share * door.high[2]])
    aside, up = np.deg2rad(turn), np.deg2rad(pitch)
    level = -side * np.cos(aside) * door.rightwards + np.sin(aside) * door.inwards
    approach = np.cos(up) * level + np.sin(up) * UP

    def rotation_at(angle: float) -> Array:
        # The wide side of the hand keeps along the door.
        return frame(approach, roll * door.turned(angle)[:, 2])

    goal = SHUT_GOAL * door.full
    return push_path(gripper, door, local, FORWARDS, rotation_at, goal, off_m=0.02, back_m=0.14, bias=bias)


def _shove_path(
    gripper: GripperGeometry, door: ArticulatedPart, shove: tuple[float, float, float], roll: float
) -> ContactPath:
    place, share, turn = shove
    local, aside = np.array([place * door.high[0], door.outside, share * door.high[2]]), np.deg2rad(turn)
    rotation = frame(np.cos(aside) * door.inwards + np.sin(aside) * door.rightwards, roll * UP)
    return push_path(gripper, door, local, FORWARDS, lambda _: rotation, SHUT_GOAL * door.full)
