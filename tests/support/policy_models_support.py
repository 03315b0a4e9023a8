"""Tiny models with random weights in the formats of the hub, for policies that load one; and policies small enough."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import policy_support
import torch
from flow_vla_support import TINY, write_pretrained

WORDS = [
    "[UNK]",
    "[PAD]",
    "<s>",
    "</s>",
    "open",
    "close",
    "the",
    "left",
    "drawer",
    ".",
    "<image>",
    "<fake>",
    "<global>",
]


def write_tokenizer(folder: Path, **special: str) -> Any:
    from tokenizers import Tokenizer, models, pre_tokenizers, processors
    from transformers import PreTrainedTokenizerFast

    tokenizer = Tokenizer(models.WordLevel({word: i for i, word in enumerate(WORDS)}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    tokenizer.post_processor = processors.TemplateProcessing("<s> $A </s>", special_tokens=[("<s>", 2), ("</s>", 3)])
    out = PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, unk_token="[UNK]", pad_token="[PAD]", bos_token="<s>", eos_token="</s>", **special
    )
    out.save_pretrained(folder)
    return out


def write_clip(folder: Path) -> Path:
    """A CLIP for pictures of 32x32; LeRobot wants 'clip' in the folder's name."""
    from transformers import CLIPConfig, CLIPModel

    torch.manual_seed(0)
    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    vision = {**small, "image_size": 32, "patch_size": 16, "projection_dim": 8}
    text = {**small, "vocab_size": len(WORDS), "max_position_embeddings": 77, "projection_dim": 8}
    text |= {"pad_token_id": 1, "bos_token_id": 2, "eos_token_id": 3}
    CLIPModel(CLIPConfig(text_config=text, vision_config=vision, projection_dim=8)).save_pretrained(folder)
    write_tokenizer(folder)
    return folder


def write_smolvlm(folder: Path) -> Path:
    """A SmolVLM for pictures of 32x32 with the processor that LeRobot's SmolVLA loads beside it."""
    from transformers import (
        SmolVLMConfig,
        SmolVLMForConditionalGeneration,
        SmolVLMImageProcessor,
        SmolVLMProcessor,
        SmolVLMVideoProcessor,
    )

    torch.manual_seed(0)
    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 2, "num_attention_heads": 2}
    config = SmolVLMConfig(
        text_config={
            "model_type": "llama", "vocab_size": 32, "num_key_value_heads": 1, "head_dim": 8, "pad_token_id": 1,
            **small,
        },
        vision_config={"model_type": "smolvlm_vision", "image_size": 32, "patch_size": 8, **small},
        scale_factor=2,
        image_token_id=10,
        pad_token_id=1,
    )  # fmt: skip
    SmolVLMForConditionalGeneration(config).save_pretrained(folder)
    special = {"image_token": "<image>", "fake_image_token": "<fake>", "global_image_token": "<global>"}
    tokenizer = write_tokenizer(folder, extra_special_tokens=special)
    SmolVLMProcessor(SmolVLMImageProcessor(), tokenizer, SmolVLMVideoProcessor()).save_pretrained(folder)
    return folder


def florence_config() -> dict[str, Any]:
    """Sizes of a small Florence-2."""
    one = {"embed_dim": [8, 8], "num_heads": [1, 1], "num_groups": [1, 1], "depths": [1, 1], "window_size": 2}
    vision = {"patch_size": [7, 3], "patch_stride": [4, 2], "patch_padding": [3, 1], "patch_prenorm": [False, True]}
    text = {"d_model": 16, "encoder_layers": 1, "decoder_layers": 1, "encoder_ffn_dim": 16, "decoder_ffn_dim": 16}
    text |= {
        "encoder_attention_heads": 2,
        "decoder_attention_heads": 2,
        "vocab_size": 32,
        "max_position_embeddings": 64,
    }
    return {
        "vision_config": {**one, **vision, "projection_dim": 16},
        "text_config": {"model_type": "bart", **text},
        "image_token_id": 10,
    }


def tiny_settings(kind: str, folder: Path) -> dict[str, Any]:
    """What makes a policy type small enough for a test, with models written to `folder` where it loads one."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "act":
        return {
            "chunk_size": 4, "n_action_steps": 4, "dim_model": 16, "n_heads": 2, "dim_feedforward": 16,
            "n_encoder_layers": 1, "latent_dim": 4, "n_vae_encoder_layers": 1,
        }  # fmt: skip
    if kind == "diffusion":
        return {
            "down_dims": [8, 16], "n_groups": 4, "diffusion_step_embed_dim": 8, "spatial_softmax_num_keypoints": 4,
            "horizon": 8, "n_action_steps": 4, "resize_shape": [64, 64], "num_inference_steps": 2,
            "use_separate_rgb_encoder_per_camera": False,
        }  # fmt: skip
    if kind == "multi_task_dit":
        clip = str(write_clip(folder / "clip_tiny"))
        return {
            "vision_encoder_name": clip, "text_encoder_name": clip, "horizon": 8, "n_action_steps": 4,
            "hidden_dim": 16, "num_layers": 1, "num_heads": 2, "timestep_embed_dim": 8, "image_crop_shape": [32, 32],
            "num_inference_steps": 2,
        }  # fmt: skip
    if kind == "smolvla":
        return {
            "vlm_model_name": str(write_smolvlm(folder / "smolvlm")), "chunk_size": 4, "n_action_steps": 4,
            "num_vlm_layers": 2, "resize_imgs_with_padding": [32, 32], "tokenizer_max_length": 12, "num_steps": 2,
        }  # fmt: skip
    if kind == "xvla":
        write_tokenizer(folder / "tokenizer")
        return {
            "florence_config": florence_config(), "tokenizer_name": str(folder / "tokenizer"), "chunk_size": 4,
            "n_action_steps": 4, "hidden_size": 16, "depth": 1, "num_heads": 2, "dim_time": 8, "len_soft_prompts": 2,
            "num_domains": 2, "tokenizer_max_length": 12, "resize_imgs_with_padding": [32, 32],
            "num_denoising_steps": 2,
        }  # fmt: skip
    if kind == "diffusion_transformer":
        return {name: value for name, value in policy_support.TINY.items() if name != "device"}
    if kind.startswith("flow_vla"):
        tiny = {**TINY, "image_size": list(TINY["image_size"])}
        del tiny["device"]
        if kind == "flow_vla":
            return tiny
        model = str(write_pretrained(folder / kind, kind.removeprefix("flow_vla_")))
        return {**tiny, "prefix": "pretrained", "prefix_path": model, "image_size": None, "freeze_vision": True}
    raise AssertionError(kind)
