"""Weights in half precision are trained through a float32 copy, the master weights.

A step of AdamW at a rate of 2.5e-5 is smaller than the distance between two neighbouring bfloat16 numbers for most
weights: added to them, it is lost. The optimiser therefore updates float32 copies, and the policy's own weights are
these, rounded. Source: Micikevicius et al. 2018, "Mixed Precision Training", section 3.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor, nn

from robocasa_lerobot.training.weights.by_place import by_place, take_over

HALF = (torch.bfloat16, torch.float16)


def half_parameters(policy: nn.Module) -> list[nn.Parameter]:
    """The policy's trained parameters that are kept in half precision."""
    return [p for p in policy.parameters() if p.requires_grad and p.dtype in HALF]


class MasterWeights:
    """Float32 copies of the trained parameters in half precision; the others are their own."""

    def __init__(self, policy: nn.Module) -> None:
        self._live = half_parameters(policy)
        self._masters = [nn.Parameter(p.detach().float()) for p in self._live]
        self._of = {id(live): master for live, master in zip(self._live, self._masters, strict=True)}

    def __len__(self) -> int:
        return len(self._masters)

    def of(self, parameter: nn.Parameter) -> nn.Parameter:
        """The float32 copy of a parameter, or the parameter where it has none."""
        return self._of.get(id(parameter), parameter)

    def groups(self, groups: Any) -> Any:
        """An optimiser's parameters or parameter groups with the float32 copies in their places."""
        if isinstance(groups, Mapping):
            return {name: self.of(parameter) for name, parameter in groups.items()}
        return [self._group(group) if isinstance(group, dict) else self.of(group) for group in groups]

    def _group(self, group: dict[str, Any]) -> dict[str, Any]:
        params: Iterable[Any] = group["params"]
        return {**group, "params": [self.of(p) for p in params]}

    def follow(self, optimizer: torch.optim.Optimizer) -> None:
        """From now on each step of the optimiser takes the policy's gradients, and gives the policy its weights."""
        if self._masters:
            optimizer.register_step_pre_hook(lambda *_: self._take_gradients())
            optimizer.register_step_post_hook(lambda *_: self.write_back())

    def _take_gradients(self) -> None:
        for live, master in zip(self._live, self._masters, strict=True):
            master.grad = None if live.grad is None else live.grad.float()
            live.grad = None  # the optimiser does not know it, and so would not empty it

    @torch.no_grad()
    def write_back(self) -> None:
        """Round the float32 copies into the policy's weights."""
        for live, master in zip(self._live, self._masters, strict=True):
            master.grad = None
            live.copy_(master)

    def state(self) -> dict[str, Tensor]:
        """The float32 copies, by the place of their parameter."""
        return by_place(self._masters)

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take copies over that `state` gave; the policy's weights become these, rounded.

        Raises:
            RuntimeError: they are of other parameters.
        """
        take_over(self._masters, state, "master weights")
        self.write_back()
