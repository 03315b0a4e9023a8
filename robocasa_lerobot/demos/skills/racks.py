"""Racks and drawers inside appliances: their front is pushed in with a closed hand, or held at its edge and pulled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import MotionPlan, plan_near
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 3
GRASP_STEPS = 10
# Shares of the range that are aimed at, beyond what tasks ask for.
IN_GOAL, OUT_GOAL = 0.02, 0.98
STANDOFF_M, OVER_M = 0.06, 0.08
SPEED = 0.6
BEYOND_M = 0.05  # of the commanded end of a slide: with the servo's lag, the force of the push
# The hand looks inwards and down by these angles, and across by those, radians.
TILTS = tuple(np.deg2rad((15.0, 40.0, 65.0, 85.0)))
TURNS = tuple(np.deg2rad((0.0, 35.0, -35.0)))
# A plan that costs more than the first meets something: then the edge is hooked from behind. Fingers along the edge;
# how far they reach below its top, and are behind it as they come down; how far they rise over it and begin before it.
IN_THE_WAY, ALONG_COS, STEEP_SINE = 0.7, 0.8, 0.35
HOOK_M, HOOK_GAP_M, HOOK_RISE_M, HOOK_OUT_M = 0.013, 0.003, 0.022, 0.10
SHIFTS = (
    (0.0, 0.0),
    (-0.15, 0.0),
    (0.12, 0.0),
    (0.0, 0.2),
    (0.0, -0.2),
    (-0.15, 0.25),
    (-0.15, -0.25),
    (-0.3, 0.0),
    (0.2, 0.0),
    (-0.3, 0.3),
    (-0.3, -0.3),
)


def slide(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Pull a rack out or push it in, as the episode's direction says.

    Raises:
        SkillError: it is not there after three attempts.
    """
    yield from (push if env.scene.fill(stage.to) == "in" else pull)(env, stage)


def push(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Push a rack or drawer in at its front with closed fingers.

    Raises:
        SkillError: it is not in after three attempts.
    """
    data, part = env.data, _Part.of(env, stage)
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        travel = part.position
        rows = []
        for spot in part.spots((0.0, 0.5)):
            for rotation in rotations(part.inwards):
                touch = spot - part.inwards * env.robot.gripper.closed_reach(rotation, part.inwards)
                rows.append(_row(touch, rotation, -part.inwards, part.inwards * travel))
        plan = _plan(env, part, rows, tried)
        tried.append(plan.targets[-1].rotation)
        yield from shift_base(env, plan.shift, CLOSED)
        yield from follow_joint_path(env, plan.joints, CLOSED)
        yield from _approach(env, plan, CLOSED)
        end = plan.targets[-1]
        goal = HandTarget(end.position + part.inwards * BEYOND_M, end.rotation)
        yield from move_hand(data, goal, CLOSED, speed=SPEED, max_steps=130, until=lambda: part.share <= IN_GOAL)
        if part.share <= IN_GOAL:
            return
        yield from move_hand(data, _off(env, -part.inwards), CLOSED, max_steps=25)
    raise SkillError(f"{part.name} is still {part.share:.0%} out after {ATTEMPTS} attempts")


def pull(env: KitchenEnv, stage: Stage, enough: float = OUT_GOAL) -> Iterator[Array]:
    """Hold the edge of a rack or drawer, one finger before or above it and one behind or below, and pull.

    It is pulled all the way; after an attempt that came at least to the share `enough` there is no other one.

    Raises:
        SkillError: it is not out after three attempts.
    """
    data, part = env.data, _Part.of(env, stage)
    tried: list[Array] = []
    for _ in range(ATTEMPTS):
        travel = part.full - part.position
        rows = []
        for spot in part.spots((0.0, 0.5)):
            for rotation in rotations(part.inwards):
                # The fingers close round the edge: they open across it, not along it.
                if abs(float(rotation[:, 1] @ part.rightwards)) > 0.3:
                    continue
                at = spot + part.inwards * part.thick / 2
                rows.append(_row(at, rotation, -rotation[:, 2], -part.inwards * travel))
        plan, fingers = _plan(env, part, rows, tried), OPEN
        if plan.cost > IN_THE_WAY:
            hooked = _plan(env, part, _hooks(env, part, travel), tried)
            if hooked.cost < plan.cost:
                plan, fingers = hooked, CLOSED
        tried.append(plan.targets[-1].rotation)
        yield from shift_base(env, plan.shift, fingers)
        yield from follow_joint_path(env, plan.joints, fingers)
        yield from _approach(env, plan, fingers)
        _, _, held, end = plan.targets
        if fingers == OPEN:
            yield from hold_hand(data, held, CLOSED, GRASP_STEPS)
        goal = HandTarget(end.position - part.inwards * BEYOND_M, end.rotation)
        yield from move_hand(data, goal, CLOSED, speed=SPEED, max_steps=130, until=lambda: part.share >= OUT_GOAL)
        if part.share >= enough:
            return
        yield from hold_hand(data, HandTarget(grip_position(data), hand_rotation(data)), OPEN, GRASP_STEPS)
        yield from move_hand(data, _off(env, -held.rotation[:, 2]), OPEN, max_steps=25)
    raise SkillError(f"{part.name} is only {part.share:.0%} out after {ATTEMPTS} attempts")


def _hooks(env: KitchenEnv, part: _Part, travel: float) -> list[tuple[HandTarget, ...]]:
    """Closed fingers, side by side along the front edge, that come over it and pull from behind it.

    Where a rack is all the way in, a hand that holds its edge meets the roof or the open door.
    """
    rows = []
    for spot in part.spots((0.0, 0.5)):
        top = spot + UP * (part.high[2] - part.low[2]) / 2
        for rotation in rotations(part.inwards):
            if abs(float(rotation[:, 1] @ part.rightwards)) < ALONG_COS or float(rotation[:, 2] @ UP) > -STEEP_SINE:
                continue
            behind = part.thick + HOOK_GAP_M + env.robot.gripper.closed_reach(rotation, -part.inwards)
            high = env.robot.gripper.closed_reach(rotation, -UP) - HOOK_M
            at = top + part.inwards * behind + UP * high
            over = at + UP * HOOK_RISE_M
            row = (over - part.inwards * HOOK_OUT_M + UP * HOOK_RISE_M, over, at, at - part.inwards * travel)
            rows.append(tuple(HandTarget(point, rotation) for point in row))
    return rows


def rotations(inwards: Array) -> list[Array]:
    """Rotations of the hand that look inwards and down: tilts and turns, each with four rolls."""
    out = []
    across = np.cross(inwards, UP)
    for turn in TURNS:
        level = np.cos(turn) * inwards + np.sin(turn) * across
        for tilt in TILTS:
            approach = np.cos(tilt) * level - np.sin(tilt) * UP
            other = np.cross(approach, across)
            out += [frame(approach, opening) for opening in (across, -across, other, -other)]
    return out


@dataclass(frozen=True)
class _Part:
    """A part that slides outwards out of an appliance.

    Attributes:
        name: of the part.
        low, high: corners of its front edge in the body's axes, metres.
    """

    env: KitchenEnv
    appliance: Appliance
    name: str
    low: Array
    high: Array

    @classmethod
    def of(cls, env: KitchenEnv, stage: Stage) -> _Part:
        appliance, name = env.scene.fixture(stage.target, Appliance), env.scene.fill(stage.part)
        model, body = env.model, env.model.body(f"{appliance.name}_{name}")
        first = int(body.geomadr[0])
        solid = [
            (model.geom_pos[g] - model.geom_size[g], model.geom_pos[g] + model.geom_size[g])
            for g in range(first, first + int(body.geomnum[0]))
            if model.geom_contype[g] or model.geom_conaffinity[g]
        ]
        # The geom that reaches farthest to the front is the lip, the grip or the ledge.
        low, high = min(solid, key=lambda box: float(box[0][1]))
        return cls(env, appliance, name, low, high)

    @property
    def body(self) -> int:
        return int(self.env.model.body(f"{self.appliance.name}_{self.name}").id)

    @property
    def inwards(self) -> Array:
        return self.env.data.xmat[self.body].reshape(3, 3)[:, 1].copy()

    @property
    def rightwards(self) -> Array:
        return self.env.data.xmat[self.body].reshape(3, 3)[:, 0].copy()

    @property
    def thick(self) -> float:
        return float(self.high[1] - self.low[1])

    @property
    def position(self) -> float:
        return self.appliance.position(self.env.data, self.name)

    @property
    def share(self) -> float:
        return self.appliance.share(self.env.data, self.name)

    @property
    def full(self) -> float:
        low, high = self.env.model.joint(self.appliance.joint(self.name)).range
        return float(high - low)

    def spots(self, shares: tuple[float, ...]) -> list[Array]:
        """Points of the front edge as it is now: from its middle towards the robot, shares of half of its width."""
        data = self.env.data
        middle = np.array([(self.low[0] + self.high[0]) / 2, self.low[1], (self.low[2] + self.high[2]) / 2])
        origin, turn = data.xpos[self.body], data.xmat[self.body].reshape(3, 3)
        side = float(np.sign((base_pose(data)[0] - origin) @ self.rightwards))
        half = (self.high[0] - self.low[0]) / 2
        return [origin + turn @ (middle + np.array([side * share * half, 0.0, 0.0])) for share in shares]


def _row(at: Array, rotation: Array, back: Array, slide: Array) -> tuple[HandTarget, ...]:
    """Over, before, at the edge, and where it is to be slid to."""
    before = at + back * STANDOFF_M
    return tuple(HandTarget(p, rotation) for p in (before + UP * OVER_M, before, at, at + slide))


def _plan(env: KitchenEnv, part: _Part, rows: list[tuple[HandTarget, ...]], tried: list[Array]) -> MotionPlan:
    return plan_near(env, rows, SHIFTS, allowed=frozenset({part.body}), tried=tried)


def _approach(env: KitchenEnv, plan: MotionPlan, gripper: float) -> Iterator[Array]:
    over, before, at, _ = plan.targets
    yield from move_hand(env.data, over, gripper, tolerance=0.03)
    yield from move_hand(env.data, before, gripper, tolerance=0.015)
    yield from move_hand(env.data, at, gripper, speed=SPEED, tolerance=0.006, max_steps=40)


def _off(env: KitchenEnv, direction: Array) -> HandTarget:
    data = env.data
    return HandTarget(grip_position(data) + direction * 0.10 + UP * 0.02, hand_rotation(data))
