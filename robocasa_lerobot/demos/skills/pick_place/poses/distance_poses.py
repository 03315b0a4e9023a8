"""Which place poses bring an object as near to others, or as far from them, as its stage asks for."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.logic import Goal, Not
from robocasa_lerobot.envs.predicates.near import Near, NearerThan, OnOneSide
from robocasa_lerobot.envs.predicates.placed_by import BeforeStools, Behind, Beside, NearFixture
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

SLIP_M = 0.02  # that an object may come to lie beside where it was let go
SLIPS = tuple(SLIP_M * np.array(way) for way in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)))
SLIP_COST, MISS_COST = 0.3, 6.0  # of each slip after which, and of a place at which, the stage would not be done


def distance_terms(env: KitchenEnv, stage: Stage) -> tuple[Goal, ...]:
    """What a stage asks of the distances between its object and others, or fixtures; of others also not to be near."""
    name = env.scene.fill(stage.object)
    found: list[Goal] = []
    for term in _asked_for(stage_condition(env.declaration, stage)):
        match term:
            case Not(part=Near() as near) if name == env.scene.fill(near.object):
                found.append(term)
            case Near() | Behind() | Beside() | NearFixture() if name == env.scene.fill(term.object):
                found.append(term)
            case NearerThan() | OnOneSide() | BeforeStools() if name in _names(env, term.objects):
                found.append(term)
    return tuple(found)


def _asked_for(goal: Goal) -> Iterator[Goal]:
    """Everything that a goal is made of but what is not to hold, which stays whole."""
    if isinstance(goal, Not):
        yield goal
        return
    for part in goal.inner:
        yield from _asked_for(part)
    yield goal


def near_to(env: KitchenEnv, stage: Stage) -> list[Array]:
    """Where the others are that a stage's object is to be near to, world, metres, each (3,); of fixtures both sides."""
    names: list[str] = []
    sides: list[Array] = []
    for term in distance_terms(env, stage):
        match term:
            case Near() | Beside():
                names += _names(env, term.other)
            case NearerThan():
                names += _names(env, term.to)
            case NearFixture():
                fixture = env.scene.fixture(term.fixture)
                sides += [fixture.to_world((side * fixture.width / 2, 0.0, 0.0)) for side in (-1, 1)]
            case BeforeStools():
                sides += [stool.to_world((0.0, 0.0, 0.0)) for stool in env.scene.layout.of_type("stool")]
    own = env.scene.fill(stage.object)
    others = [env.data.body(name).xpos.copy() for name in dict.fromkeys(names) if name != own]
    return others or sides


def at_distances(env: KitchenEnv, stage: Stage, obj: Graspable, poses: PlacePoses) -> PlacePoses:
    """Of place poses those that fulfil what a stage asks of distances; all of them, dearer, where none does.

    An object that may slip as it is let go costs more where the stage would not be done any more.
    """
    terms = distance_terms(env, stage)
    if not terms:
        return poses

    def chosen() -> Sequence[PlacePose]:
        scratch = copy.copy(env.data)
        free = scratch.joint(f"{obj.name}_joint0")
        turn = env.data.body(obj.name).xmat.reshape(3, 3)

        def done(point: Array) -> bool:
            free.qpos[:3] = point + obj.below(turn) * UP
            mujoco.mj_kinematics(env.model, scratch)
            return all(term.evaluate(env.scene, scratch, {}) for term in terms)

        good, bad = [], []
        for pose in poses():
            if not done(pose.point):
                bad.append(replace(pose, extra=pose.extra + MISS_COST))
                continue
            missed = sum(not done(pose.point + np.array([*slip, 0.0])) for slip in SLIPS)
            good.append(replace(pose, extra=pose.extra + SLIP_COST * missed))
        return good or bad

    return chosen


def _names(env: KitchenEnv, names: str | tuple[str, ...]) -> list[str]:
    return [env.scene.fill(name) for name in ((names,) if isinstance(names, str) else names)]
