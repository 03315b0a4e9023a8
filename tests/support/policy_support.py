"""What the tests of our policies share: features, batches, statistics, building; small diffusion transformers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)

INSTRUCTIONS = ("Open the left drawer.", "Close the right drawer, please.")
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


def with_features[C: PreTrainedConfig](config: C, pixels: int = 32) -> C:
    config.input_features = {
        **{key: PolicyFeature(FeatureType.VISUAL, (3, pixels, pixels)) for key in contract.IMAGE_KEYS},
        contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,)),
    }
    config.output_features = {contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))}
    return config


def tiny_config(pixels: int = 32, **overrides: Any) -> DiffusionTransformerConfig:
    return with_features(DiffusionTransformerConfig(**{**TINY, **overrides}), pixels)


def batch_for(
    config: PreTrainedConfig, size: int = 4, pixels: int = 32, seed: int = 0, uint8: bool = True
) -> dict[str, Any]:
    """A batch as a LeRobot data loader gives it, before the preprocessor: a single picture has no time axis."""
    rng = np.random.default_rng(seed)
    steps, length = config.observation_delta_indices, len(config.action_delta_indices)
    observed = (size,) if steps is None else (size, len(steps))
    seen = (size,) if steps is None or len(steps) == 1 else observed
    batch: dict[str, Any] = {}
    for key in contract.IMAGE_KEYS:
        images = torch.from_numpy(rng.integers(0, 256, (*seen, 3, pixels, pixels), dtype=np.uint8))
        batch[key] = images if uint8 else images.float() / 255
    batch[contract.STATE_KEY] = torch.from_numpy(rng.uniform(-1, 1, (*observed, contract.STATE_SIZE)))
    batch[contract.ACTION_KEY] = torch.from_numpy(rng.uniform(-1, 1, (size, length, contract.ACTION_SIZE)))
    batch["action_is_pad"] = torch.zeros(size, length, dtype=torch.bool)
    batch["task"] = [INSTRUCTIONS[i % 2] for i in range(size)]
    return batch


def unit_stats() -> dict[str, dict[str, np.ndarray]]:
    """Statistics with which normalisation changes nothing."""
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    return {
        key: {"min": -np.ones(n), "max": np.ones(n), "mean": np.zeros(n), "std": np.ones(n)} for key, n in sizes.items()
    }


def build(config: PreTrainedConfig, seed: int = 0) -> tuple[Any, Any, Any]:
    """A new policy of a configuration with features, its preprocessor and its postprocessor."""
    torch.manual_seed(seed)
    return (get_policy_class(config.type)(config), *make_pre_post_processors(config, dataset_stats=unit_stats()))


def generators(*seeds: int) -> list[torch.Generator]:
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def check_trains_and_predicts(policy: Any, preprocess: Any, postprocess: Any, length: int) -> None:
    """A policy of `build` has a loss that reaches every weight, and predicts chunks out of `length` actions."""
    config = policy.config
    batch = preprocess(batch_for(config))
    loss, _ = policy.train()(batch)
    each, _ = policy(batch, reduction="none")
    assert loss.shape == ()
    assert torch.isfinite(loss)
    assert each.shape == (4,)
    loss.backward()
    assert [name for name, p in policy.named_parameters() if p.requires_grad and p.grad is None] == []
    chunk = policy.predict_action_chunk(batch)
    assert chunk.shape == (4, config.n_action_steps, contract.ACTION_SIZE)
    assert policy.sample(batch).shape == (4, length, contract.ACTION_SIZE)
    assert torch.isfinite(postprocess(chunk)).all()
    ahead = getattr(config, "look_ahead", 0)
    assert len(config.action_delta_indices) == max(length, ahead and ahead - 1 + config.n_obs_steps)


def check_wrong_features_and_batches_are_explained(
    policy_class: Callable[[Any], Any], config_class: Callable[..., Any], tiny_config: Callable[..., Any]
) -> None:
    """What a policy that takes a state and pictures says of features and batches that do not fit."""
    config = tiny_config()
    config.input_features = {k: v for k, v in config.input_features.items() if k == contract.STATE_KEY}
    with pytest.raises(UserError, match="no camera"):
        policy_class(config)
    with pytest.raises(UserError, match="needs 'observation\\.state'"):
        policy_class(config_class(device="cpu"))
    with pytest.raises(UserError, match="has 16 components"):
        policy_class(tiny_config(state_indices=[16]))
    policy, preprocess, _ = build(tiny_config())
    raw = batch_for(policy.config)
    with pytest.raises(UserError, match="pass it through the policy's preprocessor"):
        policy(raw)
    with pytest.raises(UserError, match="action_delta_indices"):
        policy(preprocess({**raw, "action": raw["action"][:, :4]}))
    with pytest.raises(UserError, match="has no instructions"):
        preprocess({k: v for k, v in raw.items() if k != "task"})
