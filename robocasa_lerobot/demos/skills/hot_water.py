"""Run hot water: the faucet's lever is lifted, then turned to hot; the hand stays clear until enough has run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from robocasa_lerobot.demos.motion import CLOSED, Array, HandTarget, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, stage_done
from robocasa_lerobot.demos.skills.levers import turn_on_water, turn_sideways
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.predicates import PartWithin, StateIs
from robocasa_lerobot.envs.tasks.task import Stage

HOT_FROM = 0.6  # share of the temperature's range
ATTEMPTS, MOST_STEPS = 3, 160


def run_hot_water(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Let hot water run until the stage is done.

    Raises:
        SkillError: it is not, after all attempts.
    """
    data, sink = env.data, env.scene.fixture(stage.target, Sink)
    lift = replace(stage, verb="on", part="handle", until=StateIs(stage.target, "water_on"))
    warm = replace(
        stage,
        verb="turn",
        part="handle_temp",
        to="other than cold",
        until=PartWithin(stage.target, "handle_temp", low=HOT_FROM, label="hot"),
    )
    for _ in range(ATTEMPTS):
        if not sink.water_on(data):
            yield from turn_on_water(env, lift)
        if not stage_done(env, warm):
            yield from turn_sideways(env, warm)
        at = HandTarget(grip_position(data), hand_rotation(data))
        for _ in range(MOST_STEPS):
            if stage_done(env, stage):
                return
            yield from hold_hand(data, at, CLOSED, 1)
    raise SkillError(f"hot water has run from {sink.name} in vain {ATTEMPTS} times")
