"""Knobs: held between the finger tips along their axis, and turned with the wrist."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    UP,
    Array,
    HandTarget,
    frame,
    grip_position,
    hand_rotation,
    rotation_about,
)
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.planning.motion_planner import plan_near
from robocasa_lerobot.demos.skills.base_shift import shift_base
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand, stage_done
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.place import leave
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.scene.initial_states import initial_share
from robocasa_lerobot.envs.tasks.conditions import KNOB
from robocasa_lerobot.envs.tasks.task import Stage

GRASPS = 6  # at most; a turn that the wrist cannot make in one goes on with another grasp
GRASP_STEPS = 10
STANDOFF_M = 0.09
DEPTH_M = 0.012  # of the grip site below the knob's face: pads that reach over it, tips short of the panel
TURN_STEPS = 45
TURN_AT_ONCE_RAD = 1.7
LEAST_TURN_RAD = 0.15  # by which a grasp turns the knob, or the next one is another
LEAD_RAD = 0.35  # that the hand's goal is ahead of the hand
TILTS = tuple(np.deg2rad((0.0, 15.0)))
# Of the hand at a knob that faces to the right: from its axis towards straight ahead, and about it.
FRONT_TURNS = tuple(np.deg2rad((0.0, 30.0, 50.0, 70.0)))
FRONT_ROLLS = tuple(np.deg2rad((0.0, 25.0, -25.0, 50.0, -50.0, 80.0, -80.0)))
SHIFTS = ((0.0, 0.0), (-0.15, 0.0), (-0.15, -0.25), (-0.15, 0.25), (-0.3, 0.0), (-0.3, -0.3), (-0.3, 0.3), (-0.45, 0.0))
BESIDE_SHIFTS = ((0.0, 0.0), (0.0, -0.3), (-0.15, -0.4), (-0.15, 0.0), (-0.3, -0.3), (0.0, -0.5), (-0.15, 0.25))
DONE_RAD = 0.06
# Where burners' knobs are turned to, radians; shares of the range for ovens.
BURNER_ON_RAD, BURNER_MEDIUM_RAD, BURNER_LOW_RAD = 1.5, 1.5, 0.87
RAISED_SHARE, ADJUST_SHARE = 0.40, 0.26


def turn_on_burner(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn a burner's knob well past the point from which it burns."""
    yield from _turn_to(env, stage, BURNER_ON_RAD)


def turn_off_burner(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn a burner's knob back to its stop."""
    yield from _turn_to(env, stage, 0.0)


def turn_burner_low(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn a burner's knob to the middle of what counts as low."""
    yield from _turn_to(env, stage, BURNER_LOW_RAD)


def turn_burner_medium(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn a burner's knob to the middle of what counts as medium."""
    yield from _turn_to(env, stage, BURNER_MEDIUM_RAD)


def turn_lowest(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn an oven's knob down to its stop."""
    yield from _turn_to(env, stage, 0.0)


def turn_highest(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn an oven's knob up to its stop."""
    yield from _turn_to(env, stage, _range(env, stage))


def raise_knob(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn an oven's knob up from zero."""
    yield from _turn_to(env, stage, RAISED_SHARE * _range(env, stage))


def turn_knob(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Turn a knob up or down from where it was at reset, as the task's direction asks."""
    change = ADJUST_SHARE if env.scene.fill(stage.to) == "increase" else -ADJUST_SHARE
    share = initial_share(env.scene, stage.target, stage.part) + change
    yield from _turn_to(env, stage, float(np.clip(share, 0.0, 1.0)) * _range(env, stage))


def _range(env: KitchenEnv, stage: Stage) -> float:
    fixture = env.scene.fixture(stage.target, Appliance)
    return float(env.model.joint(fixture.joint(env.scene.fill(stage.part))).range[1])


def _part_of(env: KitchenEnv, stage: Stage) -> str:
    """The stage's knob; where it names an object, that of the burner which the object stands on."""
    if not stage.object:
        return env.scene.fill(stage.part)
    hob, name = env.scene.fixture(stage.target, Hob), env.scene.fill(stage.object)
    burner, _ = hob.nearest_burner(env.data, middle_of(env.scene, env.data, name))
    return f"{KNOB}{burner}"


def _turn_to(env: KitchenEnv, stage: Stage, goal: float) -> Iterator[Array]:
    """Grasp and turn until the knob stands at an angle, radians.

    Raises:
        SkillError: it does not after six grasps.
    """
    data, fixture = env.data, env.scene.fixture(stage.target, Appliance)
    part = _part_of(env, stage)
    body = data.body(f"{fixture.name}_{part}")
    allowed = frozenset({int(body.id)})
    inwards = data.joint(fixture.joint(part)).xaxis.copy()
    shifts = BESIDE_SHIFTS if _faces_aside(body.xmat.reshape(3, 3), inwards) else SHIFTS
    tried: list[Array] = []
    for _ in range(GRASPS):
        left_over = goal - fixture.position(data, part)
        turn = float(np.clip(left_over, -TURN_AT_ONCE_RAD, TURN_AT_ONCE_RAD))
        face = body.xpos - inwards * _length(env, int(body.id), inwards)
        grip = face + inwards * DEPTH_M
        rows = [_row(grip, rotation, inwards, turn) for rotation in _rotations(body.xmat.reshape(3, 3), inwards)]
        plan = plan_near(env, rows, shifts, allowed=allowed, tried=tried)
        yield from shift_base(env, plan.shift, OPEN)
        yield from follow_joint_path(env, plan.joints, OPEN)
        before, at, _ = plan.targets
        yield from move_hand(data, before, OPEN, tolerance=0.008, max_steps=60)
        yield from move_hand(data, at, OPEN, speed=0.6, tolerance=0.005, max_steps=40)
        yield from hold_hand(data, at, CLOSED, GRASP_STEPS)
        yield from _twist(env, at, inwards, goal, lambda: fixture.position(data, part))
        rest = HandTarget(grip_position(data), hand_rotation(data))
        yield from hold_hand(data, rest, OPEN, GRASP_STEPS)
        away = HandTarget(rest.position - rest.rotation[:, 2] * STANDOFF_M, rest.rotation)
        yield from move_hand(data, away, OPEN, max_steps=30, tolerance=0.03)
        now_left = abs(goal - fixture.position(data, part))
        if now_left > abs(left_over) - LEAST_TURN_RAD:  # something blocks the hand
            tried.append(plan.targets[-1].rotation)
        if now_left < 2 * DONE_RAD or stage_done(env, stage):
            if stage.object:
                yield from leave(env, graspable(env, stage.object))
            return
    raise SkillError(
        f"{part} of {fixture.name} is at {np.degrees(fixture.position(data, part)):.0f} degrees after {GRASPS} grasps, "
        f"not at {np.degrees(goal):.0f}"
    )


def _twist(env: KitchenEnv, at: HandTarget, axis: Array, goal: float, angle: Callable[[], float]) -> Iterator[Array]:
    """Turn the hand about the knob's axis, ahead of where it is, until the knob is there or turns no more."""
    best, since = np.inf, 0
    for _ in range(TURN_STEPS):
        left_over = goal - angle()
        if abs(left_over) < DONE_RAD:
            return
        if abs(left_over) < best - 0.01:
            best, since = abs(left_over), 0
        else:
            since += 1
        if since > 10:
            return
        lead = float(np.clip(left_over * 1.5, -LEAD_RAD, LEAD_RAD))
        rotation = rotation_about(axis, lead) @ hand_rotation(env.data)
        yield from hold_hand(env.data, HandTarget(at.position, rotation), CLOSED, 1)


def _row(grip: Array, rotation: Array, axis: Array, turn: float) -> tuple[HandTarget, HandTarget, HandTarget]:
    return (
        HandTarget(grip - rotation[:, 2] * STANDOFF_M, rotation),
        HandTarget(grip, rotation),
        HandTarget(grip, rotation_about(axis, turn) @ rotation),
    )


def _rotations(knob: Array, inwards: Array) -> list[Array]:
    """Rotations of the hand along the knob's axis with the fingers across its grip, if it is a bar; both rolls.

    The bar runs upwards in the knob's frame (or away, for a knob on top), so that fingers close along its x.
    """
    if _faces_aside(knob, inwards):
        return _from_the_front(knob[:, 1], inwards)
    lean = -UP if abs(inwards[2]) < 0.7 else knob[:, 1]
    out = []
    for tilt in TILTS:
        approach = np.cos(tilt) * inwards + np.sin(tilt) * lean
        for roll in np.deg2rad((0.0, 180.0, 90.0, -90.0, 45.0, -45.0, 135.0, -135.0)):
            out.append(frame(approach, rotation_about(inwards, float(roll)) @ knob[:, 0]))
    return out


def _faces_aside(knob: Array, inwards: Array) -> bool:
    return abs(float(inwards @ knob[:, 0])) > 0.7


def _from_the_front(ahead: Array, inwards: Array) -> list[Array]:
    """The same for a round knob at the side of its fixture: from beside it, or as far from its front as need be."""
    out = []
    for turn in FRONT_TURNS:
        approach = np.cos(turn) * inwards + np.sin(turn) * ahead
        for side in (UP, -UP):
            level = frame(approach, side)
            out += [rotation_about(inwards, float(roll)) @ level for roll in FRONT_ROLLS]
    return out


def _length(env: KitchenEnv, body: int, inwards: Array) -> float:
    """How far the knob stands out, metres."""
    model, data = env.model, env.data
    out = 0.0
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    for geom in range(first, first + count):
        if not model.geom_contype[geom]:
            continue
        turn = data.geom_xmat[geom].reshape(3, 3)
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        middle = data.geom_xpos[geom] + turn @ centre - data.xpos[body]
        out = max(out, float(-middle @ inwards) + float(half @ np.abs(turn.T @ inwards)))
    return out
