"""Exponential moving average of a policy's trainable weights."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from robocasa_lerobot.training.phase_config import EmaConfig


def ema_decay(step: int, config: EmaConfig) -> float:
    """Decay after `step` updates before: 0 at the first, so that the average starts from trained weights.

    Source: the warm-up schedule of Diffusion Policy (Chi et al. 2023), 1 - (1 + step / inv_gamma) ** -power.
    """
    if step <= 0:
        return config.min_decay
    return min(max(1.0 - (1.0 + step / config.inv_gamma) ** -config.power, config.min_decay), config.max_decay)


class Ema:
    """Averages of the trainable parameters; frozen ones and buffers are the policy's own.

    `step` counts the updates; a new average starts from the weights that the policy has.
    """

    def __init__(self, policy: torch.nn.Module, config: EmaConfig, step: int = 0) -> None:
        self.config, self.step = config, step
        self._live = [p for p in policy.parameters() if p.requires_grad]
        self._average = [p.detach().clone() for p in self._live]

    @torch.no_grad()
    def update(self) -> None:
        """Take the weights after an optimiser step into the average."""
        decay = ema_decay(self.step, self.config)
        torch._foreach_lerp_(self._average, [p.detach() for p in self._live], 1.0 - decay)
        self.step += 1

    def state(self) -> dict[str, torch.Tensor]:
        """The averages, by the place of their parameter."""
        return {f"{number:06d}": average for number, average in enumerate(self._average)}

    def load(self, state: dict[str, torch.Tensor]) -> None:
        """Take averages over that `state` gave.

        Raises:
            RuntimeError: they are of other parameters.
        """
        if len(state) != len(self._average):
            raise RuntimeError(f"{len(state)} averages for {len(self._average)} parameters")
        for number, average in enumerate(self._average):
            average.copy_(state[f"{number:06d}"])

    @contextmanager
    def applied(self) -> Iterator[None]:
        """The policy has the averaged weights inside this context, and its own again after it."""
        self._exchange()
        try:
            yield
        finally:
            self._exchange()

    @torch.no_grad()
    def _exchange(self) -> None:
        for live, average in zip(self._live, self._average, strict=True):
            kept = live.detach().clone()
            live.copy_(average)
            average.copy_(kept)
