"""The lid of a blender lifted off by its knob, and laid on the counter; `blender_cover` puts it on the jug.

The jug stands under a wall cabinet: where the arm does not get under it without touching it, the hand misses the knob.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    frame,
    grip_position,
    hand_rotation,
    pose_error,
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.footprints import Area, Footprint, PlacementError
from robocasa_lerobot.envs.scene.placement.counter_areas import counter_areas
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.scene.roles import footprint
from robocasa_lerobot.envs.scene.spec import OnCounter
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
GRASP_STEPS, RELEASE_STEPS, PUT_STEPS = 12, 10, 90
HOVER_M, LIFT_M, DROP_M = 0.08, 0.05, 0.003
ABOVE_M, BEFORE_M = 0.12, 0.10  # the wrist turns this high over the hover, or this far before it
AWAY_M = 0.20  # after the release; tasks ask for 15 cm
HOLD_M = 0.028  # of the grip above the lid's origin: the middle of its knob
PLUG_M = 0.016  # of the lid's lowest point below its origin
# The hand points down and forwards by these angles, and to the sides by those, radians.
TILTS = tuple(np.deg2rad((8.0, 20.0, 35.0, 55.0, 85.0)))
TURNS = tuple(np.deg2rad((0.0, 25.0, -25.0, 50.0, -50.0)))
TRIED, ALIKE = 0.6, 2.5  # cost of a hand held as one that has failed; trace of the turn between the two
FARTHER = 0.02  # cost of each place for the lid before which there is a nearer one
ROSE_M = 0.01  # of a lid that is held
LOST_M = 0.05  # a lid farther than this from the hand is no longer held
SPOTS, SPOT_STEP_M, SPOT_MARGIN_M = 6, 0.06, 0.02


def uncover(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Lift the lid off and lay it on the counter beside the blender.

    Raises:
        SkillError: it does not lie there after four attempts.
    """
    blender = the_blender(env, stage)
    spots = [spot + UP * PLUG_M for spot in free_spots(env, blender)]
    yield from _carry(env, stage, blender, spots)


def the_blender(env: KitchenEnv, stage: Stage) -> Blender:
    """The blender that a stage is about."""
    return env.scene.fixture(stage.target, Blender)


def _carry(env: KitchenEnv, stage: Stage, blender: Blender, spots: list[Array]) -> Iterator[Array]:
    """Take the lid to one of the spots of its origin."""
    data = env.data
    if not spots:
        raise SkillError(f"no room on the counter for the lid of {blender.name}")
    tried: list[Array] = []
    for _ in range(ATTEMPTS):

        def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
            lid, at = data.body(blender.lid), data.body(blender.lid).xpos + UP * HOLD_M
            paths = [
                WaypointPath(
                    _row(at, spot + UP * (HOLD_M + DROP_M), rotation, blender),
                    TRIED * sum(float(np.trace(rotation.T @ other)) > ALIKE for other in tried) + FARTHER * number,
                    Held(blender.lid, rotation.T @ (lid.xpos - at), rotation.T @ lid.xmat.reshape(3, 3)),
                )
                for number, spot in enumerate(spots)
                for rotation in grasps(env)
            ]
            allowed = frozenset({int(env.model.body(blender.lid).id)})
            return plan_reach(env, paths, at, key=1, allowed=allowed, blocked=blocked)[0]

        choice = yield from approach(env, plan, OPEN)
        tried.append(choice.targets[1].rotation)
        yield from follow_joint_path(env, choice.joints, OPEN)
        hover, grasp, lifted, over, put = choice.targets
        yield from move_hand(data, hover, OPEN, tolerance=0.015)
        yield from move_hand(data, grasp, OPEN, speed=0.6, tolerance=0.006, max_steps=50)
        if pose_error(data, grasp).position < LOST_M:  # else it is blocked, and there is nothing to close on
            yield from _take_over(env, blender, grasp, lifted, over, put)
        rest = HandTarget(grip_position(data), hand_rotation(data))
        yield from hold_hand(data, rest, OPEN, RELEASE_STEPS)
        away = HandTarget(rest.position - AWAY_M * rest.rotation[:, 2], rest.rotation)
        yield from move_hand(data, away, OPEN, tolerance=0.02, max_steps=50)
        if stage_done(env, stage):
            return
    raise SkillError(f"the lid of {blender.name} is not where it belongs after {ATTEMPTS} attempts")


def _take_over(
    env: KitchenEnv, blender: Blender, grasp: HandTarget, lifted: HandTarget, over: HandTarget, put: HandTarget
) -> Iterator[Array]:
    """Close on the knob, lift the lid and bring it to where it goes, if it is held."""
    data = env.data
    start = float(data.body(blender.lid).xpos[2])
    yield from hold_hand(data, grasp, CLOSED, GRASP_STEPS)
    yield from move_hand(data, lifted, CLOSED, speed=0.8, tolerance=0.02)
    if np.linalg.norm(_held_off(env, blender)) < LOST_M and data.body(blender.lid).xpos[2] > start + ROSE_M:
        yield from move_hand(data, over, CLOSED, tolerance=0.015, max_steps=110)
        # The lid has its place, not the hand: it may have slipped between the fingers.
        for goal, steps in ((over, 50), (put, PUT_STEPS)):
            exact = HandTarget(goal.position + _held_off(env, blender), goal.rotation)
            yield from move_hand(data, exact, CLOSED, speed=0.6, tolerance=0.004, max_steps=steps)


def _held_off(env: KitchenEnv, blender: Blender) -> Array:
    """How far the grip is from where it should hold the lid, (3,), metres."""
    off: Array = grip_position(env.data) - env.data.body(blender.lid).xpos - UP * HOLD_M
    return off


def _row(at: Array, put: Array, rotation: Array, blender: Blender) -> tuple[HandTarget, ...]:
    """Over the knob, at it, above the jug's rim with the lid, over where it goes, and there."""
    height = blender.lid_pose[0][2] + HOLD_M + LIFT_M
    return (
        HandTarget(at - HOVER_M * rotation[:, 2], rotation),
        HandTarget(at, rotation),
        HandTarget(np.array([*at[:2], height]), rotation),
        HandTarget(np.array([*put[:2], height]), rotation),
        HandTarget(put, rotation),
    )


def grasps(env: KitchenEnv) -> list[Array]:
    """Rotations of the hand with a finger at either side of the knob, looking down and forwards."""
    _, yaw = base_pose(env.data)
    out = []
    for turn in TURNS:
        level = np.array([np.cos(yaw + turn), np.sin(yaw + turn), 0.0])
        side = np.cross(level, UP)
        for tilt in TILTS:
            approach = np.cos(tilt) * level - np.sin(tilt) * UP
            out += [frame(approach, side), frame(approach, -side)]
    return out


def free_spots(env: KitchenEnv, blender: Blender) -> list[Array]:
    """Points of the counter beside the blender with room for the lid, those nearest to the robot's path first."""
    layout = env.scene.layout
    try:
        areas, standing = counter_areas(layout, OnCounter("", "left_right", size=(0.45, 0.40)), blender)
    except PlacementError:
        return []
    width, depth, _ = blender.lid_size
    half = (width / 2, depth / 2)
    found = [
        np.array([mark.x, mark.y, area.z])
        for area in areas
        for mark in _marks(area, half)
        if not any(mark.overlaps(other, SPOT_MARGIN_M) for other in (*standing, footprint(blender)))
    ]
    base, _ = base_pose(env.data)

    def cost(spot: Array) -> float:
        return float(np.linalg.norm((spot - base)[:2]) + np.linalg.norm((spot - np.asarray(blender.pos))[:2]))

    return sorted(found, key=cost)[: 3 * SPOTS : 3]


def _marks(area: Area, half: tuple[float, float]) -> list[Footprint]:
    """Footprints on a grid over an area, square to it."""
    cos, sin = np.cos(area.yaw), np.sin(area.yaw)
    xs = np.arange(area.x0 + half[0], area.x1 - half[0] + 1e-6, SPOT_STEP_M)
    ys = np.arange(area.y0 + half[1], area.y1 - half[1] + 1e-6, SPOT_STEP_M)
    return [
        Footprint(float(area.origin[0] + cos * x - sin * y), float(area.origin[1] + sin * x + cos * y), area.yaw, half)
        for x in xs
        for y in ys
    ]
