"""The policy `flow_vla`: variants, loss, learning, sampling, its fields and its YAML files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import draccus
import numpy as np
import pytest
import torch
import yaml
from flow_vla_support import build, check_variant, chunk_noise, tiny_config, write_pretrained
from lerobot.configs import PreTrainedConfig
from policy_support import (
    INSTRUCTIONS,
    batch_for,
    check_wrong_features_and_batches_are_explained,
    generators,
    with_features,
)

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.modeling_flow_vla import FlowVlaPolicy

PRESETS = sorted((Path(__file__).parents[2] / "configs/policies").glob("flow_vla*.yaml"))

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "adaptive norms": {"time_conditioning": "adaptive_norm"},
    "all of the state": {"state_indices": None, "state_clip": None},
    "uncropped": {"crop_fraction": 1.0},
    "several draws": {"noise_draws": 3},
    "unmasked": {"mask_padded_actions": False},
    "one layer": {"prefix_depth": 1, "vision_layers": 0},
    "odd image size": {"image_size": (18, 22)},
    "bfloat16 vision": {"freeze_vision": True, "frozen_dtype": "bfloat16"},
    "all frozen": {"freeze_vision": True, "freeze_language": True, "frozen_dtype": "bfloat16"},
}


@pytest.mark.parametrize("overrides", VARIANTS.values(), ids=VARIANTS.keys())
def test_variant_trains_and_predicts(overrides: dict[str, Any]) -> None:
    check_variant(tiny_config(**overrides))


def test_mixed_precision_trains_and_keeps_the_loss_in_float32() -> None:
    policy, preprocess, _ = build(tiny_config())
    batch = preprocess(batch_for(policy.config))
    with torch.autocast("cpu", torch.bfloat16):
        loss, _ = policy.train()(batch)
        chunk = policy.predict_action_chunk(batch)
    loss.backward()
    assert loss.dtype == chunk.dtype == torch.float32
    assert all(torch.isfinite(p.grad).all() for p in policy.parameters() if p.grad is not None)


def test_uint8_and_float_images_and_a_time_axis_are_the_same() -> None:
    config = tiny_config()
    policy, preprocess, _ = build(config)
    noise = chunk_noise(config)
    a, b = (preprocess(batch_for(config, uint8=uint8)) for uint8 in (True, False))
    observed = (*contract.IMAGE_KEYS, contract.STATE_KEY)
    c = {**a, **{key: a[key].unsqueeze(1) for key in observed}}
    expected = policy.predict_action_chunk(a, noise=noise)
    torch.testing.assert_close(policy.predict_action_chunk(b, noise=noise), expected)
    assert torch.equal(policy.predict_action_chunk(c, noise=noise), expected)


def test_training_times_follow_the_beta_distribution() -> None:
    policy, _, _ = build(tiny_config())
    times = policy.sample_times(20_000, generators(0)[0]).numpy()
    assert times.min() >= 1e-3
    assert times.max() <= 1.0
    u = (times - 1e-3) / 0.999
    # P(u < x) = x^1.5 for Beta(1.5, 1); the Kolmogorov-Smirnov bound for p = 0.001.
    distance = np.abs(np.sort(u) ** 1.5 - (np.arange(len(u)) + 0.5) / len(u)).max()
    assert distance < 1.95 / math.sqrt(len(u))
    assert torch.equal(policy.sample_times(9, generators(5)[0]), policy.sample_times(9, generators(5)[0]))


@pytest.mark.parametrize("key", [*contract.IMAGE_KEYS, contract.STATE_KEY])
def test_every_observation_matters(key: str) -> None:
    policy, preprocess, _ = build(tiny_config())
    batch = preprocess(batch_for(policy.config))
    noise = chunk_noise(policy.config)
    changed = {**batch, key: batch[key].flip(0)}
    assert (policy.sample(changed, noise=noise) - policy.sample(batch, noise=noise)).abs().max() > 1e-4


def test_the_base_pose_does_not_enter() -> None:
    policy, preprocess, _ = build(tiny_config())
    batch = preprocess(batch_for(policy.config))
    noise = chunk_noise(policy.config)
    state = batch[contract.STATE_KEY].clone()
    state[:, [0, 1, 2, 3, 4, 5, 6]] += 1.0
    same = policy.sample({**batch, contract.STATE_KEY: state}, noise=noise)
    assert torch.equal(same, policy.sample(batch, noise=noise))


def test_loss_is_that_of_the_velocity() -> None:
    policy, preprocess, _ = build(tiny_config())
    policy.eval()
    batch = preprocess(batch_for(policy.config))
    noise, times = chunk_noise(policy.config), torch.tensor([0.2, 0.4, 0.9, 1.0])
    t = times[:, None, None]
    actions = batch["action"].float()
    noisy = t * noise + (1 - t) * actions
    expected = policy.velocity(policy._state(batch), noisy, times, policy.prefix(batch)) - (noise - actions)
    each, _ = policy(batch, reduction="none", noise=noise, times=times)
    torch.testing.assert_close(each, expected.square().mean(dim=(1, 2)))


@pytest.mark.parametrize("masked", [True, False])
def test_padded_actions_in_the_loss(masked: bool) -> None:
    policy, preprocess, _ = build(tiny_config(mask_padded_actions=masked))
    policy.eval()
    raw = batch_for(policy.config)
    noise, times = chunk_noise(policy.config), torch.tensor([0.2, 0.4, 0.9, 1.0])
    whole, _ = policy(preprocess(dict(raw)), reduction="none", noise=noise, times=times)
    raw["action_is_pad"][1, 3:] = True
    raw["action_is_pad"][2] = True
    padded, _ = policy(preprocess(dict(raw)), reduction="none", noise=noise, times=times)
    assert torch.equal(padded[[0, 3]], whole[[0, 3]])
    assert (padded[1] == whole[1]) == (not masked)
    assert (padded[2] == 0) == masked


def two_episodes(config: FlowVlaConfig, length: int = 8) -> dict[str, Any]:
    """All frames of two episodes as one batch, with smooth states and actions, padded at the ends."""
    rng = np.random.default_rng(0)
    batch = batch_for(config, size=2 * length, pixels=16)
    actions = np.cumsum(rng.normal(0, 0.4, (2, length, contract.ACTION_SIZE)), axis=1)
    index = np.arange(length)[:, None] + np.arange(config.chunk_size)
    chunks = actions[:, index.clip(max=length - 1)].reshape(2 * length, config.chunk_size, -1)
    batch[contract.ACTION_KEY] = torch.from_numpy(chunks / np.abs(chunks).max())
    batch[contract.STATE_KEY] = torch.from_numpy(
        np.cumsum(rng.normal(0, 0.4, (2, length, contract.STATE_SIZE)), axis=1).reshape(2 * length, -1)
    )
    batch["action_is_pad"] = torch.from_numpy(np.tile(index >= length, (2, 1)))
    batch["task"] = [INSTRUCTIONS[i // length] for i in range(2 * length)]
    return batch


@pytest.mark.costly
@pytest.mark.parametrize("time_conditioning", ["mlp", pytest.param("adaptive_norm", marks=pytest.mark.slow)])
def test_overfits_two_episodes(time_conditioning: str) -> None:
    config = tiny_config(
        time_conditioning=time_conditioning,
        expert_width=64,
        crop_fraction=1.0,
        noise_draws=4,
        num_inference_steps=10,
    )
    policy, preprocess, postprocess = build(config, awake=False)
    raw = two_episodes(config)
    batch = preprocess(dict(raw))
    size = len(raw["task"]) * config.noise_draws
    noise, times = chunk_noise(config, size, seed=9), policy.sample_times(size, generators(9)[0])

    def held_noise_loss() -> float:
        with torch.no_grad():
            return float(policy.eval()(batch, noise=noise, times=times)[0])

    before, steps = held_noise_loss(), 150
    optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=6e-3, betas=(0.9, 0.95))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, max_lr=6e-3, total_steps=steps)
    generator = generators(0)[0]
    for _ in range(steps):
        loss, _ = policy.train()(batch, generator=generator)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    after = held_noise_loss()
    assert after < 0.05 * before
    wanted = raw["action"][:, : config.n_action_steps].float()
    counts = ~raw["action_is_pad"][:, : config.n_action_steps]
    error = (postprocess(policy.predict_action_chunk(batch, generator=generator)) - wanted)[counts]
    assert error.abs().mean() < 0.35 * wanted[counts].abs().mean()


def test_actions_depend_on_the_samples_generator_and_not_on_its_batch() -> None:
    config = tiny_config()
    policy, preprocess, _ = build(config)
    batch = preprocess(batch_for(config))
    together = policy.predict_action_chunk(batch, generator=generators(1, 2, 3, 4))
    assert not torch.equal(together, policy.predict_action_chunk(batch, generator=generators(1, 2, 3, 5)))
    torch.manual_seed(123)  # the global generator has no part in it
    for i in range(4):
        one = {k: v[i : i + 1] for k, v in batch.items() if k.startswith("observation.")}
        alone = policy.predict_action_chunk(one, generator=generators(i + 1))
        torch.testing.assert_close(alone[0], together[i], atol=1e-5, rtol=1e-4)
    with pytest.raises(UserError, match="noise of shape"):
        policy.predict_action_chunk(batch, noise=chunk_noise(config)[:2])


def test_a_generator_decides_all_of_a_training_step() -> None:
    policy, preprocess, _ = build(tiny_config(noise_draws=2))
    batch = preprocess(batch_for(policy.config))
    policy.train()
    losses = []
    for seed, outer in ((1, 0), (1, 99), (2, 0)):
        torch.manual_seed(outer)
        losses.append(policy(batch, generator=generators(seed)[0])[0].item())
    assert losses[0] == losses[1] != losses[2]


@pytest.mark.parametrize("n_action_steps", [1, 4, 6])
def test_select_action_steps_through_chunks(n_action_steps: int) -> None:
    config = tiny_config(n_action_steps=n_action_steps)
    policy, preprocess, _ = build(config)
    steps = [
        preprocess({k: v for k, v in batch_for(config, size=2, seed=t).items() if not k.startswith("action")})
        for t in range(9)
    ]
    noise = chunk_noise(config, 2)
    policy.reset()
    for t, step in enumerate(steps):
        start = t // n_action_steps * n_action_steps
        assert policy.needs_observation == (t == start)
        chosen = policy.select_action(step if t == start else {}, noise=noise)
        chunk = policy.predict_action_chunk(steps[start], noise=noise)
        assert torch.equal(chosen, chunk[:, t - start])
    policy.reset()
    assert policy.needs_observation


def preset(path: Path) -> FlowVlaConfig:
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert values["type"] == "flow_vla"
    return with_features(draccus.decode(PreTrainedConfig, {**values, "device": "cpu"}), contract.IMAGE_SIZE)


def test_there_are_presets() -> None:
    assert {path.stem for path in PRESETS} >= {
        "flow_vla_compact", "flow_vla_demo", "flow_vla_smolvlm", "flow_vla_paligemma",
    }  # fmt: skip


@pytest.mark.parametrize("path", PRESETS, ids=lambda p: p.stem)
def test_preset_builds(path: Path, tmp_path: Path) -> None:
    config = preset(path)
    if config.prefix == "pretrained":  # the weights are not here: a small model of the same classes
        kind = "paligemma" if "paligemma" in config.prefix_path else "smolvlm"
        config.prefix_path, config.prefix_layers = str(write_pretrained(tmp_path, kind)), None
        config.image_size = None
        policy = FlowVlaPolicy(config)
    else:
        with torch.device("meta"):
            policy = FlowVlaPolicy(config)
    assert sum(p.numel() for p in policy.parameters()) > 0
    assert config.get_optimizer_preset().lr == config.optimizer_lr
    assert config.get_scheduler_preset().num_warmup_steps == config.scheduler_warmup_steps


def test_optimiser_groups_hold_every_trained_parameter_once() -> None:
    policy, _, _ = build(tiny_config(freeze_vision=True))
    groups = policy.get_optim_params()
    held = [id(p) for group in groups for p in group["params"]]
    assert sorted(held) == sorted(id(p) for p in policy.parameters() if p.requires_grad)
    assert [group.get("weight_decay") for group in groups] == [None, 0.0]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"prefix": "pretraned"}, "Did you mean 'pretrained'"),
        ({"time_conditioning": "adaptive"}, "Did you mean 'adaptive_norm'"),
        ({"frozen_dtype": "float16"}, "or 'float32'"),
        ({"frozen_dtype": "bfloat16"}, "nothing is frozen"),
        ({"n_action_steps": 7}, "only 6 actions are predicted"),
        ({"n_obs_steps": 2}, "sees one observation"),
        ({"num_inference_steps": 0}, "expected at least 1"),
        ({"expert_width": 15}, "expected an even number"),
        ({"crop_fraction": 1.5}, "crop_fraction is 1.5"),
        ({"time_alpha": 0.0}, "time_alpha is 0.0"),
        ({"time_min_period": 5.0}, "time_min_period is 5.0"),
        ({"prefix_heads": 3}, "multiple of prefix_kv_heads"),
        ({"prefix_width": 18}, "multiple of prefix_heads"),
        ({"prefix_head_dim": 7}, "prefix_head_dim is 7"),
        ({"vision_channels": [12]}, "multiples of 8"),
    ],
)
def test_wrong_fields_are_explained(overrides: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        tiny_config(**overrides)


def test_wrong_features_and_batches_are_explained() -> None:
    check_wrong_features_and_batches_are_explained(FlowVlaPolicy, FlowVlaConfig, tiny_config)
