"""Muon for the matrices inside a network, AdamW for the rest.

Muon: Jordan et al. 2024, "Muon: An optimizer for hidden layers in neural networks"; a step's momentum is made
orthogonal, so that all directions of a matrix move alike. PyTorch's has matrices only; the weights of convolutions
are taken here as matrices of (outputs, inputs x height x width). What it is worth: docs/decisions/0043-muon.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from lerobot.optim.optimizers import OptimizerConfig
from torch import Tensor, nn
from torch.optim import _muon

# Parts of names of what is no map between hidden features: tables, positions, first and last layers, modulations.
NOT_HIDDEN = ("embed", "position", "film", "modulation", "text_encoder")
LAST_LAYER = "head"  # ends a part of its name, which `multihead_attn` does not


def is_hidden_matrix(name: str, parameter: Tensor) -> bool:
    """Whether Muon is for a parameter: two axes or more, more than one row and column, none of `NOT_HIDDEN`."""
    if parameter.ndim < 2 or any(part in name for part in NOT_HIDDEN):
        return False
    if any(part.endswith(LAST_LAYER) for part in name.split(".")):
        return False
    return min(parameter.shape[0], parameter.shape[1:].numel()) > 1


class MuonAdamW(torch.optim.Optimizer):
    """Groups whose `matrices` is true are moved by Muon, others by AdamW; one state and one list of groups for both.

    `groups` have `params`, `matrices`, `lr` and `weight_decay`; those of matrices `momentum` as well, others `betas`
    and `eps`.
    """

    def __init__(self, groups: list[dict[str, Any]]) -> None:
        super().__init__(groups, {})
        others = [group for group in self.param_groups if not group["matrices"]]
        self._adamw = torch.optim.AdamW(others) if others else None
        self._share()

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._share()

    def _share(self) -> None:
        if self._adamw is None:
            return
        self._adamw.state = self.state
        self._adamw.param_groups = [group for group in self.param_groups if not group["matrices"]]

    @torch.no_grad()
    def step(self, closure: Callable[[], Any] | None = None) -> Any:
        """Move all parameters that have a gradient."""
        loss = None
        if closure is not None:
            with torch.enable_grad():
                loss = closure()
        for group in self.param_groups:
            if group["matrices"]:
                self._orthogonal_step(group)
        if self._adamw is not None:
            self._adamw.step()
        return loss

    def _orthogonal_step(self, group: dict[str, Any]) -> None:
        moved = [p for p in group["params"] if p.grad is not None]
        for parameter in moved:
            if "momentum_buffer" not in self.state[parameter]:
                self.state[parameter]["momentum_buffer"] = torch.zeros_like(parameter)
        _muon.muon(
            [_matrix(p) for p in moved],
            [_matrix(p.grad) for p in moved],
            [_matrix(self.state[p]["momentum_buffer"]) for p in moved],
            lr=group["lr"],
            weight_decay=group["weight_decay"],
            momentum=group["momentum"],
            nesterov=True,
            ns_coefficients=(_muon.DEFAULT_A, _muon.DEFAULT_B, _muon.DEFAULT_C),
            ns_steps=_muon.DEFAULT_NS_STEPS,
            eps=_muon.EPS,
            adjust_lr_fn="original",
            has_complex=False,
        )


def _matrix(tensor: Tensor) -> Tensor:
    return tensor.view(tensor.shape[0], -1)  # the same memory, or an error


@OptimizerConfig.register_subclass("muon")
@dataclass
class MuonConfig(OptimizerConfig):
    """LeRobot's optimiser settings `muon`; rates are per step, `weight_decay` is for the matrices only.

    `lr`, `betas` and `eps` are AdamW's, for all that is not a hidden matrix; `matrix_lr` and `momentum` are Muon's.
    """

    lr: float = 1e-3
    matrix_lr: float = 0.01
    momentum: float = 0.95
    betas: tuple[float, float] = (0.9, 0.95)
    eps: float = 1e-8
    weight_decay: float = 0.0
    grad_clip_norm: float = 1.0

    def build(self, params: Any) -> MuonAdamW:
        """Make the optimiser of parameters by their names.

        Raises:
            TypeError: they have no names.
        """
        if not isinstance(params, Mapping):
            raise TypeError(f"`muon` needs parameters by their names, found {type(params).__name__}.")
        named: Mapping[str, nn.Parameter] = params
        matrices = [p for name, p in named.items() if is_hidden_matrix(name, p)]
        chosen = {id(p) for p in matrices}
        rest = [p for p in named.values() if id(p) not in chosen]
        muon = {"matrices": True, "lr": self.matrix_lr, "momentum": self.momentum, "weight_decay": self.weight_decay}
        adamw = {"matrices": False, "lr": self.lr, "betas": self.betas, "eps": self.eps, "weight_decay": 0.0}
        groups = [{"params": matrices, **muon}, {"params": rest, **adamw}]
        return MuonAdamW([group for group in groups if group["params"]])
