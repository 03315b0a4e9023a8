"""Take hold of a loose thing wherever it is: on a counter, in a basin, on a shelf, in a microwave.

Of all grasp poses, approaches and ways in and out that one is taken that the arm reaches best and that meets nothing,
after a drive where the arm falls short. A grasp that fails is followed by another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    base_pose,
    grip_position,
    hand_rotation,
    pose_error,
    rotation_about,
)
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.common import SkillError, close_fingers, hold_hand, move_hand
from robocasa_lerobot.demos.skills.things import Thing, grasps
from robocasa_lerobot.demos.skills.ways import GOOD_ENOUGH, Choice, Held, Way, approach, choose, lead
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

ATTEMPTS = 5
INSIST = 0.12
GRASP_STEPS, RELEASE_STEPS = 11, 8
STANDOFF_M, HOVER_M = 0.06, 0.12
LIFT_M, OUT_M = 0.12, 0.25
LIFTS_M, LOW_COST = (0.035, 0.010), 0.05  # before it is drawn out of a front
HELD_UP_M, LOWER_M = 0.08, 0.03
STEEP = 0.5  # sine of a slope
LEVEL_LIFT_M, LEVEL_COST = 0.004, 0.1  # before it is drawn out level
WORSE_GRASP = 0.45  # cost of a grasp's score below the best one's
TRIED, ALIKE_M = 1.2, 0.015  # cost of a grasp like one that has failed: its place in the thing is as near as this
# A thing that is held is nearer than this to where it was in the hand when that closed, and has risen by this share of
# the lift.
HELD_M, ROSE_SHARE = 0.05, 0.25


@dataclass(frozen=True)
class Manner:
    """How a thing is taken.

    Attributes:
        tilts: of the hand's approach from straight down to straight ahead, radians, with their costs.
        entries: whether the hand may come from above ("up"), or out of the front ("out" rises a little, "level" does
            not), or between ("across"), or along its fingers ("along").
        out_m: how far it goes on its way out, metres.
        hover_m, lift_m: how far over the grasp the hand comes from, and lifts to, where it comes from above, metres.
        lifts: before it is drawn out of a front, metres.
        turns: of a tilted approach from the base's heading to the left, radians.
        narrow: whether the hand keeps to straight lines also where these are steep, does not press down, and goes
            after a thing that it moves by its coming: in a drawer, which gives way.
        poses: grasps of a thing by a hand that comes along an approach.
        first: done before each attempt.
    """

    tilts: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    entries: tuple[str, ...] = ("up",)
    out_m: float = OUT_M
    hover_m: float = HOVER_M
    lift_m: float = LIFT_M
    lifts: tuple[float, ...] = LIFTS_M
    turns: tuple[float, ...] = (0.0,)
    narrow: bool = False
    poses: Callable[[KitchenEnv, Thing, Array], list[GraspPose]] = grasps
    first: Callable[[KitchenEnv], Iterator[Array]] | None = None


FROM_ABOVE = Manner(((0.0, 0.0), (np.deg2rad(30.0), 0.25)))
ANYHOW = Manner(
    ((0.0, 0.0), (np.deg2rad(35.0), 0.1), (np.deg2rad(65.0), 0.2), (np.deg2rad(88.0), 0.3)), ("up", "across", "out")
)
# Out of a slot in whose plane the hand may lean, below a wall cabinet.
FROM_A_SLOT = Manner(
    ((0.0, 0.0), (np.deg2rad(35.0), 0.1), (np.deg2rad(50.0), 0.2), (np.deg2rad(65.0), 0.3)),
    ("across", "out"),
    lifts=(0.06,),
    turns=(0.0, np.pi / 2, -np.pi / 2),
)


def pick(env: KitchenEnv, what: Thing, manner: Manner = FROM_ABOVE) -> Iterator[Array]:
    """Grasp a thing, and lift it or draw it out.

    Raises:
        SkillError: it is not in the gripper after all attempts.
    """
    data = env.data
    tried: list[HandTarget] = []
    for _ in range(ATTEMPTS):
        if manner.first is not None:
            yield from manner.first(env)
        body = data.body(what.name)
        start = body.xpos.copy()
        choice = yield from approach(env, lambda blocked: _best(env, what, manner, tried, blocked), OPEN)
        yield from lead(env, choice.joints, OPEN)
        far, before, at, lifted, out = choice.way.targets
        # All poses move with the thing, should it have been touched meanwhile.
        moved = data.body(what.name).xpos - start
        yield from move_hand(data, _shifted(far, moved), OPEN, tolerance=0.03)
        line = far.position + moved if manner.narrow or not steep(far, before) else None
        yield from move_hand(data, _shifted(before, moved), OPEN, tolerance=0.008, insist=INSIST, start=line)
        moved = data.body(what.name).xpos - start
        at = _shifted(at, moved)
        insist = 0.0 if manner.narrow else INSIST
        yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.005, max_steps=45, insist=insist)
        if manner.narrow:
            more = (data.body(what.name).xpos - start - moved) * [1.0, 1.0, 0.0]
            at = HandTarget(np.array([*(at.position + more)[:2], grip_position(data)[2]]), at.rotation)
            yield from move_hand(data, at, OPEN, speed=0.4, tolerance=0.004, max_steps=15)
        yield from close_fingers(data, at, GRASP_STEPS)
        inside = _inside(env, what)
        lift = float(lifted.position[2] - choice.way.targets[2].position[2])
        yield from move_hand(
            data, _shifted(lifted, moved), CLOSED, speed=0.7, tolerance=0.4 * lift, max_steps=50, insist=INSIST
        )
        rise = data.body(what.name).xpos[2] - start[2] - moved[2]
        if rise > ROSE_SHARE * lift and np.linalg.norm(_inside(env, what) - inside) < HELD_M:
            yield from _draw_out(env, _shifted(lifted, moved), _shifted(out, moved), manner.narrow)
            if np.linalg.norm(_inside(env, what) - inside) < HELD_M:
                return
        tried.append(HandTarget(data.body(what.name).xmat.reshape(3, 3).T @ (at.position - start), at.rotation))
        yield from hold_hand(data, HandTarget(grip_position(data), hand_rotation(data)), OPEN, RELEASE_STEPS)
        away = HandTarget(grip_position(data) - 0.08 * hand_rotation(data)[:, 2], hand_rotation(data))
        yield from move_hand(data, away, OPEN, tolerance=0.03, max_steps=25)
    raise SkillError(f"{what.title} was not lifted in {ATTEMPTS} attempts")


def _draw_out(env: KitchenEnv, lifted: HandTarget, out: HandTarget, narrow: bool) -> Iterator[Array]:
    """Move to where the way out ends; where the arm is held up by what is above it, a little lower."""
    if steep(lifted, out) and not narrow:
        yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03)
        return
    yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03, start=lifted.position)
    if pose_error(env.data, out).position > HELD_UP_M:
        lower = HandTarget(grip_position(env.data) - LOWER_M * UP, out.rotation)
        yield from move_hand(env.data, lower, CLOSED, speed=0.6, tolerance=0.01, max_steps=20)
        yield from move_hand(env.data, _shifted(out, -LOWER_M * UP), CLOSED, speed=0.8, tolerance=0.03)


def steep(one: HandTarget, other: HandTarget) -> bool:
    """Whether the way between two poses goes up or down rather than through a front."""
    away = other.position - one.position
    return abs(float(away @ UP)) > STEEP * float(np.linalg.norm(away))


def ahead_of(env: KitchenEnv) -> Array:
    """Unit vector (3,) along the base's heading."""
    _, yaw = base_pose(env.data)
    return np.array([np.cos(yaw), np.sin(yaw), 0.0])


def entry(env: KitchenEnv, name: str) -> Array:
    """Unit vector out of where something is: "up", "out" or "level" to the robot, or "across" between the two."""
    ahead = ahead_of(env)
    out = {"up": UP, "out": 0.1 * UP - ahead, "across": UP - ahead, "level": -ahead}[name]
    unit: Array = out / np.linalg.norm(out)
    return unit


def best_way(env: KitchenEnv, what: Thing, manner: Manner) -> Choice:
    """How a thing would be taken now; above a cost of about 2 it cannot be.

    Raises:
        SkillError: no pose of the gripper fits.
    """
    return _best(env, what, manner, [], [])


def _best(
    env: KitchenEnv, what: Thing, manner: Manner, tried: list[HandTarget], blocked: Sequence[RobotPose]
) -> Choice:
    """The first tilt's best way if that is good, else the best of all tilts.

    Raises:
        SkillError: no pose fits.
    """
    found: list[Choice] = []
    point = env.data.body(what.name).xpos.copy()
    for tilt, extra in manner.tilts:
        ways = _ways(env, what, manner, tried, tilt, extra)
        found += choose(env, ways, point, key=2, allowed=what.bodies, blocked=blocked)[:1]
        if found and found[-1].cost <= GOOD_ENOUGH + extra:
            break
    if not found:
        raise SkillError(f"{what.title}: no pose of the gripper fits as it lies")
    return min(found, key=lambda choice: choice.cost)


def _ways(
    env: KitchenEnv, what: Thing, manner: Manner, tried: list[HandTarget], tilt: float, extra: float
) -> list[Way]:
    body = env.data.body(what.name)
    found = []
    level = [rotation_about(UP, turn) @ ahead_of(env) for turn in (manner.turns if tilt > 0.0 else (0.0,))]
    poses = [pose for ahead in level for pose in manner.poses(env, what, np.cos(tilt) * -UP + np.sin(tilt) * ahead)]
    best = max((pose.score for pose in poses), default=0.0)
    for pose in poses:
        local = body.xmat.reshape(3, 3).T @ (pose.position - body.xpos)
        alike = sum(np.linalg.norm(local - other.position) < ALIKE_M for other in tried)
        cost = extra + WORSE_GRASP * (best - pose.score) + TRIED * float(alike)
        for turn in (pose.rotation, pose.rotation @ np.diag([-1.0, -1.0, 1.0])):
            takes = Held(what.name, turn.T @ (body.xpos - pose.position), turn.T @ body.xmat.reshape(3, 3))
            for name in manner.entries:
                for lift in {"up": (manner.lift_m,), "level": (LEVEL_LIFT_M,)}.get(name, manner.lifts):
                    out = -turn[:, 2] if name == "along" else entry(env, name)
                    poses_on_way = _way(pose.position, turn, out, name, manner, lift)
                    low = LEVEL_COST if name == "level" else LOW_COST if lift < LIFT_M else 0.0
                    found.append(Way(poses_on_way, cost + low, takes))
    return found


def _way(
    position: Array, rotation: Array, out: Array, name: str, manner: Manner, lift: float
) -> tuple[HandTarget, ...]:
    approach = rotation[:, 2]
    before = position - STANDOFF_M * approach
    if name == "up":
        far, lifted, last = position - manner.hover_m * approach, position + 0.05 * UP, position + lift * UP
    else:
        far, lifted = before + manner.out_m * out, position + lift * UP
        last = lifted + manner.out_m * out
    return tuple(HandTarget(p, rotation) for p in (far, before, position, lifted, last))


def _inside(env: KitchenEnv, what: Thing) -> Array:
    """Where a thing's origin is in the hand, metres."""
    inside: Array = hand_rotation(env.data).T @ (env.data.body(what.name).xpos - grip_position(env.data))
    return inside


def _shifted(target: HandTarget, move: Array) -> HandTarget:
    return HandTarget(target.position + move, target.rotation)
