"""The noise levels that sampling asks for, and DDIM's steps between them.

diffusers' own DDIM goes back by the same whole number of levels each time, which is right only where the number of
steps divides that of the levels, and its `trailing` levels may be one more than asked for. Its DDPM takes levels as
they are given.
"""

from __future__ import annotations

from collections.abc import Sequence
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


class DdimSteps:
    """The steps of one denoising, from level to level, without new noise.

    Source: J. Song et al., "Denoising Diffusion Implicit Models" (2020), equation 12 with sigma 0.

    Args:
        scheduler: of the training, whose `config` says what is predicted and how far samples reach.
        times: the noise levels, falling; after the last one comes none.
    """

    def __init__(self, scheduler: DDIMScheduler, times: Sequence[int]) -> None:
        self.times = tuple(times)
        self._epsilon = scheduler.config.prediction_type == "epsilon"
        self._reach = scheduler.config.clip_sample_range if scheduler.config.clip_sample else None
        levels = [scheduler.alphas_cumprod[time] for time in times]
        self._shares = [
            (here**0.5, (1 - here) ** 0.5, there**0.5, (1 - there) ** 0.5)  # of the sample and of noise, here and there
            for here, there in zip(levels, [*levels[1:], scheduler.final_alpha_cumprod], strict=True)
        ]

    def step(self, number: int, prediction: Tensor, x: Tensor) -> Tensor:
        """The sample (B, T, A) after step `number` from 0 on, from the one before and the denoiser's prediction."""
        sample_here, noise_here, sample_there, noise_there = self._shares[number]
        if self._epsilon:
            noise, clean = prediction, (x - noise_here * prediction) / sample_here
        else:
            noise, clean = (x - sample_here * prediction) / noise_here, prediction
        if self._reach is not None:
            clean = clean.clamp(-self._reach, self._reach)
        out: Tensor = sample_there * clean + noise_there * noise
        return out
