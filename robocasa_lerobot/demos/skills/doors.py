"""Doors and lids, pushed shut: doors on a vertical hinge from outside near their free edge, lids from above.

Measured without action noise on seeds 0-5 of the target and of the pretrain split: CloseCabinet solves 5 and 2 of 6,
CloseMicrowave 5 and 4, CloseElectricKettleLid 5 and 6. What fails most are cabinets with two doors: the arm does not
reach round the second door from where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    Array,
    HandTarget,
    base_pose,
    frame,
    grip_position,
    hand_rotation,
    nearer_turn,
)
from robocasa_lerobot.demos.skills.common import SkillError, move_hand
from robocasa_lerobot.demos.skills.hinged import UP, Hinged, in_base, push_round, shift_base
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.appliances.base import Appliance
from robocasa_lerobot.envs.scene.fixtures.cabinets import HingeCabinet
from robocasa_lerobot.envs.task import Stage

ATTEMPTS = 3
HOVER_M = 0.06
FOLLOW_M = 0.75
SHUT_GOAL = 0.002  # below the 0.005 that tasks ask for


def close_doors(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push each door shut, from outside near its free edge.

    Raises:
        SkillError: a door is not shut after three attempts.
    """
    for door in doors(env, stage):
        for _ in range(ATTEMPTS):
            if door.share <= SHUT_GOAL:
                break
            yield from _shut(env, door)
        if door.share > SHUT_GOAL:
            raise SkillError(f"{door.name} is still {door.share:.1%} open after {ATTEMPTS} attempts")


def doors(env: KitchenEnv, stage: Stage) -> list[Hinged]:
    """Doors of the stage's fixture."""
    fixture = env.scene.fixture(stage.target)
    if isinstance(fixture, HingeCabinet):
        joints = fixture.door_joints
    else:
        assert isinstance(fixture, Appliance)
        joints = tuple(fixture.joint(part) for part in fixture.doors)
    return [Hinged(env.data, fixture, joint) for joint in joints]


def _shut(env: KitchenEnv, door: Hinged) -> Iterator[Array]:
    """A door on a vertical hinge: reach round its edge, and follow its arc with the finger tips."""
    data = env.data
    edge = door.low[0] if abs(door.low[0]) > abs(door.high[0]) else door.high[0]
    width = abs(edge)
    height = door.point(np.zeros(3), 0.0)[2]
    reach = base_pose(data)[0][2] + 0.40
    z = float(np.clip(reach - height, door.low[2] + 0.05, door.high[2] - 0.05))
    front = door.low[1]
    outside = float(np.sign(edge))

    def rotation(angle: float) -> Array:
        # Looks between inwards and across the door, the wide side of the hand upright.
        half = door.turned(0.5 * angle)
        return frame(half[:, 1] - 0.15 * UP, UP if outside < 0 else -UP)

    start = door.angle
    local = np.array([outside * 0.75 * width, front - 0.005, z])
    wide = np.array([outside * (width + 0.12), front - 0.12, z])
    beside = np.array([outside * 0.80 * width, front - 0.10, z])
    ahead, left = in_base(data, door.point(wide, start))
    if ahead > 0.75 or abs(left) > 0.45:
        yield from _stand_before(env, door, door.point(wide, start), 0.5, aside=-0.1 * outside)
    for spot, tolerance in ((wide, 0.06), (beside, 0.04)):
        yield from move_hand(data, HandTarget(door.point(spot, start), rotation(start)), CLOSED, tolerance=tolerance)
    yield from push_round(door, data, local, SHUT_GOAL, rotation, follow=FOLLOW_M)
    yield from _back_off(env)


def _stand_before(env: KitchenEnv, door: Hinged, point: Array, distance: float, aside: float = 0.0) -> Iterator[Array]:
    """Drive to where a point is `distance` ahead, and `aside` to its right."""
    # Sideways first, then nearer or back: there is often something behind the robot.
    spot = point - door.inwards * distance - door.rightwards * aside
    across = (spot - base_pose(env.data)[0]) @ door.rightwards
    yield from shift_base(env.data, base_pose(env.data)[0] + door.rightwards * across)
    yield from shift_base(env.data, spot)


def _back_off(env: KitchenEnv) -> Iterator[Array]:
    rotation = hand_rotation(env.data)
    away = HandTarget(grip_position(env.data) - rotation[:, 2] * 0.12, rotation)
    yield from move_hand(env.data, away, CLOSED, max_steps=20)


def push_lid(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push a lid over and down.

    Raises:
        SkillError: it is not shut after three attempts.
    """
    yield from _press_down(env, stage, stage.part, 0.002, lean=0.5)


def _press_down(env: KitchenEnv, stage: Stage, part: str, goal: float, *, lean: float) -> Iterator[Array]:
    data = env.data
    appliance = env.scene.appliance(stage.target)
    lid = Hinged(data, appliance, appliance.joint(part))
    far = lid.high[1] if abs(lid.high[1]) > abs(lid.low[1]) else lid.low[1]

    def rotation(angle: float) -> Array:
        # From above, leaning so that the forearm keeps below wall cabinets.
        return nearer_turn(frame(lean * lid.inwards - UP, lid.rightwards), hand_rotation(data))

    for _ in range(ATTEMPTS):
        top = lid.high[2]
        local = np.array([0.0, 0.8 * far, top])
        start = lid.angle
        over = HandTarget(lid.point(local + HOVER_M * UP, start), rotation(start))
        yield from move_hand(data, over, CLOSED, tolerance=0.03)
        yield from push_round(lid, data, local, goal, rotation)
        if lid.share <= goal:
            return
        yield from _back_off(env)
    raise SkillError(f"{lid.name} is still {lid.share:.1%} open after {ATTEMPTS} attempts")
