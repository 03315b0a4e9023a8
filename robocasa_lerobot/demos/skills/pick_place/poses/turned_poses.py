"""How an object is to be turned where it is put down, as its stage asks for: by where its handle points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.predicates.placed_by import HandlePoints
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

type Fit = Callable[[Array, Array], float]

SLACK_RAD = float(np.deg2rad(10.0))  # that an object may turn as it is let go
OFF_COST, MISS_COST = 0.4, 6.0  # of a radian off the wanted direction, and of one that the stage does not allow


def as_turned(env: KitchenEnv, stage: Stage, fit: Fit | None) -> Fit | None:
    """A cost of an object's origin and rotation: `fit`, and what its handle is off; None where there is neither."""
    name = env.scene.fill(stage.object)
    terms = [
        term
        for term in every_goal_in(stage_condition(env.declaration, stage))
        if isinstance(term, HandlePoints) and env.scene.fill(term.object) == name
    ]
    if not terms:
        return fit

    def cost(origin: Array, turn: Array) -> float:
        total = 0.0 if fit is None else fit(origin, turn)
        for term in terms:
            off = term.off(env.scene, turn)
            total += OFF_COST * off + (MISS_COST if off > term.within - SLACK_RAD else 0.0)
        return total

    return cost
