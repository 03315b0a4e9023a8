"""What every registered task must pass, short of being solved (which the demonstrator's tests show)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robocasa_lerobot.envs.kitchen_env import KitchenEnv

CHECK_SEEDS = range(10)
IDLE_STEPS = 5
IMAGE_SIZE = 32


def check_task(name: str, split: str = "target", seeds: Iterable[int] = CHECK_SEEDS) -> list[str]:
    """Faults of a task, in words; an empty list is a pass.

    For every seed: it resets; the goal does not hold at reset nor after standing idle; observations and states are
    finite and inside their space; the same seed gives bit-identical observations and states.
    """
    faults: list[str] = []
    first = KitchenEnv(name, split=split, image_size=IMAGE_SIZE)
    second = KitchenEnv(name, split=split, image_size=IMAGE_SIZE)
    idle = np.zeros(first.action_space.shape or (), dtype=np.float32)
    try:
        for seed in seeds:
            observation, info = first.reset(seed=seed)
            again, _ = second.reset(seed=seed)
            for step in range(IDLE_STEPS + 1):
                where = f"seed {seed}, step {step}"
                if info["success"]:
                    faults.append(f"{where}: the goal holds although nothing was done")
                if not first.observation_space.contains(observation):
                    faults.append(f"{where}: the observation is not in the observation space")
                state = np.concatenate([first.data.qpos, first.data.qvel])
                if not np.all(np.isfinite(state)) or not np.all(np.isfinite(observation["agent_pos"])):
                    faults.append(f"{where}: values are not finite")
                if not np.array_equal(state, np.concatenate([second.data.qpos, second.data.qvel])):
                    faults.append(f"{where}: the same seed gave another state")
                if not np.array_equal(observation["agent_pos"], again["agent_pos"]) or any(
                    not np.array_equal(observation["pixels"][camera], again["pixels"][camera])
                    for camera in first.cameras
                ):
                    faults.append(f"{where}: the same seed gave another observation")
                observation, _, _, _, info = first.step(idle)
                again = second.step(idle)[0]
    finally:
        first.close()
        second.close()
    return faults
