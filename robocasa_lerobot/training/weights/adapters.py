"""What of a policy a phase trains: parts can be frozen, or low-rank changes trained in their place.

The low-rank changes are written here and not taken from peft, because a checkpoint then is an ordinary policy with
changed weights that LeRobot loads and the next phase starts from, and no further package is needed.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from types import MethodType
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils import parametrize

from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.training.config.phase import LoraConfig, PhaseConfig
from robocasa_lerobot.training.weights.master_weights import HALF

_INSIDE = "parametrizations"  # torch's name for where the original weight and its change live


class LowRank(nn.Module):
    """A weight (out, in) plus `scale` * B A, with A (rank, in) at random and B (out, rank) zero at the beginning.

    Source: Hu et al. 2021, "LoRA: Low-Rank Adaptation of Large Language Models", section 4.1. Dropout is that of
    the entries of A, since a change of weights does not see the layer's inputs.
    """

    def __init__(self, weight: Tensor, config: LoraConfig, generator: torch.Generator) -> None:
        super().__init__()
        outputs, inputs = weight.shape
        rank = min(config.rank, outputs, inputs)
        start = torch.randn(rank, inputs, generator=generator) / inputs**0.5
        self.down = nn.Parameter(start.to(weight))
        self.up = nn.Parameter(torch.zeros(outputs, rank).to(weight))
        self.scale = (config.rank if config.alpha is None else config.alpha) / config.rank
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, weight: Tensor) -> Tensor:
        """The changed weight (out, in), rounded once where it is in half precision."""
        if weight.dtype in HALF:
            return (weight.float() + self.scale * (self.up.float() @ self.dropout(self.down.float()))).to(weight.dtype)
        return weight + self.scale * (self.up @ self.dropout(self.down))

    def change(self, inputs: Tensor) -> Tensor:
        """What is added to the layer's outputs (..., out) for inputs (..., in)."""
        return self.scale * functional.linear(functional.linear(inputs, self.dropout(self.down)), self.up)


def _beside_the_layer(layer: Any, inputs: Tensor) -> Tensor:
    """A linear layer's forward whose change goes by its outputs.

    Added to a weight in half precision, which lies on the grid of such numbers, a change below half of its last bit
    would be lost, and with it most of what is learned at first.
    """
    weight = layer.parametrizations.weight
    return functional.linear(inputs, weight.original, layer.bias) + weight[0].change(inputs)


def apply_training_scope(policy: nn.Module, phase: PhaseConfig, seed: int) -> list[nn.Module]:
    """Freeze what the phase does not train, and add its low-rank changes; returns modules to keep in eval mode.

    Raises:
        UserError: a pattern that fits nothing of the policy (the closest names are given).
    """
    if phase.lora is not None:
        _add_low_rank(policy, phase.lora, seed)
        return []
    for pattern in phase.freeze:
        for name in _matching(policy, [pattern], "`freeze`"):
            policy.get_parameter(name).requires_grad_(False)
    modules = [m for name, m in policy.named_modules() if name and _fits(name, phase.freeze)]
    return [module for module in modules if not any(p.requires_grad for p in module.parameters())]


def merged_state(policy: nn.Module) -> dict[str, Tensor] | None:
    """The policy's weights with the low-rank changes added, under their ordinary names; None if it has no changes."""
    changed = {name: m for name, m in policy.named_modules() if parametrize.is_parametrized(m)}
    if not changed:
        return None
    state = {name: value for name, value in policy.state_dict().items() if f"{_INSIDE}." not in name}
    with torch.no_grad():
        for name, module in changed.items():
            was_training = module.training
            module.eval()  # without dropout
            for weight in module.parametrizations:
                state[f"{name}.{weight}"] = getattr(module, weight).detach().clone().contiguous()
            module.train(was_training)
    return state


def _add_low_rank(policy: nn.Module, config: LoraConfig, seed: int) -> None:
    layers = {}  # name of a weight matrix: the module that has it
    for name, module in policy.named_modules():
        if isinstance(module, nn.Linear):
            layers[name] = (module, "weight")
        elif isinstance(module, nn.MultiheadAttention) and module.in_proj_weight is not None:
            layers[f"{name}.in_proj"] = (module, "in_proj_weight")
    for pattern in config.targets or []:
        if not any(_fits(name, [pattern]) for name in layers):
            raise UnknownNameError("layer", pattern, layers, "(in `targets` of `lora`)")
    trained = _matching(policy, config.train, "`train` of `lora`") if config.train else []
    targets = [
        name
        for name, (module, weight) in layers.items()
        # A policy freezes by itself what it never trains, as GR00T its vision and language models.
        if (getattr(module, weight).requires_grad if config.targets is None else _fits(name, config.targets))
    ]
    policy.requires_grad_(False)
    generator = torch.Generator().manual_seed(seed)
    for name in targets:
        module, weight = layers[name]
        change = LowRank(getattr(module, weight), config, generator)
        parametrize.register_parametrization(module, weight, change)
        if isinstance(module, nn.Linear) and module.weight.dtype in HALF:
            module.forward = MethodType(_beside_the_layer, module)
    names = {f"{n.replace(f'.{_INSIDE}', '').removesuffix('.original')}": n for n, _ in policy.named_parameters()}
    for name in trained:
        policy.get_parameter(names[name]).requires_grad_(True)


def _matching(policy: nn.Module, patterns: Sequence[str], where: str) -> list[str]:
    """Names of the parameters that fit a pattern, or lie in a module that does."""
    names = [name for name, _ in policy.named_parameters()]
    for pattern in patterns:
        if not any(_fits(name, [pattern]) for name in names):
            modules = [name for name, _ in policy.named_modules() if name and name.count(".") < 3]
            raise UnknownNameError("part of the policy", pattern, modules, f"(in {where})")
    return [name for name in names if _fits(name, patterns)]


def _fits(name: str, patterns: Sequence[str]) -> bool:
    pieces = name.split(".")
    prefixes = [".".join(pieces[:end]) for end in range(1, len(pieces) + 1)]
    return any(fnmatch.fnmatchcase(prefix, pattern) for pattern in patterns for prefix in prefixes)
