"""Take hold of an object wherever it is, and keep it: on a counter, in a basin, on a shelf, in a microwave.

Of all grasp poses, approaches and entries that one is taken that the arm reaches best and that meets nothing, after a
drive where the arm falls short. A grasp that fails is followed by another one.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    HALF_TURN,
    OPEN,
    UP,
    Array,
    HandTarget,
    grip_position,
    hand_rotation,
    pose_error,
    rotation_about,
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.common import SkillError, close_fingers, draw_back, hold_hand, move_hand
from robocasa_lerobot.demos.skills.pick_place.carrying.finger_watch import (
    CREEP_M,
    LONG_CREEP_M,
    NEAR_CREEP_M,
    FingerWatch,
    finger_gap,
)
from robocasa_lerobot.demos.skills.pick_place.carrying.letting_go import caught, freed
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import hangs, require_off_floor
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import (
    LIFT_M,
    GraspStrategy,
    TriedGrasps,
    ahead_of,
    entry,
    in_object,
    steep,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, contents_of, graspable, holder_of
from robocasa_lerobot.demos.skills.reaching import (
    GOOD_ENOUGH,
    Held,
    MotionPlan,
    WaypointPath,
    approach,
    plan_reach,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.robot import Grasped
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

ATTEMPTS = 5
INTEGRAL_GAIN = 0.12
GRASP_STEPS, RELEASE_STEPS = 11, 8
STANDOFF_M = 0.06
CLOSE_FIT_M, PUSHED_M = 0.003, 0.004  # of the hand before it comes in round a close fit; by which that was pushed on
HOPELESS, POOR = 3.5, 1.5  # cost of a path from which on it is not tried, or not before one from another side
WORTH_M = 0.02  # by less than this, what is held is not put down nearer to the robot
BLOCKED_M, BACK_M = 0.05, 0.08  # a hand as far as this from where the grasp begins is blocked: another grasp is next
HELD_UP_M, LOWER_M = 0.08, 0.03
LEVEL_LIFT_M, LEVEL_COST, LOW_COST = 0.004, 0.1, 0.05  # before it is drawn out level, or nearly so
CROWDED, JOSTLE_COST, BESIDE_M = 1.5, 0.5, 0.12  # of a path that meets what lies beside; how far that is, at most
# An object that is held is nearer than this to where it was in the hand when that closed, and has risen by this share
# of the lift.
HELD_M, ROSE_SHARE = 0.05, 0.25
# Fingers that come closer together than what is between them is wide hold the edge of it, from which they slip off.
SHALLOW_M = 0.007
# What slides out of the fingers (`carrying/finger_watch.py`) would be lost on its way; at a vessel's wall, less far
# apart than this, they settle.
CREEP_ATTEMPTS, FAR_ATTEMPTS, WALL_M = 2, 3, 0.02
# What is not between the fingers, but hangs from one of them, is put back; a wall that slopes is held so, in the end.
HANG_ATTEMPTS = 2
# Fingers that close askew to the wall of a vessel with others in it turn it as much, or stay apart by as much more than
# what is between them: it would go on turning on its way.
ASKEW_RAD, ASKEW_M, ASKEW_ATTEMPTS = float(np.deg2rad(8.0)), 0.010, 2


def pick(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    elsewhere: Callable[[], bool] = lambda: False,
    *,
    firm: bool = False,
    long_way: bool = False,
) -> Iterator[Array]:
    """Grasp an object, and lift it or draw it out; the gripper stays closed.

    Args:
        env: the kitchen.
        obj: to be grasped.
        strategy: how.
        elsewhere: whether it could be reached for from another side: then poor grasps are not tried after a failure.
        firm: whether it must be between the fingers in the end: what only hangs from one is put back in any case.
        long_way: whether it goes far then, on which it has the time to slide out.

    Raises:
        SkillError: it is not in the gripper after all attempts.
        LostError: it fell to the floor.
    """
    data = env.data
    tried = TriedGrasps()
    creep_m = CREEP_M if firm or long_way else NEAR_CREEP_M
    for attempt in range(ATTEMPTS):
        require_off_floor(env, obj)
        if strategy.first is not None:
            yield from strategy.first(env)
        body = data.body(obj.name)
        start = body.xpos.copy()
        choice = yield from approach(env, lambda blocked: _best(env, obj, strategy, tried, blocked), OPEN)
        if choice.cost > HOPELESS or (attempt and choice.cost > POOR and elsewhere()):
            raise SkillError(f"{obj.title} is out of reach from here, or too near to other things")
        far, before, at, lifted, out = choice.path.targets
        nearer = strategy.nearer(env) * entry(env, "level") if strategy.nearer is not None else np.zeros(3)
        planned = in_object(env, obj, at)  # which grasp this was, wherever the hand gets to
        yield from follow_joint_path(env, choice.joints, OPEN)
        # All poses move with the object, should it have been touched meanwhile.
        moved = data.body(obj.name).xpos - start
        yield from move_hand(data, _shifted(far, moved), OPEN, tolerance=0.03)
        line = far.position + moved if strategy.narrow or not steep(far, before) else None
        there, near = _shifted(before, moved), CLOSE_FIT_M if strategy.close_fit else 0.008
        yield from move_hand(data, there, OPEN, tolerance=near, integral_gain=INTEGRAL_GAIN, start=line)
        moved = data.body(obj.name).xpos - start
        if pose_error(data, _shifted(before, moved)).position > BLOCKED_M:
            tried.note(planned)
            yield from _leave_as_it_came(env, far, before)
            continue
        at = _shifted(at, moved)
        integral_gain = 0.0 if strategy.narrow else INTEGRAL_GAIN
        yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.005, max_steps=45, integral_gain=integral_gain)
        more = (data.body(obj.name).xpos - start - moved) * [1.0, 1.0, 0.0]
        if strategy.close_fit and np.linalg.norm(more) > PUSHED_M:
            moved = moved + more
            at = _shifted(at, more)
            yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.004, max_steps=20, integral_gain=integral_gain)
        elif strategy.narrow:
            at = HandTarget(np.array([*(at.position + more)[:2], grip_position(data)[2]]), at.rotation)
            yield from move_hand(data, at, OPEN, speed=0.4, tolerance=0.004, max_steps=15)
        upright = _uprightness(env, obj)
        yield from close_fingers(data, at, GRASP_STEPS)
        turned, wide = abs(_uprightness(env, obj) - upright), finger_gap(env) - _width(choice)
        askew = bool(obj.contents) and (turned > ASKEW_RAD or wide > ASKEW_M)
        if attempt < ASKEW_ATTEMPTS and (askew or wide < -SHALLOW_M):
            tried.note(planned)
            if (yield from _let_go(env, obj)):
                return
            continue
        inside = _inside(env, obj)
        lift = float(lifted.position[2] - choice.path.targets[2].position[2])
        lifted, out = _shifted(lifted, moved), _shifted(out, moved)
        watch = FingerWatch(env)
        yield from watch.over(
            move_hand(data, lifted, CLOSED, speed=0.7, tolerance=0.4 * lift, max_steps=50, integral_gain=INTEGRAL_GAIN)
        )
        slippery = attempt < (FAR_ATTEMPTS if long_way else CREEP_ATTEMPTS) and not _settles(env, obj, long_way)
        if slippery and watch.creeps(creep_m) and _stays(env, obj, inside):
            tried.note(planned, slid=True)
            if np.linalg.norm(nearer) > WORTH_M:  # what is between the fingers comes along
                yield from _put_back(env, at, lifted, nearer)
            else:
                yield from move_hand(data, at, CLOSED, speed=0.7, tolerance=0.01, max_steps=30)
            if (yield from _let_go(env, obj)):
                return
            continue
        rise = data.body(obj.name).xpos[2] - start[2] - moved[2]
        if choice.cost > strategy.doubtful and np.linalg.norm(nearer) > WORTH_M:
            yield from _put_back(env, at, lifted, nearer)
        elif (rise > ROSE_SHARE * lift and _stays(env, obj, inside)) or is_held(env, obj.name):
            yield from watch.over(_draw_out(env, lifted, out, strategy.narrow))
            if long_way and slippery:
                yield from watch.go_on()
            slid = slippery and watch.creeps(LONG_CREEP_M if long_way else creep_m)
            stays, held = _stays(env, obj, inside), is_held(env, obj.name)
            loose = not held and (firm or attempt < HANG_ATTEMPTS)
            poor = stays and (loose or slid)
            if poor or (not (stays or held) and hangs(env, obj)):
                yield from _put_back(env, at, lifted, nearer)
            elif stays or held:
                return
            tried.note(planned, slid=slid)
        else:
            tried.note(planned)
        if (yield from _let_go(env, obj)):
            return
    raise SkillError(f"{obj.title} was not lifted in {ATTEMPTS} attempts")


def _settles(env: KitchenEnv, obj: Graspable, long_way: bool) -> bool:
    """Whether what creeps now comes to rest in the fingers: at the wall of a vessel; on a long way, at a thin one."""
    vessel = obj.item is not None and obj.item.interior is not None
    return vessel and (not long_way or finger_gap(env) < WALL_M)


def _put_back(env: KitchenEnv, at: HandTarget, lifted: HandTarget, nearer: Array) -> Iterator[Array]:
    """Bring an object that is held poorly back to where it lay, or `nearer`, metres, the way that it comes out."""
    start = grip_position(env.data)
    yield from move_hand(env.data, _shifted(lifted, nearer), CLOSED, speed=0.8, tolerance=0.01, start=start)
    yield from move_hand(env.data, _shifted(at, nearer), CLOSED, speed=0.7, tolerance=0.01, max_steps=30)


def is_held(env: KitchenEnv, name: str) -> bool:
    """Whether an object is between the fingers."""
    return Grasped(name).holds(env.scene, env.data)


def _stays(env: KitchenEnv, obj: Graspable, inside: Array) -> bool:
    """Whether an object is about where it was in the hand; one that hangs from a thin part of it swings farther."""
    return bool(np.linalg.norm(_inside(env, obj) - inside) < HELD_M)


def _leave_as_it_came(env: KitchenEnv, far: HandTarget, before: HandTarget) -> Iterator[Array]:
    """Out of where the hand is blocked, against the direction that it came along: it may be caught there."""
    at = HandTarget(grip_position(env.data) + far.position - before.position, hand_rotation(env.data))
    yield from move_hand(env.data, at, OPEN, tolerance=0.03, max_steps=40)


def _let_go(env: KitchenEnv, obj: Graspable) -> Generator[Array, None, bool]:
    """Open the fingers and draw back from a grasp that has failed; whether it cannot be got rid of, and is kept."""
    data = env.data
    at = HandTarget(grip_position(data), hand_rotation(data))
    yield from hold_hand(data, at, OPEN, RELEASE_STEPS)
    yield from draw_back(data, OPEN, BACK_M)
    clear = HandTarget(grip_position(data), hand_rotation(data))
    yield from freed(env, obj, at, clear)
    return (yield from caught(env, obj, at, clear))


def _uprightness(env: KitchenEnv, obj: Graspable) -> float:
    """How far an object's z axis is from the vertical, radians."""
    return float(np.arccos(np.clip(env.data.body(obj.name).xmat[8], -1.0, 1.0)))


def _draw_out(env: KitchenEnv, lifted: HandTarget, out: HandTarget, narrow: bool) -> Iterator[Array]:
    """Move to where the path out ends; where the arm is held up by an obstacle above it, a little lower."""
    if steep(lifted, out) and not narrow:
        yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03)
        return
    yield from move_hand(env.data, out, CLOSED, speed=0.8, tolerance=0.03, start=lifted.position)
    if pose_error(env.data, out).position > HELD_UP_M:
        lower = HandTarget(grip_position(env.data) - LOWER_M * UP, out.rotation)
        yield from move_hand(env.data, lower, CLOSED, speed=0.6, tolerance=0.01, max_steps=20)
        yield from move_hand(env.data, _shifted(out, -LOWER_M * UP), CLOSED, speed=0.8, tolerance=0.03)


@dataclass(frozen=True)
class _GraspPath(WaypointPath):
    """The poses of a grasp, and how wide the object is between the fingers, metres."""

    width: float = 0.0


def _width(choice: MotionPlan) -> float:
    return choice.path.width if isinstance(choice.path, _GraspPath) else 0.0


def best_grasp(env: KitchenEnv, obj: Graspable, strategy: GraspStrategy) -> MotionPlan:
    """How an object would be grasped now; above a cost of about 2 it cannot be.

    Raises:
        SkillError: no pose of the gripper fits.
    """
    return _best(env, obj, strategy, TriedGrasps(), [])


def _best(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    tried: TriedGrasps,
    blocked: Sequence[RobotPose],
) -> MotionPlan:
    """The best path that meets nothing; where there is none, one that may jostle what lies in the same vessel.

    Raises:
        SkillError: no pose fits.
    """
    best = _best_of_tilts(env, obj, strategy, tried, blocked)
    beside = _beside(env, obj) if best.cost > CROWDED else frozenset()
    if not beside:
        return best
    jostling = _best_of_tilts(env, obj, strategy, tried, blocked, beside)
    jostling = replace(jostling, cost=jostling.cost + JOSTLE_COST)
    return min(best, jostling, key=lambda choice: choice.cost)


def _beside(env: KitchenEnv, obj: Graspable) -> frozenset[int]:
    """Bodies of the other objects close by in or on what an object lies in or on, but for that itself."""
    holder = holder_of(env, obj.name)
    if not holder:
        return frozenset()
    point, inside = env.data.body(obj.name).xpos, contents_of(env, holder)
    near = [
        name
        for name in env.scene.objects
        if name not in (obj.name, holder)
        and env.scene.objects[name].item.interior is None
        and (name in inside or np.linalg.norm(env.data.body(name).xpos - point) < BESIDE_M)
    ]
    return frozenset(body for name in near for body in graspable(env, name).bodies)


def _best_of_tilts(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    tried: TriedGrasps,
    blocked: Sequence[RobotPose],
    yielding: frozenset[int] = frozenset(),
) -> MotionPlan:
    """The first tilt's best path if that is good, else the best of all tilts; bodies that are `yielding` may be met.

    Raises:
        SkillError: no pose fits.
    """
    found: list[MotionPlan] = []
    point = env.data.body(obj.name).xpos.copy()
    grasps = cache(partial(_grasps, env, obj, strategy))
    compared = [pose.score for tilt, _ in strategy.tilts for pose in grasps(tilt)] if strategy.among_tilts else []
    for tilt, extra in strategy.tilts:
        best = max([*compared, *(pose.score for pose in grasps(tilt))], default=0.0)
        paths = _paths(env, obj, strategy, tried, grasps(tilt), extra, best)
        found += plan_reach(env, paths, point, key=2, allowed=obj.bodies | yielding, blocked=blocked)[:1]
        if found and found[-1].cost <= GOOD_ENOUGH + extra:
            break
    if not found:
        raise SkillError(f"{obj.title}: no pose of the gripper fits as it lies")
    return min(found, key=lambda choice: choice.cost)


def _paths(
    env: KitchenEnv,
    obj: Graspable,
    strategy: GraspStrategy,
    tried: TriedGrasps,
    poses: list[GraspPose],
    extra: float,
    best: float,
) -> list[WaypointPath]:
    """Paths to grasps and away; what a grasp's score is below the best one's costs."""
    found: list[WaypointPath] = []
    for pose in poses:
        again = tried.cost(env, obj, HandTarget(pose.position, pose.rotation))
        cost = extra + strategy.worse_grasp * (best - pose.score) + again
        for turn in (pose.rotation, pose.rotation @ HALF_TURN):
            takes = _taken(env, obj, HandTarget(pose.position, turn))
            for name in strategy.entries:
                for lift in {"up": (strategy.lift_m,), "level": (LEVEL_LIFT_M,)}.get(name, strategy.lifts):
                    out = -turn[:, 2] if name == "along" else entry(env, name)
                    low = LEVEL_COST if name == "level" else LOW_COST if lift < LIFT_M else 0.0
                    poses_on_it = _poses(pose.position, turn, out, name, strategy, lift)
                    found.append(_GraspPath(poses_on_it, cost + low, takes, width=pose.width))
    return found


def _grasps(env: KitchenEnv, obj: Graspable, strategy: GraspStrategy, tilt: float) -> list[GraspPose]:
    """Grasps by a hand that is tilted so, in all its turns."""
    level = [rotation_about(UP, turn) @ ahead_of(env) for turn in (strategy.turns if tilt > 0.0 else (0.0,))]
    return [pose for ahead in level for pose in strategy.poses(env, obj, np.cos(tilt) * -UP + np.sin(tilt) * ahead)]


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


def _inside(env: KitchenEnv, obj: Graspable) -> Array:
    """Where an object's origin is in the hand, metres."""
    inside: Array = hand_rotation(env.data).T @ (env.data.body(obj.name).xpos - grip_position(env.data))
    return inside


def _shifted(target: HandTarget, move: Array) -> HandTarget:
    return HandTarget(target.position + move, target.rotation)
