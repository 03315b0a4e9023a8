"""Which of some stages comes first where their objects lie heaped in one vessel: that of the uppermost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robocasa_lerobot.demos.skills.common import stage_done
from robocasa_lerobot.demos.skills.pick_place.graspable import filled, graspable, holder_of
from robocasa_lerobot.demos.skills.pick_place.poses.plate_poses import is_flat
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

HIGHER_M = 0.02  # of an object's origin over another one's that it counts as lying on


def uppermost(env: KitchenEnv, stages: Sequence[Stage], index: int) -> int:
    """Index of the stage to do first: the one asked for, or one that follows and takes what lies over its object.

    Only stages that put objects down are exchanged, one after the other, and only those out of the same vessel.
    """
    if not _places(stages[index]):
        return index
    name = env.scene.fill(stages[index].object)
    vessel = _vessel(env, name)
    if not vessel:
        return index
    first, highest = index, _height(env, name) + HIGHER_M
    for later in range(index + 1, len(stages)):
        if not _places(stages[later]):
            break
        other = env.scene.fill(stages[later].object)
        over = _height(env, other) > highest and _vessel(env, other) == vessel
        over = over and (not is_flat(env, vessel) or _overlap(env, name, other))
        if over and not stage_done(env, stages[later]):
            first, highest = later, _height(env, other)
    return first


def _places(stage: Stage) -> bool:
    return (stage.skill, stage.verb) == ("pick_place", "place")


def _vessel(env: KitchenEnv, name: str) -> str:
    """The object that an object lies in or on in the end, be it on others in there; empty where there is none."""
    passed = [name]
    while (holder := holder_of(env, passed[-1])) and holder not in passed:
        passed.append(holder)
    return passed[-1] if len(passed) > 1 else ""


def _overlap(env: KitchenEnv, lower: str, upper: str) -> bool:
    """Whether an object reaches over another one, seen from above: beside it, on a plate, it keeps no hand off it."""
    turn, body = env.data.body(lower).xmat.reshape(3, 3), env.data.body(upper)
    half = float(graspable(env, lower).half_extents(turn)[:2].min())
    points = np.concatenate([filled(solid.cloud()) for solid in graspable(env, upper).solids])
    away = points @ body.xmat.reshape(3, 3).T + body.xpos - env.data.body(lower).xpos
    return float(np.linalg.norm(away[:, :2], axis=1).min()) < half


def _height(env: KitchenEnv, name: str) -> float:
    return float(env.data.body(name).xpos[2])
