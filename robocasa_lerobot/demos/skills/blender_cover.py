"""The lid of a blender put on its jug: taken by its knob, brought level over the rim, and let down.

The jug stands below a wall cabinet, so the path there is planned anew with the lid in the hand, from where the robot
stands or from a better place. The lid has its place, not the hand: how it lies in the hand is looked at before each
move, and it is let go only over the jug.

What fails: low wall cabinets that the forearm leans on, and lids that are knocked over before they are held.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.base_path import base_now
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.blender_lid import (
    ATTEMPTS,
    AWAY_M,
    GRASP_STEPS,
    HOLD_M,
    HOVER_M,
    LOST_M,
    RELEASE_STEPS,
    ROSE_M,
    grasps,
    the_blender,
)
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import entry
from robocasa_lerobot.demos.skills.pick_place.pick import INTEGRAL_GAIN
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, approach, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.task import Stage

LAYS = 2  # tries to bring a lid that is in the hand to the jug
TAKEN_M = 0.08  # that it is lifted at once
# Of the lid above its place: while it is carried, over the rim, when it is let go.
OVER_M, LOW_M, DROP_M = (0.045, 0.028), 0.020, 0.002
ABOVE_M = 0.10  # over a lid on the counter, where the hand comes from
IN_M = 0.15  # length of the path in
SINKS, SINK = 3, ((0.010, 0.3, 0.003), (DROP_M, 0.3, 0.003))  # heights, speeds and tolerances of the path down
NOT_OVER_M = 0.03  # of a lid that is aside of its place
# Places to stand from where the arm got stuck that are kept off, and how far.
MOST_STUCK, ELSEWHERE_M = 2, 0.10
SEATED_M, LEVEL_COS = 0.007, float(np.cos(np.deg2rad(4.0)))  # of a lid that is let go at once
TOGETHER = 1.0  # cost up to which the lid is taken from where it can be brought to the jug, too
ROUND_TURNS = tuple(float(turn) for turn in np.deg2rad((0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0)))
TURN_COST = 0.05  # for each radian
TRIED, ALIKE = 0.8, 2.5  # cost of a hand that is held as one that has failed: trace of the turn between the two


def cover(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the lid on the jug.

    Raises:
        SkillError: it is not on after four attempts.
    """
    blender = the_blender(env, stage)
    tried: list[Array] = []
    stuck: list[RobotPose] = []
    for _ in range(ATTEMPTS):
        place = env.data.body(blender.lid).xpos.copy()
        yield from _take(env, blender, tried)
        if _holds(env, blender):
            yield from _lay(env, blender, blender.lid_pose[0], LAYS, stuck)
            if _holds(env, blender) and _aside(env, blender, blender.lid_pose[0]) > NOT_OVER_M:
                yield from _lay(env, blender, place, 1, [])  # rather than let it fall
        at = HandTarget(grip_position(env.data), hand_rotation(env.data))
        yield from hold_hand(env.data, at, OPEN, RELEASE_STEPS)
        away = HandTarget(at.position - AWAY_M * at.rotation[:, 2], at.rotation)
        yield from move_hand(env.data, away, OPEN, tolerance=0.02, max_steps=50)
        if stage_done(env, stage):
            return
    raise SkillError(f"the lid of {blender.name} is not on its jug after {ATTEMPTS} attempts")


def _take(env: KitchenEnv, blender: Blender, tried: list[Array]) -> Iterator[Array]:
    """Grasp the knob and lift the lid."""
    data = env.data
    body = data.body(blender.lid)
    choice = yield from approach(env, lambda blocked: _best_take(env, blender, tried, blocked), OPEN)
    yield from follow_joint_path(env, choice.joints, OPEN)
    above, before, at, lifted = choice.path.targets[:4]
    tried.append(at.rotation)
    yield from move_hand(data, above, OPEN, tolerance=0.04)
    yield from move_hand(data, before, OPEN, tolerance=0.01, integral_gain=INTEGRAL_GAIN)
    yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.006, max_steps=50)
    start = float(body.xpos[2])
    yield from hold_hand(data, at, CLOSED, GRASP_STEPS)
    yield from move_hand(data, lifted, CLOSED, speed=0.8, tolerance=0.02, until=lambda: not _holds(env, blender))
    if body.xpos[2] < start + ROSE_M:
        yield from hold_hand(data, HandTarget(grip_position(data), hand_rotation(data)), OPEN, RELEASE_STEPS)


def _lay(env: KitchenEnv, blender: Blender, place: Array, tries: int, stuck: list[RobotPose]) -> Iterator[Array]:
    """Bring the lid over a place of its origin and down; it is still in the hand afterwards.

    Where the arm did not get over the place from is noted in `stuck`: it leans on a wall cabinet there.
    """
    data = env.data
    failed: list[Array] = []
    for _ in range(tries):

        def plan(blocked: Sequence[RobotPose]) -> MotionPlan:
            held, lid = Held.now(data, blender.lid), _lid(env, blender)
            paths = _lays(env, blender, held, hand_rotation(data) @ held.rotation, place, failed)
            off, here = stuck[-MOST_STUCK:], base_now(data)
            stays = all(np.hypot(each.x - here.x, each.y - here.y) > ELSEWHERE_M for each in off)
            return plan_reach(
                env, paths, place, key=2, held=held, loaded=3, allowed=lid, blocked=[*off, *blocked], may_stay=stays
            )[0]

        choice = yield from approach(env, plan, CLOSED)
        if not _holds(env, blender):
            return
        far, over, low, _ = choice.path.targets
        failed.append(low.rotation)
        turn = low.rotation @ Held.now(data, blender.lid).rotation  # of the lid
        yield from follow_joint_path(env, choice.joints, CLOSED)
        yield from move_hand(data, far, CLOSED, tolerance=0.02, integral_gain=INTEGRAL_GAIN)
        height = float(over.position[2] - low.position[2]) + LOW_M
        line: Array | None = far.position
        for _ in range(SINKS):
            for above, speed, tolerance in ((height, 0.8, 0.01), (LOW_M, 0.6, 0.003), *SINK):
                if not _holds(env, blender):
                    return
                goal = _hand_for(Held.now(data, blender.lid), place, turn, above)
                yield from move_hand(
                    data,
                    goal,
                    CLOSED,
                    speed=speed,
                    tolerance=tolerance,
                    max_steps=60,
                    integral_gain=INTEGRAL_GAIN,
                    start=line,
                )
                line = None
                if above == LOW_M and _aside(env, blender, place) > NOT_OVER_M:
                    break
            if _away(env, blender, place) < SEATED_M and _level(env, blender):
                return
            if _aside(env, blender, place) > NOT_OVER_M:
                stuck.append(base_now(data))
                yield from move_hand(data, far, CLOSED, speed=0.7, tolerance=0.03, max_steps=40)
                break


def _best_take(env: KitchenEnv, blender: Blender, tried: list[Array], blocked: Sequence[RobotPose]) -> MotionPlan:
    """A grasp with which the lid gets to the jug from the same place, else after a drive."""
    body, lid, place = env.data.body(blender.lid), _lid(env, blender), blender.lid_pose[0]
    at, turn = body.xpos + UP * HOLD_M, body.xmat.reshape(3, 3).copy()
    together, taking, laying = [], [], []
    for rotation in grasps(env):
        held = Held(blender.lid, rotation.T @ (body.xpos - at), rotation.T @ turn)
        cost = TRIED * sum(float(np.trace(rotation.T @ other)) > ALIKE for other in tried)
        before = at - HOVER_M * rotation[:, 2]
        poses = (before + ABOVE_M * UP, before, at, at + TAKEN_M * UP)
        take = WaypointPath(tuple(HandTarget(point, rotation) for point in poses), cost, held)
        taking.append(take)
        for path in _lays(env, blender, held, turn, place, []):
            laying.append(dataclasses.replace(path, takes=held))
            together.append(WaypointPath(take.targets + path.targets[:3], cost + path.extra, held))
    found = plan_reach(env, together, at, key=2, allowed=lid, blocked=blocked)[0]
    if found.cost < TOGETHER:
        return found
    later: dict[tuple[float, ...], float] = {}
    for choice in plan_reach(env, laying, place, key=0, allowed=lid):
        grasp = _grasp(choice.path.takes)
        later[grasp] = min(choice.cost, later.get(grasp, np.inf))
    able = [
        dataclasses.replace(path, extra=path.extra + later[grasp])
        for path in taking
        if (grasp := _grasp(path.takes)) in later
    ]
    apart = plan_reach(env, able, at, key=2, allowed=lid, blocked=blocked)[0]
    return min((found, apart), key=lambda choice: choice.cost)


def _grasp(held: Held | None) -> tuple[float, ...]:
    """A key of a grasp that does not depend on where the hand is."""
    assert held is not None
    return tuple(held.rotation.ravel().round(4).tolist())


def _lays(
    env: KitchenEnv, blender: Blender, held: Held, turn: Array, place: Array, failed: list[Array]
) -> list[WaypointPath]:
    """Before a place of the lid, over it, just above it, and away from it; `turn` is the lid's now."""
    found = []
    for lid_turn, extra in _lid_turns(env, blender, turn):
        low = _hand_for(held, place, lid_turn, LOW_M)
        cost = extra + TRIED * sum(float(np.trace(low.rotation.T @ other)) > ALIKE for other in failed)
        for name in ("out", "across", "up"):
            for height in OVER_M:
                over = low.position + (height - LOW_M) * UP
                far = over + IN_M * entry(env, name)
                away = low.position - AWAY_M * low.rotation[:, 2]
                poses = (far, over, low.position, away)
                found.append(WaypointPath(tuple(HandTarget(point, low.rotation) for point in poses), cost))
    return found


def _lid_turns(env: KitchenEnv, blender: Blender, turn: Array) -> list[tuple[Array, float]]:
    """Rotations of a level lid that fit on the jug, with their costs: four of a square one."""
    yaw = float(np.arctan2(turn[1, 0], turn[0, 0]))
    if blender.record["jug"] == "round":
        return [(rotation_about(UP, yaw + more), TURN_COST * abs(more)) for more in ROUND_TURNS]
    found = []
    for quarter in range(4):
        goal = blender.yaw + quarter * np.pi / 2
        more = abs(wrap(goal - yaw))
        found.append((rotation_about(UP, goal), TURN_COST * more))
    return found


def _hand_for(held: Held, place: Array, turn: Array, height: float) -> HandTarget:
    """The hand with the lid turned so, metres over a place of its origin."""
    rotation = turn @ held.rotation.T
    return HandTarget(place + height * UP - rotation @ held.position, rotation)


def _away(env: KitchenEnv, blender: Blender, place: Array) -> float:
    return float(np.linalg.norm(env.data.body(blender.lid).xpos - place))


def _aside(env: KitchenEnv, blender: Blender, place: Array) -> float:
    return float(np.linalg.norm((env.data.body(blender.lid).xpos - place)[:2]))


def _level(env: KitchenEnv, blender: Blender) -> bool:
    return bool(env.data.body(blender.lid).xmat[8] > LEVEL_COS)


def _lid(env: KitchenEnv, blender: Blender) -> frozenset[int]:
    return frozenset({int(env.model.body(blender.lid).id)})


def _holds(env: KitchenEnv, blender: Blender) -> bool:
    """Whether the knob is between the fingers."""
    body = env.data.body(blender.lid)
    knob = body.xpos + body.xmat.reshape(3, 3)[:, 2] * HOLD_M
    return bool(np.linalg.norm(knob - grip_position(env.data)) < LOST_M)
