"""Small configurations and batches of the policy `diffusion_transformer`, for its tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from lerobot.configs import FeatureType, PolicyFeature

from robocasa_lerobot import contract
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)

TINY: dict[str, Any] = {
    "device": "cpu",
    "vision_encoder": "convnet",
    "vision_channels": [8, 16],
    "vision_keypoints": 4,
    "vision_features": 8,
    "vision_shared": True,
    "language_dim": 16,
    "language_buckets": 64,
    "max_words": 8,
    "width": 16,
    "n_heads": 2,
    "n_decoder_layers": 2,
    "n_condition_layers": 1,
    "dropout": 0.0,
    "num_inference_steps": 4,
}


def with_features(config: DiffusionTransformerConfig, pixels: int = 32) -> DiffusionTransformerConfig:
    config.input_features = {
        **{key: PolicyFeature(FeatureType.VISUAL, (3, pixels, pixels)) for key in contract.IMAGE_KEYS},
        contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,)),
    }
    config.output_features = {contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))}
    return config


def tiny_config(pixels: int = 32, **overrides: Any) -> DiffusionTransformerConfig:
    return with_features(DiffusionTransformerConfig(**{**TINY, **overrides}), pixels)


def batch_for(
    config: DiffusionTransformerConfig, size: int = 4, pixels: int = 32, seed: int = 0, uint8: bool = True
) -> dict[str, Any]:
    """A batch as a LeRobot data loader gives it, before the preprocessor."""
    rng = np.random.default_rng(seed)
    steps = config.n_obs_steps
    batch: dict[str, Any] = {}
    for key in contract.IMAGE_KEYS:
        images = torch.from_numpy(rng.integers(0, 256, (size, steps, 3, pixels, pixels), dtype=np.uint8))
        batch[key] = images if uint8 else images.float() / 255
    batch[contract.STATE_KEY] = torch.from_numpy(rng.uniform(-1, 1, (size, steps, contract.STATE_SIZE)))
    batch[contract.ACTION_KEY] = torch.from_numpy(rng.uniform(-1, 1, (size, config.horizon, contract.ACTION_SIZE)))
    batch["action_is_pad"] = torch.zeros(size, config.horizon, dtype=torch.bool)
    batch["task"] = [("Open the left drawer.", "Close the right drawer.")[i % 2] for i in range(size)]
    return batch


def unit_stats() -> dict[str, dict[str, np.ndarray]]:
    """Statistics with which min-max normalisation changes nothing."""
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    return {key: {"min": -np.ones(size), "max": np.ones(size)} for key, size in sizes.items()}
