"""A demonstration as commands, carried out while they are read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.demonstrator import SkillError, demonstrate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


def demonstrated_commands(env: KitchenEnv) -> Iterator[NDArray[np.float32]]:
    """Commands (12,) of a demonstration in the scene that an env was reset to, until the episode ends.

    Each is carried out when the next one is read. A demonstrator that gives up ends it: what it did until then is a
    course like any other.
    """
    with suppress(SkillError):
        for action in demonstrate(env):
            command = action.astype(np.float32)
            yield command
            _, _, terminated, truncated, _ = env.step(command)
            if terminated or truncated:
                return
