"""A teleoperator without a human: it repeats recorded demonstrations, one per episode."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.replay import demonstrations, read_demonstration
from robocasa_lerobot.devices.config_replay import RobocasaReplayConfig
from robocasa_lerobot.devices.kitchen_teleoperator import KitchenTeleoperator
from robocasa_lerobot.devices.translation import NAMES


class RobocasaReplay(KitchenTeleoperator):
    """Says the actions of a demonstration, one at each `get_action`; after its last one it holds still.

    In its kitchen (`--robot.demos` of the same file) they reach the goal again. Raises UserError where there are none.
    """

    config_class = RobocasaReplayConfig
    name = "robocasa_replay"

    def __init__(self, config: RobocasaReplayConfig) -> None:
        super().__init__(config, self._begin)
        self._chosen = demonstrations([config.demos])
        self._episode = 0
        self._load()

    def get_action(self) -> dict[str, float]:
        """The next action of the demonstration."""
        index = min(self._step, len(self._actions) - 1)
        action: NDArray[np.float64] = self._actions[index].copy()
        if self._step >= len(self._actions):
            kept = contract.ACTION_SLICES["gripper_close"], contract.ACTION_SLICES["control_mode"]
            still = np.zeros_like(action)
            for where in kept:
                still[where] = action[where]
            action = still
        self._step += 1
        return dict(zip(NAMES, action.tolist(), strict=True))

    def _begin(self, number: int) -> None:
        self._episode = number
        self._load()

    def _load(self) -> None:
        path, demo = self._chosen[self._episode % len(self._chosen)]
        self._actions = read_demonstration(path, demo).actions
        self._step = 0
