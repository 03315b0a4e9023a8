"""Rinse an object: hold it under the stream for as long as its stage asks, then put it down at the stage's target."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.common import stage_done
from robocasa_lerobot.demos.skills.pick_place.hold import hold_object
from robocasa_lerobot.demos.skills.pick_place.verbs import place_object
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import AllOf, Goal, StepsWhile
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage


def rinse(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Hold the stage's object under water until the steps that its condition counts are done, then place it.

    Raises:
        SkillError: it was not under water long enough, or is not where it belongs after all attempts.
    """
    held, placed = parts_of_rinsing(env, stage)
    if not stage_done(env, held):
        yield from hold_object(env, held)
    yield from place_object(env, placed)


def parts_of_rinsing(env: KitchenEnv, stage: Stage) -> tuple[Stage, Stage]:
    """What a stage that rinses consists of: to hold its object under water, and to put it down."""
    condition = stage_condition(env.declaration, stage)
    parts: tuple[Goal, ...] = condition.parts if isinstance(condition, AllOf) else (condition,)
    counted = [part for part in parts if isinstance(part, StepsWhile)]
    rest = AllOf(*(part for part in parts if part not in counted))
    return replace(stage, verb="hold", until=AllOf(*counted)), replace(stage, verb="place", until=rest)
