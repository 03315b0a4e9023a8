"""Levers: pushed with the closed finger tips, or grasped and led along the arc of their hinge.

The finger tips end short of the case behind a lever.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from functools import partial

import mujoco
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
    rotation_about,
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import MotionPlan, plan_near
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
GRASP_STEPS = 10
STANDOFF_M = 0.08
# From the side the grip site ends short of the middle of the pushed part, so that the tips end just beyond it.
SHORT_M = 0.008
# Where the palm, which is wide, would meet the case that a lever stands out from (a plan of more than this cost), the
# lever is pushed just within its outer edge, by a hand rolled about its approach: the palm then stands along the case.
IN_THE_WAY, EDGE_M = 0.7, 0.003
ROLLS_RAD = tuple(np.deg2rad((0.0, 45.0, -45.0, 90.0)).tolist())
PUSH_SPEED = 0.45
# How far from its middle towards the tip a faucet's lever is grasped, as a share of its length; angles in radians.
WATER_ON_RAD, WATER_OFF_RAD = 0.70, 0.0
SPOUT_RAD = 0.80
LONG_TURN_RAD, MOST_AHEAD_RAD = 1.0, 0.18
SWEEP_RAD = 0.66  # of the spout from the middle, to either side: beyond what counts as a side
HOT_SHARE, COLD_SHARE = 0.80, 0.20
DONE_RAD = 0.12
# A lever this far down, as a share of its travel, is waited for while an appliance may hold it (a toaster for 25 s).
HELD_DOWN, MOST_WAIT_STEPS, COMING_UP_STEPS = 0.9, 700, 10
SHIFTS = (
    (0.0, 0.0),
    (-0.15, 0.0),
    (-0.1, -0.2),
    (-0.1, 0.2),
    (0.05, 0.0),
    (-0.3, 0.0),
    (-0.3, -0.3),
    (-0.3, 0.3),
    (-0.45, 0.0),
)


def press_lever(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push a sliding lever to the end of its travel.

    Raises:
        SkillError: it is not there after four attempts.
    """
    data, fixture = env.data, env.scene.fixture(stage.target, Appliance)
    part = env.scene.fill(stage.part)
    body = data.body(f"{fixture.name}_{part}")
    allowed = frozenset({int(body.id)})
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        direction = data.joint(fixture.joint(part)).xaxis.copy()
        travel = float(env.model.joint(fixture.joint(part)).range[1])
        left_over = travel - fixture.position(data, part)
        middle, edge = _upper_face(env, int(body.id), direction, data.body(fixture.name).xpos)
        rotations = level_and_down(env)
        rows = [push_row(env.robot.gripper, middle, direction, rotation, left_over) for rotation in rotations]
        plan = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
        if plan.cost > IN_THE_WAY:
            rolled = [rotation_about(turn[:, 2], roll) @ turn for roll in ROLLS_RAD for turn in rotations]
            rows = [push_row(env.robot.gripper, edge, direction, rotation, left_over) for rotation in rolled]
            beside = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
            plan = min(plan, beside, key=lambda one: one.cost)
        tried.append(plan.targets[-1].rotation)
        yield from shift_base(env, plan.shift, CLOSED)
        yield from follow_joint_path(env, plan.joints, CLOSED)
        over, before, touch, end = plan.targets
        rotation = before.rotation
        yield from move_hand(data, over, CLOSED, tolerance=0.03)
        yield from move_hand(data, before, CLOSED, tolerance=0.012)
        yield from move_hand(data, touch, CLOSED, speed=0.6, tolerance=0.006, max_steps=40)
        beyond = HandTarget(end.position + direction * 0.02, rotation)
        yield from move_hand(
            data, beyond, CLOSED, speed=PUSH_SPEED, max_steps=70, until=lambda: fixture.share(data, part) >= 0.985
        )
        yield from hold_hand(data, HandTarget(grip_position(data) + direction * 0.01, rotation), CLOSED, 4)
        back = HandTarget(before.position + (UP * 0.05) - rotation[:, 2] * 0.06, rotation)
        yield from move_hand(data, back, CLOSED, tolerance=0.03, max_steps=40)
        yield from wait_while_down(env, stage, back)
        if stage_done(env, stage):
            return
    raise SkillError(f"{part} of {fixture.name} is at {fixture.share(data, part):.0%} after {ATTEMPTS} attempts")


def wait_while_down(env: KitchenEnv, stage: Stage, away: HandTarget) -> Iterator[Array]:
    """Keep the hand away while a lever that was pressed is held down, where the stage is done when it has come up."""
    fixture, part = env.scene.fixture(stage.target, Appliance), env.scene.fill(stage.part)
    for _ in range(MOST_WAIT_STEPS):
        if stage_done(env, stage) or fixture.share(env.data, part) < HELD_DOWN:
            break
        yield from hold_hand(env.data, away, CLOSED, 1)
    for _ in range(COMING_UP_STEPS):
        if stage_done(env, stage):
            return
        yield from hold_hand(env.data, away, CLOSED, 1)


def turn_on_water(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Grasp the faucet's lever and lift it."""
    sink = env.scene.fixture(stage.target, Sink)
    yield from _lead(env, stage, "handle", lambda: WATER_ON_RAD - sink.position(env.data, "handle"))


def turn_off_water(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Grasp the faucet's lever and lower it."""
    sink = env.scene.fixture(stage.target, Sink)
    yield from _lead(env, stage, "handle", lambda: WATER_OFF_RAD - sink.position(env.data, "handle"))


def turn_sideways(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Grasp the spout, or the lever that sets the temperature, and lead it to the side that is asked for."""
    sink, part = env.scene.fixture(stage.target, Sink), stage.part
    if part == "spout":
        goal = SPOUT_RAD if env.scene.fill(stage.to) == "right" else -SPOUT_RAD
    else:
        low, high = (float(v) for v in env.model.joint(sink.joint(part)).range)
        goal = low + (HOT_SHARE if env.scene.fill(stage.to) == "other than cold" else COLD_SHARE) * (high - low)
    runs = sink.water_on(env.data)
    yield from _lead(env, stage, part, lambda: goal - sink.position(env.data, part))
    if runs and not sink.water_on(env.data):  # the hand has leaned on the lever
        yield from turn_on_water(env, stage)


def sweep_sideways(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Grasp the spout and lead it to one side and to the other without letting go, the water running all the while.

    Raises:
        SkillError: the stage is not done after that, in four rounds.
    """
    data, sink = env.data, env.scene.fixture(stage.target, Sink)
    allowed = frozenset(int(i) for i in np.flatnonzero(env.scene.subtree(f"{sink.name}_spout")))
    tried: list[Array] = []
    for attempt in range(ATTEMPTS):
        if not sink.water_on(data):  # the hand has leaned on the lever
            yield from turn_on_water(env, stage)
        joint = data.joint(sink.joint("spout"))
        anchor, axis, present = joint.xanchor.copy(), joint.xaxis.copy(), sink.position(data, "spout")
        grip, along = _hold_of(env, sink.name, "spout")
        first = SWEEP_RAD if (present > 0.0) != (attempt % 2 == 1) else -SWEEP_RAD
        rows = []
        for rotation in _grasps(env, along, np.cross(axis, grip - anchor)):
            at = HandTarget(grip, rotation)
            ends = (_turned(at, anchor, axis, goal - present, turns_hand=True) for goal in (first, -first))
            rows.append((HandTarget(grip - rotation[:, 2] * STANDOFF_M, rotation), at, *ends))
        plan = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
        tried.append(plan.targets[1].rotation)
        at = yield from _take_hold(env, plan)
        held = HandTarget(grip_position(data), at.rotation)
        for goal in (first, -first):
            turn = goal - present
            yield from _lead_to(env, held, anchor, axis, turn, partial(_left_to, env, sink, goal))
            held, present = HandTarget(grip_position(data), hand_rotation(data)), sink.position(data, "spout")
        yield from _let_go(env)
        if stage_done(env, stage):
            return
    raise SkillError(f"the spout of {sink.name} has not rinsed all sides in {ATTEMPTS} rounds")


def _left_to(env: KitchenEnv, sink: Sink, goal: float) -> float:
    return goal - sink.position(env.data, "spout")


def _lead(env: KitchenEnv, stage: Stage, part: str, left_over: Callable[[], float]) -> Iterator[Array]:
    """Grasp a part on a hinge and lead it until nothing is left over of its turn, radians.

    Raises:
        SkillError: neither is it there after four attempts, nor does the task's goal hold.
    """
    data, sink = env.data, env.scene.fixture(stage.target, Sink)
    tree = env.scene.subtree(f"{sink.name}_{part}")
    allowed = frozenset(int(i) for i in np.flatnonzero(tree))
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        joint = data.joint(sink.joint(part))
        anchor, axis = joint.xanchor.copy(), joint.xaxis.copy()
        grip, along = _hold_of(env, sink.name, part)
        angle = left_over()
        turning = abs(axis[2]) > 0.7  # about a plumb line: the hand turns with it
        direction = np.cross(axis, grip - anchor) * np.sign(angle)
        rows = []
        for rotation in _grasps(env, along, direction):
            before = HandTarget(grip - rotation[:, 2] * STANDOFF_M, rotation)
            row = (before, HandTarget(grip, rotation))
            rows.append((*row, _turned(row[1], anchor, axis, angle, turns_hand=turning)))
        plan = plan_near(env, rows, SHIFTS, allowed=allowed, tried=tried)
        tried.append(plan.targets[-1].rotation)
        at = yield from _take_hold(env, plan)
        held = HandTarget(grip_position(data), at.rotation)
        # Water that runs stays on: its lever is carried, not leaned on.
        lift = UP * (0.012 if part == "handle_temp" else 0.0)
        yield from _lead_to(env, held, anchor, axis, left_over(), left_over, turns_hand=turning, lift=lift)
        yield from _let_go(env)
        if abs(left_over()) < DONE_RAD or stage_done(env, stage):
            return
    raise SkillError(f"{part} of {sink.name}: {np.degrees(left_over()):.0f} degrees left after {ATTEMPTS} attempts")


def _take_hold(env: KitchenEnv, plan: MotionPlan) -> Generator[Array, None, HandTarget]:
    """Go along a plan to its second pose, and close the fingers there; that is returned."""
    yield from shift_base(env, plan.shift, OPEN)
    yield from follow_joint_path(env, plan.joints, OPEN)
    before, at = plan.targets[:2]
    yield from move_hand(env.data, before, OPEN, tolerance=0.015)
    yield from move_hand(env.data, at, OPEN, speed=0.6, tolerance=0.008, max_steps=40)
    yield from hold_hand(env.data, at, CLOSED, GRASP_STEPS)
    return at


def _lead_to(
    env: KitchenEnv,
    held: HandTarget,
    anchor: Array,
    axis: Array,
    total: float,
    left_over: Callable[[], float],
    *,
    turns_hand: bool = True,
    lift: Array | float = 0.0,
) -> Iterator[Array]:
    """Turn a hand that holds a part about its hinge by an angle `total`, until nothing is left over."""
    steps = 30 if abs(total) < LONG_TURN_RAD else 60
    for step in range(steps + 50):
        share = min(1.0, (step + 1) / steps)
        if abs(left_over()) < 0.04:
            break
        # A little ahead of the part, which drags behind.
        ahead = min(abs(total) * min(1.15, share + 0.15), abs(total) + MOST_AHEAD_RAD)
        goal = _turned(held, anchor, axis, float(np.sign(total)) * ahead, turns_hand=turns_hand)
        yield from hold_hand(env.data, HandTarget(goal.position + lift, goal.rotation), CLOSED, 1)


def _let_go(env: KitchenEnv) -> Iterator[Array]:
    """Open the fingers, and draw the hand back along its approach."""
    rest = HandTarget(grip_position(env.data), hand_rotation(env.data))
    yield from hold_hand(env.data, rest, OPEN, GRASP_STEPS)
    away = HandTarget(rest.position - rest.rotation[:, 2] * 0.10, rest.rotation)
    yield from move_hand(env.data, away, OPEN, max_steps=30, tolerance=0.03)


def _hold_of(env: KitchenEnv, sink: str, part: str) -> tuple[Array, Array]:
    """Where to grasp a part of the faucet, world, and the direction in which it runs there."""
    data = env.data
    if part == "spout":
        tip = data.site(f"{sink}_water").xpos
        return tip + UP * 0.03, UP
    lever = data.geom(f"{sink}_handle_lever_0")
    along = lever.xmat.reshape(3, 3)[:, 2].copy()
    hub = data.body(f"{sink}_handle").xpos
    along *= np.sign(along @ (lever.xpos - hub))
    return lever.xpos + along * 0.022, along


def _grasps(env: KitchenEnv, along: Array, direction: Array) -> list[Array]:
    """Rotations of the hand with the fingers on either side of a bar that runs `along` and is to move `direction`."""
    out = []
    for approach in _approaches(env):
        across: Array = np.cross(approach, along).astype(np.float64)
        if np.linalg.norm(across) > 0.5:
            out += [frame(approach, across), frame(approach, -across)]
    return out


def _approaches(env: KitchenEnv) -> list[Array]:
    """Directions in which the hand may point: forwards and to both sides, from level to straight down."""
    _, yaw = base_pose(env.data)
    out = []
    for turn in np.deg2rad((0.0, 40.0, -40.0, 80.0, -80.0)):
        level = np.array([np.cos(yaw + turn), np.sin(yaw + turn), 0.0])
        out += [np.cos(tilt) * level - np.sin(tilt) * UP for tilt in np.deg2rad((10.0, 35.0, 60.0))]
    return [*out, -UP]


def level_and_down(env: KitchenEnv) -> list[Array]:
    """Rotations of the hand that may push from above: from level to straight down, with both rolls."""
    out = []
    for approach in _approaches(env):
        side = np.cross(approach, UP)
        _, yaw = base_pose(env.data)
        side = side if np.linalg.norm(side) > 0.1 else np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        out += [frame(approach, side), frame(approach, -side)]
    return out


def push_row(
    gripper: GripperGeometry, point: Array, direction: Array, rotation: Array, travel: float
) -> tuple[HandTarget, ...]:
    """Away from, before, at the touch, and at the end of a push of a point."""
    approach = rotation[:, 2]
    aside = 1.0 - abs(float(approach @ direction))
    touch = point - direction * (gripper.closed_reach(rotation, direction) + 0.004) - approach * SHORT_M * aside
    before = touch - direction * 0.015 - approach * 0.05 * aside - direction * 0.04 * (1 - aside)
    level = approach * np.array([1.0, 1.0, 0.0])
    return (
        HandTarget(before - level * 0.07, rotation),
        HandTarget(before, rotation),
        HandTarget(touch, rotation),
        HandTarget(touch + direction * (travel + 0.006), rotation),
    )


def _upper_face(env: KitchenEnv, body: int, direction: Array, case: Array) -> tuple[Array, Array]:
    """Middle of the face that a part is pushed on, of its largest geom that can be touched, and its edge off a case."""
    model, data = env.model, env.data
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    solid = [
        g
        for g in range(first, first + count)
        if model.geom_contype[g] and model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX
    ]
    knob = max(solid, key=lambda g: float(model.geom_size[g].min()))
    axes = data.geom_xmat[knob].reshape(3, 3).T
    half = float(model.geom_size[knob] @ np.abs(axes @ direction))
    away = axes @ (data.geom_xpos[knob] - case) * (np.abs(axes @ direction) < 0.5)
    side = int(np.argmax(np.abs(away)))
    outwards = axes[side] * np.sign(away[side])
    middle = np.asarray(data.geom_xpos[knob] - direction * half)
    return middle, middle + outwards * (model.geom_size[knob][side] - EDGE_M)


def _turned(target: HandTarget, anchor: Array, axis: Array, angle: float, *, turns_hand: bool) -> HandTarget:
    turn = rotation_about(axis, angle)
    return HandTarget(
        anchor + turn @ (target.position - anchor), turn @ target.rotation if turns_hand else target.rotation
    )
