"""A checkpoint of a tiny policy, as a fixture."""

from __future__ import annotations

from pathlib import Path

import pytest

from robocasa_lerobot import contract

SIZE = 32


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny policy with random weights: 2 observations, chunks of 8 executed steps, sampling noise at inference."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors

    from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
        DiffusionTransformerConfig,
    )

    torch.manual_seed(0)
    images = {key: PolicyFeature(FeatureType.VISUAL, (3, SIZE, SIZE)) for key in contract.IMAGE_KEYS}
    state = {contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,))}
    config = DiffusionTransformerConfig(
        input_features={**images, **state},
        output_features={contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))},
        device="cpu",
        vision_encoder="convnet",
        vision_shared=True,
        vision_channels=[8, 16],
        vision_keypoints=8,
        language_dim=16,
        language_buckets=64,
        width=32,
        n_heads=2,
        n_decoder_layers=1,
        n_condition_layers=1,
        num_inference_steps=2,
    )
    policy = get_policy_class(config.type)(config)
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    stats = {key: {"min": -torch.ones(n), "max": torch.ones(n)} for key, n in sizes.items()}
    folder = tmp_path_factory.mktemp("experiment") / "pretrain/checkpoints/000000/pretrained_model"
    policy.save_pretrained(folder)
    for processor in make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    return folder
