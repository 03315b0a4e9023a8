"""What every registered task must pass, short of being solved (which `demos/task_check.py` adds)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.placement.overlaps import sunk_in

CHECK_SEEDS = range(10)
IDLE_SECONDS = 5.0  # of simulated time without an action, in which the goal must not come to hold
COMPARED_STEPS = 5  # in which a second env goes along, pictures included
IMAGE_SIZE = 32


def check_task(name: str, split: str = "target", seeds: Iterable[int] = CHECK_SEEDS) -> list[str]:
    """Faults of a task, in words; an empty list is a pass.

    For every seed: it resets; the goal does not hold at reset nor within `IDLE_SECONDS` without an action; observations
    and states are finite and inside their space; the same seed gives bit-identical observations and states; nothing
    reaches more than 6 mm into anything else at reset, nor after that time.
    """
    first = KitchenEnv(name, split=split, image_size=IMAGE_SIZE)
    second = KitchenEnv(name, split=split, image_size=IMAGE_SIZE)
    try:
        return [fault for seed in seeds for fault in _check_seed(first, second, seed)]
    finally:
        first.close()
        second.close()


def _check_seed(first: KitchenEnv, second: KitchenEnv, seed: int) -> Iterator[str]:
    idle = np.zeros(first.action_space.shape or (), dtype=np.float32)
    first.render_observations = second.render_observations = True
    observation, info = first.reset(seed=seed)
    again, _ = second.reset(seed=seed)
    steps = round(IDLE_SECONDS * contract.CONTROL_HZ)
    for step in range(steps + 1):
        where = f"seed {seed}, step {step}"
        compared = step <= COMPARED_STEPS
        first.render_observations = compared
        if step:
            observation, _, _, _, info = first.step(idle)
        if info["success"]:
            yield f"{where}: the goal holds although nothing was done"
            return
        if not first.observation_space.contains(observation):
            yield f"{where}: the observation is not in the observation space"
        state = np.concatenate([first.data.qpos, first.data.qvel])
        if not np.all(np.isfinite(state)) or not np.all(np.isfinite(observation["agent_pos"])):
            yield f"{where}: values are not finite"
            return
        if compared:
            if step:
                again = second.step(idle)[0]
            yield from (f"{where}: {fault}" for fault in _differences(first, second, observation, again))
        if step in (0, steps):
            for one, other, depth in sunk_in(first.model, first.data):
                yield f"{where}: {one} reaches {1000 * depth:.0f} mm into {other}, and nothing presses it"


def _differences(first: KitchenEnv, second: KitchenEnv, observation: dict, again: dict) -> Iterator[str]:
    """Differences between two envs that were reset with the same seed."""
    ours, theirs = (np.concatenate([env.data.qpos, env.data.qvel]) for env in (first, second))
    if not np.array_equal(ours, theirs):
        yield "the same seed gave another state"
    if not np.array_equal(observation["agent_pos"], again["agent_pos"]) or any(
        not np.array_equal(observation["pixels"][camera], again["pixels"][camera]) for camera in first.cameras
    ):
        yield "the same seed gave another observation"
