"""Reach into a microwave, round its open door and under its roof; into a toaster oven; into drawers, pulled out."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.motion import (
    OPEN,
    Array,
    HandTarget,
    base_pose,
    floor_axes,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.collision import CollisionChecker
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.demos.skills.drawers import drag_open
from robocasa_lerobot.demos.skills.navigation import Room
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import (
    FROM_CRISPER,
    OUT_OF_DRAWER,
    GraspStrategy,
    in_radians,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.level_grasps import level_grasps
from robocasa_lerobot.demos.skills.pick_place.location import Location
from robocasa_lerobot.demos.skills.pick_place.pick import RELEASE_STEPS, best_grasp
from robocasa_lerobot.demos.skills.racks import pull
from robocasa_lerobot.demos.skills.reaching import go_to
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.microwave import Microwave
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

ASIDES_M = (0.08, 0.02, -0.03, -0.06, -0.09, -0.12, -0.15)  # of a stand to the right of the cavity's middle
OPEN_SHARE = 0.3
BACKS_M, MORE_BACK_M = (0.10, 0.20, 0.30, 0.40, 0.50, 0.60), (0.0, 0.05, 0.10, 0.15, 0.20)
STEP_M = 0.06  # between places that are tested
# A grasp on a rack that costs more closes askew on what lies across near the roof, and slips off: it serves to bring
# that nearer. Of seven such on development seeds one held, of 53 cheaper ones 52.
DOUBTFUL_ON_RACK = 2.1
HARD = 1.0  # cost of taking something out of a drawer, from which on it is pulled out first
REACHABLE = 0.9  # share of a drawer that is far enough out to take something out of it
FARTHER_OUT_M = 0.12  # how far
OFF_M = 0.10  # of the hand from what it has let go


OUT_OF_A_MICROWAVE = GraspStrategy(
    in_radians((60, 0.0), (72, 0.05), (48, 0.05), (35, 0.1), (86, 0.2)),
    ("across", "out"),
    poses=level_grasps,
)


# What lies on a rack that is pulled out may have a roof over it, or the next rack, or neither.
OUT_OF_A_TOASTER_OVEN = replace(
    OUT_OF_A_MICROWAVE,
    tilts=in_radians((48, 0.0), (35, 0.0), (60, 0.05), (20, 0.05), (72, 0.1), (86, 0.2)),
    entries=("across", "out", "up"),
    narrow=True,
    among_tilts=True,
    doubtful=DOUBTFUL_ON_RACK,
)


def drive_around_open_door(env: KitchenEnv, oven: Microwave, gripper: float = OPEN) -> Iterator[Array]:
    """Where the open door stands between the robot and the cavity: drive back, past it, and up to the cavity."""
    if oven.share(env.data, "door") < OPEN_SHARE:
        return
    base, yaw = base_pose(env.data)
    left = floor_axes(yaw)[1]
    cavity = oven.regions["interior"]
    beside = float((base - cavity.world(env.data)) @ left)
    if beside < cavity.half[0]:
        return
    for place in _path_around(env, base, yaw, beside):
        yield from go_to(env, place, gripper)


def _path_around(env: KitchenEnv, base: Array, yaw: float, beside: float) -> Sequence[RobotPose]:
    """Places of the shortest path on which the folded robot meets nothing; none where there is no such path."""
    ahead, left = floor_axes(yaw)
    room = Room(env.scene)
    checker = CollisionChecker(env.scene, env.data)

    def at(back: float, right: float) -> RobotPose:
        x, y, _ = (base - back * ahead - right * left).tolist()
        return RobotPose(x, y, yaw)

    def clear(one: RobotPose, other: RobotPose) -> bool:
        count = max(int(np.ceil(np.hypot(other.x - one.x, other.y - one.y) / STEP_M)), 1)
        shares = (np.arange(1, count + 1) / count).tolist()
        between = [RobotPose(one.x + t * (other.x - one.x), one.y + t * (other.y - one.y), yaw) for t in shares]
        bases = np.array([(pose.x, pose.y, yaw) for pose in between])
        return bool(room.all_free(between).all() and checker.free(bases, checker.arm.home).all())

    for more, aside, back in itertools.product(MORE_BACK_M, ASIDES_M, BACKS_M):
        places = [at(0.0, 0.0), at(back, 0.0), at(back, beside + aside), at(more, beside + aside)]
        if back > more and all(clear(one, other) for one, other in itertools.pairwise(places)):
            return places[1:]
    return ()


def clear_of_counter(obj: Graspable, drawer: Drawer) -> Callable[[KitchenEnv], Iterator[Array]]:
    """Before a grasp: pull the drawer farther out where the counter over it blocks the hand, or a grasp failed."""
    again = False

    def first(env: KitchenEnv) -> Iterator[Array]:
        nonlocal again
        best = best_grasp(env, obj, OUT_OF_DRAWER)
        if again or best.cost > HARD:
            if best.base is not None:  # out of reach from here, as its drawer is
                yield from go_to(env, best.base, OPEN)
            yield from drag_open(env, drawer, 1.0 + FARTHER_OUT_M / drawer.full_travel)
        again = True

    return first


def pull_out_first(obj: Graspable, place: Location) -> Callable[[KitchenEnv], Iterator[Array]]:
    """Before the first grasp in a drawer of an appliance: pull it fully out where the object is hard to reach."""
    done = False

    def first(env: KitchenEnv) -> Iterator[Array]:
        nonlocal done
        fixture = place.fixture
        roles = [role for role, name in env.scene.roles.items() if fixture is not None and name == fixture.name]
        if done or not roles or best_grasp(env, obj, FROM_CRISPER).cost <= HARD:
            done = True
            return
        done = True
        with contextlib.suppress(SkillError):
            yield from pull(env, Stage("racks", "pull", roles[0], part=place.region), enough=REACHABLE)
        data = env.data
        at = HandTarget(grip_position(data), hand_rotation(data))
        yield from hold_hand(data, at, OPEN, RELEASE_STEPS)
        off = HandTarget(at.position - OFF_M * at.rotation[:, 2], at.rotation)
        yield from move_hand(data, off, OPEN, tolerance=0.03, max_steps=20)

    return first
