"""Small configurations, batches and pretrained models of the policy `flow_vla`, for its tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import policy_support
import torch
from policy_support import INSTRUCTIONS, check_trains_and_predicts, generators, with_features
from torch import Tensor

from robocasa_lerobot import contract
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.modeling_flow_vla import FlowVlaPolicy

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


def tiny_config(**overrides: Any) -> FlowVlaConfig:
    return with_features(FlowVlaConfig(**{**TINY, **overrides}))


def pretrained_config(folder: Path, **overrides: Any) -> FlowVlaConfig:
    return tiny_config(**{"prefix": "pretrained", "prefix_path": str(folder), "image_size": None, **overrides})


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
    policy, preprocess, postprocess = policy_support.build(config, seed)
    for name, parameter in policy.named_parameters():
        if awake and "modulation" in name:  # zero when new: nothing of the layer would be seen
            torch.nn.init.normal_(parameter, std=0.1)
    return policy, preprocess, postprocess


def chunk_noise(config: FlowVlaConfig, size: int = 4, seed: int = 0) -> Tensor:
    return torch.randn(size, config.chunk_size, contract.ACTION_SIZE, generator=generators(seed)[0])


def check_variant(config: FlowVlaConfig) -> None:
    check_trains_and_predicts(*build(config), config.chunk_size)
    assert config.action_delta_indices == list(range(config.chunk_size))
    assert config.observation_delta_indices is None
