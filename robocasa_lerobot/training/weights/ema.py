"""Exponential moving average of a policy's trainable weights."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from robocasa_lerobot.training.config.phase import EmaConfig
from robocasa_lerobot.training.weights.by_place import by_place, take_over
from robocasa_lerobot.training.weights.master_weights import MasterWeights


def ema_decay(step: int, config: EmaConfig) -> float:
    """Decay after `step` updates before: 0 at the first, so that the average starts from trained weights.

    Source: the warm-up schedule of Diffusion Policy (Chi et al. 2023), 1 - (1 + step / inv_gamma) ** -power.
    """
    if step <= 0:
        return config.min_decay
    return min(max(1.0 - (1.0 + step / config.inv_gamma) ** -config.power, config.min_decay), config.max_decay)


class Ema:
    """Averages of the trainable parameters in float32; frozen ones and buffers are the policy's own.

    `step` counts the updates; a new average starts from the weights that the policy has. Where `masters` has float32
    copies of weights in half precision, these are averaged: with a decay of 0.99 or more, a hundredth of a step is
    lost in half precision.
    """

    def __init__(
        self, policy: torch.nn.Module, config: EmaConfig, step: int = 0, masters: MasterWeights | None = None
    ) -> None:
        self.config, self.step = config, step
        self._live = [p for p in policy.parameters() if p.requires_grad]
        self._source = [masters.of(p) if masters is not None else p for p in self._live]
        self._average = [p.detach().to(torch.float32, copy=True) for p in self._source]

    @property
    def in_half_precision(self) -> bool:
        """Whether the policy's weights, and so those of a checkpoint, do not tell the averages exactly."""
        return any(p.dtype != torch.float32 for p in self._live)

    @torch.no_grad()
    def update(self) -> None:
        """Take the weights after an optimiser step into the average."""
        decay = ema_decay(self.step, self.config)
        torch._foreach_lerp_(self._average, [p.detach().float() for p in self._source], 1.0 - decay)
        self.step += 1

    def state(self) -> dict[str, torch.Tensor]:
        """The averages, by the place of their parameter."""
        return by_place(self._average)

    def load(self, state: dict[str, torch.Tensor]) -> None:
        """Take averages over that `state` gave.

        Raises:
            RuntimeError: they are of other parameters.
        """
        take_over(self._average, state, "averages")

    @contextmanager
    def applied(self) -> Iterator[None]:
        """The policy has the averaged weights, in their type, inside this context, and its own again after it."""
        rounded = [(p, a) for p, a in zip(self._live, self._average, strict=True) if p.dtype != a.dtype]
        kept = [live.detach().clone() for live, _ in rounded]
        self._exchange()
        with torch.no_grad():
            for live, average in rounded:
                live.copy_(average)
        try:
            yield
        finally:
            self._exchange()
            with torch.no_grad():
                for (live, _), value in zip(rounded, kept, strict=True):
                    live.copy_(value)

    @torch.no_grad()
    def _exchange(self) -> None:
        """Of the float32 weights, one after the other: no second copy of all of them is needed."""
        for live, average in zip(self._live, self._average, strict=True):
            if live.dtype == average.dtype:
                value = live.detach().clone()
                live.copy_(average)
                average.copy_(value)
