"""Chunks of actions in losses and sampling: noise, checks of shapes, the mean over what counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from diffusers.utils.torch_utils import randn_tensor
from lerobot.utils.constants import ACTION
from torch import Tensor, nn
from torch.nn import functional

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.configuration import ActionChunkConfig

ACTION_IS_PAD = ACTION + "_is_pad"
type Generators = torch.Generator | Sequence[torch.Generator] | None


def target_actions(batch: Mapping[str, Tensor], length: int, size: int, draws: int) -> Tensor:
    """The actions to learn (B * draws, length, size), in float32, each sample's repeated for its draws of noise.

    Raises:
        UserError: the batch's have another shape.
    """
    if tuple(batch[ACTION].shape[1:]) != (length, size):
        raise UserError(
            f"actions of shape {tuple(batch[ACTION].shape)}, expected (batch, {length}, {size}): load the data with "
            "the policy's action_delta_indices."
        )
    return batch[ACTION].float().repeat_interleave(draws, dim=0)


def sample_losses(prediction: Tensor, target: Tensor, batch: Mapping[str, Tensor], config: ActionChunkConfig) -> Tensor:
    """The loss of each sample, (B,): mean squared error over its draws and over the actions that count.

    `prediction` and `target` are (B * noise_draws, T, A), of the first T actions of the batch.
    """
    draws = config.noise_draws
    ignored = batch.get(ACTION_IS_PAD) if config.mask_padded_actions else None
    if ignored is not None:
        ignored = ignored[:, : target.shape[1]].repeat_interleave(draws, dim=0)
    return masked_mse(prediction, target, ignored).unflatten(0, (-1, draws)).mean(dim=1)


def masked_mse(prediction: Tensor, target: Tensor, ignored: Tensor | None) -> Tensor:
    """Mean squared error of each sample, (B,), over the actions (B, T, A) that are not `ignored` (B, T).

    A sample with nothing left counts as zero. Every sample weighs the same, however much of it is ignored, so that
    the mean over a batch is the mean over any equal parts of it (processes, accumulated batches).
    """
    return masked_mean(functional.mse_loss(prediction, target, reduction="none").mean(dim=-1), ignored)


def masked_mean(values: Tensor, ignored: Tensor | None) -> Tensor:
    """Mean (B, ...) of each sample's values (B, T, ...) over the steps that are not `ignored` (B, T); of none zero."""
    if ignored is None:
        return values.mean(dim=1)
    kept = (~ignored).to(values.dtype).unflatten(1, (-1, *[1] * (values.ndim - 2)))
    return (values * kept).sum(dim=1) / kept.sum(dim=1).clamp(min=1.0)


def beta_times(count: int, alpha: float, generator: torch.Generator | None) -> Tensor:
    """Training times (count,) in [0, 1) on the CPU: Beta(alpha, 1), by the inverse of its distribution, u^(1/alpha)."""
    return torch.rand(count, generator=generator) ** (1.0 / alpha)


def normal_noise(shape: Sequence[int], generator: Generators, like: Tensor) -> Tensor:
    """Standard normal noise of the type and on the device of `like`; one generator for all, or one per sample."""
    random: Any = generator if generator is None or isinstance(generator, torch.Generator) else list(generator)
    return randn_tensor(tuple(shape), generator=random, device=like.device, dtype=like.dtype)


def starting_noise(noise: Tensor | None, shape: Sequence[int], generator: Generators, like: Tensor) -> Tensor:
    """What sampling starts from: the noise that is given, or drawn where None.

    Raises:
        UserError: the noise has another shape.
    """
    x = normal_noise(shape, generator, like) if noise is None else noise.to(like)
    if tuple(x.shape) != tuple(shape):
        raise UserError(f"noise of shape {tuple(x.shape)}, expected {tuple(shape)}.")
    return x


def trained_by_name(module: nn.Module) -> dict[str, nn.Parameter]:
    """The parameters of `module` that are not frozen, by their names, for optimisers that go by these."""
    return {name: p for name, p in module.named_parameters() if p.requires_grad}


def decay_groups(module: nn.Module) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
    """Trainable parameters of `module` that weight decay is for, and the rest.

    It is for the matrices of linear layers and attention; the rest are biases, scales of norms and positions.
    """
    decayed: list[nn.Parameter] = []
    for child in module.modules():
        if isinstance(child, nn.Linear):
            decayed.append(child.weight)
        elif isinstance(child, nn.MultiheadAttention) and child.in_proj_weight is not None:
            decayed.append(child.in_proj_weight)
    chosen = {id(p) for p in decayed}
    rest = [p for p in module.parameters() if id(p) not in chosen and p.requires_grad]
    return [p for p in decayed if p.requires_grad], rest
