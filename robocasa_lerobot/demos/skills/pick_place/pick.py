"""Take hold of an object wherever it is, and keep it: on a counter, in a basin, on a shelf, in a microwave.

Of all grasp poses, approaches and entries that one is taken that the arm reaches best and that meets nothing, after a
drive where the arm falls short. A grasp that fails is followed by another one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    grip_position,
    hand_rotation,
    pose_error,
    rotation_about,
)
from robocasa_lerobot.demos.skills.common import SkillError, close_fingers, draw_back, hold_hand, move_hand
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import LIFT_M, GraspStrategy, ahead_of, entry, steep
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.reaching import (
    GOOD_ENOUGH,
    Held,
    ReachPlan,
    WaypointPath,
    approach,
    lead,
    plan_reach,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

ATTEMPTS = 5
INTEGRAL_GAIN = 0.12
GRASP_STEPS, RELEASE_STEPS = 11, 8
STANDOFF_M = 0.06
HOPELESS = 3.5  # cost of a path from which on it is not tried
LOW_COST = 0.05
BLOCKED_M, BACK_M = 0.05, 0.08  # a hand as far as this from where the grasp begins is blocked: another grasp is next
HELD_UP_M, LOWER_M = 0.08, 0.03
LEVEL_LIFT_M, LEVEL_COST = 0.004, 0.1  # before it is drawn out level
WORSE_GRASP = 0.45  # cost of a grasp's score below the best one's
TRIED, ALIKE_M = 1.2, 0.015  # cost of a grasp like one that has failed: its place in the object is as near as this
# An object that is held is nearer than this to where it was in the hand when that closed, and has risen by this share
# of the lift.
HELD_M, ROSE_SHARE = 0.05, 0.25


def pick(env: KitchenEnv, obj: Graspable, strategy: GraspStrategy) -> Iterator[Array]:
    """Grasp an object, and lift it or draw it out; the gripper stays closed.

    Raises:
        SkillError: it is not in the gripper after all attempts.
    """
    data = env.data
    tried: list[HandTarget] = []
    for _ in range(ATTEMPTS):
        if strategy.first is not None:
            yield from strategy.first(env)
        body = data.body(obj.name)
        start = body.xpos.copy()
        choice = yield from approach(env, lambda blocked: _best(env, obj, strategy, tried, blocked), OPEN)
        if choice.cost > HOPELESS:
            raise SkillError(f"{obj.title} is out of reach from here, or too near to other things")
        yield from lead(env, choice.joints, OPEN)
        far, before, at, lifted, out = choice.path.targets
        # All poses move with the object, should it have been touched meanwhile.
        moved = data.body(obj.name).xpos - start
        yield from move_hand(data, _shifted(far, moved), OPEN, tolerance=0.03)
        line = far.position + moved if strategy.narrow or not steep(far, before) else None
        yield from move_hand(
            data, _shifted(before, moved), OPEN, tolerance=0.008, integral_gain=INTEGRAL_GAIN, start=line
        )
        moved = data.body(obj.name).xpos - start
        if pose_error(data, _shifted(before, moved)).position > BLOCKED_M:
            tried.append(_in_object(env, obj, HandTarget(at.position + moved, at.rotation)))
            yield from draw_back(data, OPEN, BACK_M)
            continue
        at = _shifted(at, moved)
        integral_gain = 0.0 if strategy.narrow else INTEGRAL_GAIN
        yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.005, max_steps=45, integral_gain=integral_gain)
        if strategy.narrow:
            more = (data.body(obj.name).xpos - start - moved) * [1.0, 1.0, 0.0]
            at = HandTarget(np.array([*(at.position + more)[:2], grip_position(data)[2]]), at.rotation)
            yield from move_hand(data, at, OPEN, speed=0.4, tolerance=0.004, max_steps=15)
        yield from close_fingers(data, at, GRASP_STEPS)
        inside = _inside(env, obj)
        lift = float(lifted.position[2] - choice.path.targets[2].position[2])
        yield from move_hand(
            data,
            _shifted(lifted, moved),
            CLOSED,
            speed=0.7,
            tolerance=0.4 * lift,
            max_steps=50,
            integral_gain=INTEGRAL_GAIN,
        )
        rise = data.body(obj.name).xpos[2] - start[2] - moved[2]
        if rise > ROSE_SHARE * lift and np.linalg.norm(_inside(env, obj) - inside) < HELD_M:
            yield from _draw_out(env, _shifted(lifted, moved), _shifted(out, moved), strategy.narrow)
            if np.linalg.norm(_inside(env, obj) - inside) < HELD_M:
                return
        tried.append(HandTarget(data.body(obj.name).xmat.reshape(3, 3).T @ (at.position - start), at.rotation))
        yield from hold_hand(data, HandTarget(grip_position(data), hand_rotation(data)), OPEN, RELEASE_STEPS)
        yield from draw_back(data, OPEN, BACK_M)
    raise SkillError(f"{obj.title} was not lifted in {ATTEMPTS} attempts")


def _draw_out(env: KitchenEnv, lifted: HandTarget, out: HandTarget, narrow: bool) -> Iterator[Array]:
    """Move to where the path out ends; where the arm is held up by what is above it, a little lower."""
    if steep(lifted, out) and not narrow:
        yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03)
        return
    yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03, start=lifted.position)
    if pose_error(env.data, out).position > HELD_UP_M:
        lower = HandTarget(grip_position(env.data) - LOWER_M * UP, out.rotation)
        yield from move_hand(env.data, lower, CLOSED, speed=0.6, tolerance=0.01, max_steps=20)
        yield from move_hand(env.data, _shifted(out, -LOWER_M * UP), CLOSED, speed=0.8, tolerance=0.03)


def best_grasp(env: KitchenEnv, obj: Graspable, strategy: GraspStrategy) -> ReachPlan:
    """How an object would be grasped now; above a cost of about 2 it cannot be.

    Raises:
        SkillError: no pose of the gripper fits.
    """
    return _best(env, obj, strategy, [], [])


def _best(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    tried: list[HandTarget],
    blocked: Sequence[RobotPose],
) -> ReachPlan:
    """The first tilt's best path if that is good, else the best of all tilts.

    Raises:
        SkillError: no pose fits.
    """
    found: list[ReachPlan] = []
    point = env.data.body(obj.name).xpos.copy()
    for tilt, extra in strategy.tilts:
        paths = _paths(env, obj, strategy, tried, tilt, extra)
        found += plan_reach(env, paths, point, key=2, allowed=obj.bodies, blocked=blocked)[:1]
        if found and found[-1].cost <= GOOD_ENOUGH + extra:
            break
    if not found:
        raise SkillError(f"{obj.title}: no pose of the gripper fits as it lies")
    return min(found, key=lambda choice: choice.cost)


def _paths(
    env: KitchenEnv, obj: Graspable, strategy: GraspStrategy, tried: list[HandTarget], tilt: float, extra: float
) -> list[WaypointPath]:
    body = env.data.body(obj.name)
    found = []
    level = [rotation_about(UP, turn) @ ahead_of(env) for turn in (strategy.turns if tilt > 0.0 else (0.0,))]
    poses = [pose for ahead in level for pose in strategy.poses(env, obj, np.cos(tilt) * -UP + np.sin(tilt) * ahead)]
    best = max((pose.score for pose in poses), default=0.0)
    for pose in poses:
        local = body.xmat.reshape(3, 3).T @ (pose.position - body.xpos)
        alike = sum(np.linalg.norm(local - other.position) < ALIKE_M for other in tried)
        cost = extra + WORSE_GRASP * (best - pose.score) + TRIED * float(alike)
        for turn in (pose.rotation, pose.rotation @ np.diag([-1.0, -1.0, 1.0])):
            takes = _taken(env, obj, HandTarget(pose.position, turn))
            for name in strategy.entries:
                for lift in {"up": (strategy.lift_m,), "level": (LEVEL_LIFT_M,)}.get(name, strategy.lifts):
                    out = -turn[:, 2] if name == "along" else entry(env, name)
                    low = LEVEL_COST if name == "level" else LOW_COST if lift < LIFT_M else 0.0
                    found.append(
                        WaypointPath(_poses(pose.position, turn, out, name, strategy, lift), cost + low, takes)
                    )
    return found


def _taken(env: KitchenEnv, obj: Graspable, hand: HandTarget) -> Held:
    """The object, and what lies in it, in a hand that closes at a pose."""
    one, *contents = (
        Held(name, hand.rotation.T @ (body.xpos - hand.position), hand.rotation.T @ body.xmat.reshape(3, 3))
        for name, body in ((name, env.data.body(name)) for name in (obj.name, *obj.contents))
    )
    return replace(one, contents=tuple(contents))


def _poses(
    position: Array, rotation: Array, out: Array, name: str, strategy: GraspStrategy, lift: float
) -> tuple[HandTarget, ...]:
    approach = rotation[:, 2]
    before = position - STANDOFF_M * approach
    if name == "up":
        far, lifted, last = position - strategy.hover_m * approach, position + 0.05 * UP, position + lift * UP
    else:
        far, lifted = before + strategy.out_m * out, position + lift * UP
        last = lifted + strategy.out_m * out
    return tuple(HandTarget(p, rotation) for p in (far, before, position, lifted, last))


def _in_object(env: KitchenEnv, obj: Graspable, hand: HandTarget) -> HandTarget:
    """Where a hand is in an object's axes, metres; the rotation stays the room's."""
    body = env.data.body(obj.name)
    return HandTarget(body.xmat.reshape(3, 3).T @ (hand.position - body.xpos), hand.rotation)


def _inside(env: KitchenEnv, obj: Graspable) -> Array:
    """Where an object's origin is in the hand, metres."""
    inside: Array = hand_rotation(env.data).T @ (env.data.body(obj.name).xpos - grip_position(env.data))
    return inside


def _shifted(target: HandTarget, move: Array) -> HandTarget:
    return HandTarget(target.position + move, target.rotation)
