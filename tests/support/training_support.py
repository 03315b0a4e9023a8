"""What the tests of training share: tiny policies, an experiment of two phases, and what it leaves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
import yaml

from robocasa_lerobot.training.config.experiment import ExperimentConfig, load_experiment
from robocasa_lerobot.training.config.experiment_files import merge

ROOT = Path(__file__).parents[2]
TINY: dict[str, dict[str, Any]] = {
    "diffusion_transformer": {
        "vision_encoder": "convnet",
        "vision_shared": True,
        "vision_channels": [8, 16],
        "vision_keypoints": 8,
        "vision_features": 8,
        "language_dim": 8,
        "language_buckets": 64,
        "width": 16,
        "n_heads": 2,
        "n_decoder_layers": 1,
        "n_condition_layers": 1,
        "dropout": 0.1,
        "scheduler_warmup_steps": 2,
        "optimizer_lr": 1e-3,
    },
    "flow_vla": {
        "chunk_size": 4,
        "n_action_steps": 4,
        "image_size": [32, 32],
        "vision_channels": [8, 16],
        "vision_layers": 0,
        "prefix_width": 16,
        "prefix_depth": 1,
        "prefix_heads": 2,
        "prefix_kv_heads": 1,
        "prefix_head_dim": 8,
        "language_buckets": 64,
        "max_words": 8,
        "expert_width": 16,
        "optimizer_lr": 1e-3,
        "scheduler_warmup_steps": 2,
    },
    "act": {
        "chunk_size": 4,
        "n_action_steps": 4,
        "dim_model": 16,
        "n_heads": 2,
        "dim_feedforward": 16,
        "n_encoder_layers": 1,
        "latent_dim": 4,
        "n_vae_encoder_layers": 1,
        "pretrained_backbone_weights": None,
    },
    "diffusion": {
        "down_dims": [8, 16],
        "n_groups": 4,
        "diffusion_step_embed_dim": 8,
        "spatial_softmax_num_keypoints": 4,
        "horizon": 8,
        "n_action_steps": 4,
        "crop_ratio": 0.9,
        "resize_shape": [64, 64],
        "pretrained_backbone_weights": None,
    },
}


def experiment_file(folder: Path, data: Path, kind: str = "diffusion_transformer", **changes: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "name": "test",
        "output_dir": str(folder / "out"),
        "device": "cpu",
        "policy": {"type": kind, **TINY[kind]},
        "loader": {"cache_dir": str(data.parent / "frames")},
        "defaults": {"steps": 4, "batch_size": 4, "log_every": 1, "save_every": 2},
        "phases": [
            {"name": "pretrain", "mixture": {"members": [{"root": str(data)}]}, "save_initial": True},
            {
                "name": "finetune",
                "mixture": {"members": [{"root": str(data), "tasks": ["OpenDrawer"]}]},
                "statistics": "keep",
            },
        ],
    }
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(merge(content, changes)))
    return path


def tiny(
    folder: Path, data: Path, kind: str = "diffusion_transformer", overrides: Sequence[str] = ()
) -> ExperimentConfig:
    return load_experiment(experiment_file(folder, data, kind), overrides)


def metrics(folder: Path, phase: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "out" / phase / "metrics.jsonl").read_text().splitlines()]


def losses(folder: Path, phase: str) -> list[tuple[int, float, float]]:
    return [(line["step"], line["loss"], line["grad_norm"]) for line in metrics(folder, phase)]


def weights(folder: Path, phase: str, step: str = "last") -> dict[str, torch.Tensor]:
    from safetensors.torch import load_file

    return load_file(folder / "out" / phase / "checkpoints" / step / "pretrained_model" / "model.safetensors")
