"""Doors pushed shut along their whole arc: on a vertical hinge from outside, folding ones lifted from below.

What fails is the second of two doors where walls and islands leave no place beyond it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import CLOSED, UP, Array, frame
from robocasa_lerobot.demos.planning.articulated import ContactPath, Shift
from robocasa_lerobot.demos.planning.contact_paths import push_path
from robocasa_lerobot.demos.skills.arcs import push_arc, stances_round, tuck, working_height
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.doors import SHUT_GOAL, doors
from robocasa_lerobot.demos.skills.fold_down import stances_beside
from robocasa_lerobot.demos.skills.hinged import Hinged
from robocasa_lerobot.demos.skills.reach import shift_base
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

Push = tuple[float, float, float]

ATTEMPTS = 4
FORWARDS = np.array([0.0, -1.0, 0.0])  # to the room, in the fixture's axes: outwards for a door that is shut
# From below: share of the door's height, turn of the hand from across the door to inwards, its pitch, degrees.
LIFTS = tuple(
    (share, turn, pitch) for share in (0.65, 0.45) for turn, pitch in ((0, 0), (0, -18), (30, 0), (30, -18), (55, 0))
)
# From outside: share of the door's width, turn of the hand from inwards to the side of the free edge, its pitch,
# degrees. Round the free edge the hand comes from where the door opens to; low doors are pushed from above.
PUSHES = (
    *((share, turn, pitch) for share in (0.75, 0.5) for turn, pitch in ((45, 0), (25, 0), (65, 0), (45, -20))),
    *((0.75, turn, pitch) for pitch in (-50, -75) for turn in (0, 45)),
    *((0.93, turn, 0) for turn in (0, -30, -60)),
)
SLIPPED, MOVED_RAD = 0.6, 0.1  # cost of a push under which the door has turned by less than that
RETREAT: Shift = (-0.2, 0.0)  # from a door that was not shut
RETREAT_STEPS = 25
ROUND_BIAS = 0.4  # against reaching round the free edge: the hand may meet it
NEAR: list[Shift] = [(0.0, 0.0), (-0.2, 0.0), (-0.2, 0.25), (-0.2, -0.25), (-0.4, 0.0)]


def close_doors(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push each door of the stage's fixture, or of its part, shut from outside, the base going along.

    Raises:
        SkillError: a door is not shut after four attempts.
    """
    for number, door in enumerate(doors(env, stage)):
        slipped: list[Push] = []
        for attempt in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            if attempt > 0 or number > 0:
                yield from tuck(env, CLOSED)
            yield from _close(env, door, slipped)
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def _close(env: KitchenEnv, door: Hinged, slipped: list[Push]) -> Iterator[Array]:
    """Push a door as far as it goes; a push under which it hardly turns is noted in `slipped`, and tried last.

    Raises:
        SkillError: the arm reaches it nowhere.
    """
    pushes = [(push, roll) for push in PUSHES for roll in (1.0, -1.0)]
    ways = [_push_way(env, door, push, roll, SLIPPED * (push in slipped)) for push, roll in pushes]
    stances, before = stances_round(env, door, NEAR, follow=0.25), door.angle
    goal = SHUT_GOAL * door.full
    path = yield from push_arc(env, door, ways, stances, goal, firm=True)
    if before - door.angle < MOVED_RAD:
        slipped.append(pushes[ways.index(path)][0])
        yield from shift_base(env, RETREAT, CLOSED, RETREAT_STEPS)


def lift_shut(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Lift a door that folds down, the fingers under it from the side, and push it shut.

    Raises:
        SkillError: it is not shut after four attempts.
    """
    for door in doors(env, stage):
        for _ in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            ways = [_lift_way(door, lift, side, roll) for lift in LIFTS for side in (1.0, -1.0) for roll in (1.0, -1.0)]
            yield from push_arc(env, door, ways, stances_beside(env, door), SHUT_GOAL * door.full, firm=True)
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def _push_way(env: KitchenEnv, door: Hinged, push: Push, roll: float, more: float) -> ContactPath:
    share, turn, pitch = push
    side = door.side
    z = working_height(env, door, door.low[2] + 0.06, door.high[2] - 0.06)
    local = np.array([side * share * door.width, door.outside, z])
    aside, up = np.deg2rad(turn), np.deg2rad(pitch)
    level = np.cos(aside) * door.inwards + side * np.sin(aside) * door.rightwards
    rotation = frame(np.cos(up) * level + np.sin(up) * UP, roll * UP)
    bias = more + (ROUND_BIAS if share > 0.9 else 0.0)
    return push_path(door, local, FORWARDS, lambda _: rotation, SHUT_GOAL * door.full, bias=bias)


def _lift_way(door: Hinged, lift: tuple[float, float, float], side: float, roll: float) -> ContactPath:
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

    return push_path(door, local, FORWARDS, rotation_at, SHUT_GOAL * door.full, off_m=0.02, back_m=0.14)
