"""The presets of `diffusion_transformer`: the published one against the published numbers, and overfitting."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import draccus
import numpy as np
import pytest
import torch
import yaml
from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.policies.factory import make_pre_post_processors
from policy_support import batch_for, tiny_config, unit_stats, with_features
from torch import nn

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.policies.common.vision import ResNet18
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)
from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import DiffusionTransformerPolicy
from robocasa_lerobot.training.config.phase import EmaConfig
from robocasa_lerobot.training.setup.builders import set_windows

PRESETS = sorted((Path(__file__).parents[2] / "configs/policies").glob("diffusion_transformer*.yaml"))


def preset(path: Path) -> DiffusionTransformerConfig:
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert values["type"] == "diffusion_transformer"
    return with_features(draccus.decode(PreTrainedConfig, {**values, "device": "cpu"}), contract.IMAGE_SIZE)


def test_there_are_presets() -> None:
    assert {path.stem.removeprefix("diffusion_transformer_") for path in PRESETS} >= {"benchmark", "compact", "demo"}


@pytest.mark.parametrize("path", PRESETS, ids=lambda p: p.stem)
def test_preset_builds(path: Path) -> None:
    config = preset(path)
    config.text_encoder = "token"  # the weights of CLIP are not here; its own tests use a small one
    with torch.device("meta"):
        policy = DiffusionTransformerPolicy(config)
    assert sum(p.numel() for p in policy.parameters()) > 0
    assert config.get_optimizer_preset().lr == config.optimizer_lr
    assert config.get_scheduler_preset().num_warmup_steps == config.scheduler_warmup_steps


def benchmark_preset(**overrides: Any) -> DiffusionTransformerConfig:
    """The published settings; CLIP ViT-L/14, whose weights are not here, is stood in for by a vector of its size."""
    config = preset(next(path for path in PRESETS if path.stem.endswith("benchmark")))
    assert (config.text_encoder, config.clip_path) == ("clip", "openai/clip-vit-large-patch14")
    return dataclasses.replace(config, text_encoder="token", language_dim=768, **overrides)


def test_benchmark_preset_has_the_published_size() -> None:
    """Counted by hand from the published structure, with the 106 M of its checkpoint as the sum."""
    config = benchmark_preset()
    with torch.device("meta"):
        policy = DiffusionTransformerPolicy(config)

    def count(module: nn.Module) -> int:
        return sum(p.numel() for p in module.parameters())

    channels = (64, 64, 128, 128, 256, 256, 512, 512)
    encoders = policy.observation_encoder.vision
    assert len(encoders) == 3
    for encoder in encoders.values():
        assert isinstance(encoder.backbone, ResNet18)
        film = sum(count(block.film) for block in encoder.backbone.blocks)
        assert film == sum((768 + 1) * 2 * c for c in channels)
        # torchvision's ResNet-18 has 11,689,512, of which 513,000 are its classifier; norms have as many either way.
        assert count(encoder.backbone) - film == 11_689_512 - 513_000
        assert count(encoder.pool) == 512 * 32 + 32
        assert count(encoder.project) == 64 * 64 + 64
        norms = [m for m in encoder.modules() if isinstance(m, nn.GroupNorm)]
        assert all(m.num_groups == m.num_channels // 16 for m in norms)
        assert len(norms) == 1 + 2 * 8 + 3  # stem, two in each block, three shortcuts with a stride
    d = 512
    attention, feed_forward, norm = 4 * d * (d + 1), 4 * d * (d + 1) + d * (4 * d + 1), 2 * d
    denoiser = policy.denoiser
    assert [count(layer) for layer in denoiser.condition_encoder.layers] == 4 * [attention + feed_forward + 2 * norm]
    assert [count(layer) for layer in denoiser.decoder.layers] == 12 * [2 * attention + feed_forward + 3 * norm]
    assert policy.observation_encoder.feature_dim == 3 * 64 + 3 + 4 + 2 + 768
    assert count(denoiser.embed_observation) == (969 + 1) * d
    assert count(denoiser.embed_action) == (12 + 1) * d
    assert count(denoiser.head) == (d + 1) * 12
    assert count(encoders) == 42_450_144
    assert count(denoiser) == 63_575_052
    assert count(encoders) + count(denoiser) == pytest.approx(106e6, rel=0.001)


def test_benchmark_preset_has_the_published_structure() -> None:
    # Narrower, as it is really run here; everything else is as published.
    config = benchmark_preset(width=32)
    torch.manual_seed(0)
    policy = DiffusionTransformerPolicy(config).eval()
    denoiser = policy.denoiser
    layers = [*denoiser.decoder.layers, *denoiser.condition_encoder.layers]
    assert len(layers) == 12 + 4
    for layer in layers:
        assert layer.norm_first
        assert layer.self_attn.num_heads == 8
        assert layer.linear1.out_features == 4 * 32
        assert layer.dropout.p == 0.3
        assert layer.activation is nn.functional.gelu
    assert denoiser.dropout.p == 0.0
    assert denoiser.condition_position.shape == (1, 3, 32)
    assert denoiser.action_position.shape == (1, 10, 32)
    assert (~denoiser.causal_mask).int().tolist() == [[int(j <= i) for j in range(10)] for i in range(10)]
    # The first action sees the time and the earlier observation, all others everything.
    assert (~denoiser.memory_mask).int().tolist() == [[1, 1, 0], *[[1, 1, 1]] * 9]
    seen: list[torch.Size] = []
    for encoder in policy.observation_encoder.vision.values():
        encoder.register_forward_hook(lambda _m, inputs, _out: seen.append(inputs[0].shape))
    preprocess, _ = make_pre_post_processors(config, dataset_stats=unit_stats())
    batch = preprocess(batch_for(config, size=1, pixels=contract.IMAGE_SIZE))
    with torch.no_grad():
        assert policy.observation_encoder(batch).shape == (1, 2, 969)
        loss, _ = policy(batch)
    assert torch.isfinite(loss)
    assert set(seen) == {torch.Size((2, 3, 224, 224))}


def test_benchmark_preset_is_trained_and_sampled_as_published() -> None:
    config = benchmark_preset()
    assert (config.n_obs_steps, config.horizon, config.n_action_steps) == (2, 10, 8)
    assert config.action_delta_indices == list(range(-1, 9))
    assert config.drop_n_last_frames == 0
    with torch.device("meta"):
        policy = DiffusionTransformerPolicy(config)
    groups = policy.get_optim_params()
    assert [group.get("weight_decay") for group in groups] == [None, 0.0, 1e-6]
    assert sum(p.numel() for group in groups for p in group["params"]) == sum(p.numel() for p in policy.parameters())
    assert all(p.ndim == 2 for p in groups[0]["params"])
    optimizer = config.get_optimizer_preset()
    assert (optimizer.lr, optimizer.betas, optimizer.weight_decay) == (1e-4, (0.9, 0.95), 1e-3)
    assert optimizer.grad_clip_norm == 0.0
    schedule = config.get_scheduler_preset()
    assert (schedule.name, schedule.num_warmup_steps) == ("cosine", 1000)
    ema = EmaConfig()
    assert (ema.power, ema.inv_gamma, ema.min_decay, ema.max_decay) == (0.75, 1.0, 0.0, 0.9999)
    slow = policy.scheduler
    slow.set_timesteps(config.num_inference_steps)
    assert type(slow).__name__ == "DDPMScheduler"
    assert slow.timesteps.tolist() == list(range(99, -1, -1))
    published = {"beta_schedule": "squaredcos_cap_v2", "clip_sample": True, "prediction_type": "epsilon"}
    assert dict(slow.config) | published | {"variance_type": "fixed_small"} == dict(slow.config)
    with torch.device("meta"):
        fast = DiffusionTransformerPolicy(benchmark_preset(noise_scheduler="DDIM", num_inference_steps=8)).scheduler
    fast.set_timesteps(8)
    assert type(fast).__name__ == "DDIMScheduler"
    assert len(fast.timesteps) == 8


def test_published_quirks_are_options_and_off_by_default() -> None:
    published, default = benchmark_preset(), DiffusionTransformerConfig()
    assert (published.mask_padded_actions, default.mask_padded_actions) == (False, True)
    assert (published.language_film, default.language_film) == (True, True)
    assert (published.language_concat, default.language_concat) == (True, False)
    modes = [config.normalization_mapping["ACTION"].value for config in (published, default)]
    assert modes == ["IDENTITY", "MIN_MAX"]


def test_actions_are_normalised_as_the_option_says() -> None:
    raw = batch_for(tiny_config())
    stats = unit_stats()
    stats["action"] = {name: value / 2 for name, value in stats["action"].items()}  # within [-0.5, 0.5]
    for mode, factor in (("IDENTITY", 1.0), ("MIN_MAX", 2.0)):
        mapping = {name: NormalizationMode[value] for name, value in
                   (("VISUAL", "IDENTITY"), ("STATE", "MIN_MAX"), ("ACTION", mode))}  # fmt: skip
        preprocess, postprocess = make_pre_post_processors(
            tiny_config(normalization_mapping=mapping), dataset_stats=stats
        )
        action = preprocess(dict(raw))["action"]
        torch.testing.assert_close(action.double(), raw["action"] * factor, rtol=1e-5, atol=1e-5)
        torch.testing.assert_close(postprocess(action).double(), raw["action"], rtol=1e-5, atol=1e-5)


@pytest.mark.slow
def test_overfits_two_episodes_to_a_twentieth_of_the_initial_loss(tmp_path: Path) -> None:
    config = tiny_config(width=64, n_heads=4, crop_fraction=1.0, noise_draws=8, constant_range=1e-6)
    root = write_fake_dataset(tmp_path / "two", episodes=2, length=12)
    data = MixtureDataset(MixtureConfig([MemberConfig(str(root))]))
    set_windows(data, config)
    torch.manual_seed(0)
    policy = DiffusionTransformerPolicy(config)
    preprocess, _ = make_pre_post_processors(config, dataset_stats=data.statistics())
    batch = preprocess(data.batch(np.zeros(len(data), dtype=np.int64), np.arange(len(data))))
    optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=2e-3)
    steps = 800
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, max_lr=4e-3, total_steps=steps)
    generator = torch.Generator().manual_seed(0)

    def measured() -> float:
        with torch.no_grad():
            return float(policy.eval()(batch, generator=torch.Generator().manual_seed(1))[0])

    before = measured()
    for _ in range(steps):
        policy.train()
        loss, _ = policy(batch, generator=generator)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    assert measured() < 0.05 * before
