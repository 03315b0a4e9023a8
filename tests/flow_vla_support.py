"""Small configurations, batches and pretrained models of the policy `flow_vla`, for its tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from torch import Tensor

from robocasa_lerobot import contract
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.modeling_flow_vla import FlowVlaPolicy

INSTRUCTIONS = ("Open the left drawer.", "Close the right drawer, please.")
TINY: dict[str, Any] = {
    "device": "cpu",
    "chunk_size": 6,
    "n_action_steps": 4,
    "image_size": (16, 16),
    "vision_channels": [8, 16],
    "vision_layers": 1,
    "prefix_width": 16,
    "prefix_depth": 2,
    "prefix_heads": 4,
    "prefix_kv_heads": 2,
    "prefix_head_dim": 8,
    "language_buckets": 64,
    "max_words": 8,
    "expert_width": 16,
    "expert_mlp_ratio": 2.0,
    "num_inference_steps": 4,
}
# Kinds of a tiny pretrained model; of both the classes are the real ones.
KINDS = ("smolvlm", "paligemma")


def with_features[C: PreTrainedConfig](config: C, pixels: int = 32) -> C:
    config.input_features = {
        **{key: PolicyFeature(FeatureType.VISUAL, (3, pixels, pixels)) for key in contract.IMAGE_KEYS},
        contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,)),
    }
    config.output_features = {contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))}
    return config


def tiny_config(**overrides: Any) -> FlowVlaConfig:
    return with_features(FlowVlaConfig(**{**TINY, **overrides}))


def pretrained_config(folder: Path, **overrides: Any) -> FlowVlaConfig:
    return tiny_config(**{"prefix": "pretrained", "prefix_path": str(folder), "image_size": None, **overrides})


def batch_for(config: FlowVlaConfig, size: int = 4, pixels: int = 32, seed: int = 0, uint8: bool = True) -> Any:
    """A batch as a LeRobot data loader gives it, before the preprocessor."""
    rng = np.random.default_rng(seed)
    batch: dict[str, Any] = {}
    for key in contract.IMAGE_KEYS:
        images = torch.from_numpy(rng.integers(0, 256, (size, 3, pixels, pixels), dtype=np.uint8))
        batch[key] = images if uint8 else images.float() / 255
    batch[contract.STATE_KEY] = torch.from_numpy(rng.uniform(-1, 1, (size, contract.STATE_SIZE)))
    batch[contract.ACTION_KEY] = torch.from_numpy(rng.uniform(-1, 1, (size, config.chunk_size, contract.ACTION_SIZE)))
    batch["action_is_pad"] = torch.zeros(size, config.chunk_size, dtype=torch.bool)
    batch["task"] = [INSTRUCTIONS[i % 2] for i in range(size)]
    return batch


def unit_stats() -> dict[str, dict[str, np.ndarray]]:
    """Statistics with which normalisation changes nothing."""
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    return {
        key: {"min": -np.ones(n), "max": np.ones(n), "mean": np.zeros(n), "std": np.ones(n)} for key, n in sizes.items()
    }


def write_pretrained(folder: Path, kind: str) -> Path:
    """A vision-language model with random weights and a tokenizer of few words, as `save_pretrained` writes them."""
    from tokenizers import Tokenizer, models, pre_tokenizers
    from transformers import (
        PaliGemmaConfig,
        PaliGemmaForConditionalGeneration,
        PreTrainedTokenizerFast,
        SmolVLMConfig,
        SmolVLMForConditionalGeneration,
    )

    torch.manual_seed(0)
    words = ["[UNK]", "[PAD]", *sorted({w for text in INSTRUCTIONS for w in text.strip(".").split()}), ".", ",", "\n"]
    text = {
        "vocab_size": 64,
        "hidden_size": 24,
        "intermediate_size": 32,
        "num_hidden_layers": 3,
        "num_attention_heads": 4,
        "num_key_value_heads": 1,
        "head_dim": 8,
        "pad_token_id": 1,
    }
    vision = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 2, "num_attention_heads": 2}
    if kind == "smolvlm":
        config: Any = SmolVLMConfig(
            text_config={"model_type": "llama", **text},
            vision_config={"model_type": "smolvlm_vision", "image_size": 32, "patch_size": 4, **vision},
            scale_factor=2,
            image_token_id=60,
            pad_token_id=1,
        )
        model: Any = SmolVLMForConditionalGeneration(config)
    else:
        config = PaliGemmaConfig(
            text_config={"model_type": "gemma", **text},
            vision_config={"model_type": "siglip_vision_model", "image_size": 16, "patch_size": 4, **vision},
            projection_dim=24,
            image_token_id=60,
        )
        model = PaliGemmaForConditionalGeneration(config)
    model.save_pretrained(folder)
    tokenizer = Tokenizer(models.WordLevel({word: i for i, word in enumerate(words)}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence(
        [pre_tokenizers.Split("\n", "isolated"), pre_tokenizers.Punctuation(), pre_tokenizers.Split(" ", "removed")]
    )
    PreTrainedTokenizerFast(tokenizer_object=tokenizer, unk_token="[UNK]", pad_token="[PAD]").save_pretrained(folder)
    return folder


def build(config: FlowVlaConfig, seed: int = 0, awake: bool = True) -> tuple[FlowVlaPolicy, Any, Any]:
    torch.manual_seed(seed)
    policy = get_policy_class("flow_vla")(config)
    for name, parameter in policy.named_parameters():
        if awake and "modulation" in name:  # zero when new: nothing of the layer would be seen
            torch.nn.init.normal_(parameter, std=0.1)
    return (policy, *make_pre_post_processors(config, dataset_stats=unit_stats()))


def generators(*seeds: int) -> list[torch.Generator]:
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def chunk_noise(config: FlowVlaConfig, size: int = 4, seed: int = 0) -> Tensor:
    return torch.randn(size, config.chunk_size, contract.ACTION_SIZE, generator=generators(seed)[0])


def check_variant(config: FlowVlaConfig) -> None:
    policy, preprocess, postprocess = build(config)
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
    assert policy.sample(batch).shape == (4, config.chunk_size, contract.ACTION_SIZE)
    assert torch.isfinite(postprocess(chunk)).all()
    assert config.action_delta_indices == list(range(config.chunk_size))
    assert config.observation_delta_indices is None
