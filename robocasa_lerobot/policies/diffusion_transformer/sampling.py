"""The noise levels that sampling asks for, and DDIM's step between two of them.

diffusers' own DDIM goes back by the same whole number of levels each time, which is right only where the number of
steps divides that of the levels, and its `trailing` levels may be one more than asked for. Its DDPM takes levels as
they are given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from numpy.typing import NDArray
from torch import Tensor

from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)


def sampling_times(config: DiffusionTransformerConfig) -> list[int]:
    """The noise levels of `num_inference_steps` steps, falling, each from 0 to `num_train_timesteps` - 1.

    Source: S. Lin et al., "Common Diffusion Noise Schedules and Sample Steps are Flawed" (2023), table 2.
    """
    levels = config.num_train_timesteps
    steps = config.num_inference_steps or levels
    count = np.arange(steps, dtype=np.float64)
    found: NDArray[Any]
    if config.timestep_spacing == "leading":
        found = count[::-1] * (levels // steps)
    elif config.timestep_spacing == "linspace":
        found = np.round(np.linspace(0.0, levels - 1.0, steps, dtype=np.float64))[::-1]
    else:
        found = np.round(levels * (steps - count) / steps) - 1
    return [int(level) for level in found]


def ddim_step(scheduler: DDIMScheduler, prediction: Tensor, x: Tensor, time: int, before: int) -> Tensor:
    """The sample (B, T, A) at level `before`, -1 for none, from that at level `time`, without new noise.

    Source: J. Song et al., "Denoising Diffusion Implicit Models" (2020), equation 12 with sigma 0.

    Args:
        scheduler: of the training, whose `config` says what is predicted and how far samples reach.
        prediction: of the denoiser at `time`, (B, T, A).
        x: sample at `time`, (B, T, A).
        time: noise level of `x`.
        before: noise level of what is returned.
    """
    here = scheduler.alphas_cumprod[time]
    there = scheduler.alphas_cumprod[before] if before >= 0 else scheduler.final_alpha_cumprod
    if scheduler.config.prediction_type == "epsilon":
        noise, clean = prediction, (x - (1 - here) ** 0.5 * prediction) / here**0.5
    else:
        noise, clean = (x - here**0.5 * prediction) / (1 - here) ** 0.5, prediction
    if scheduler.config.clip_sample:
        clean = clean.clamp(-scheduler.config.clip_sample_range, scheduler.config.clip_sample_range)
    out: Tensor = there**0.5 * clean + (1 - there) ** 0.5 * noise
    return out
