"""Waiting with the hand still, for what comes about by itself."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.motion import OPEN, Array, action
from robocasa_lerobot.demos.skills.common import wait_for_stage
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

PATIENCE_STEPS = 60  # without anything coming nearer


def wait(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Stand still until the stage's condition, which remembers how much of it has passed, holds."""
    yield from wait_for_stage(env, stage, lambda: action(gripper=OPEN), PATIENCE_STEPS)
