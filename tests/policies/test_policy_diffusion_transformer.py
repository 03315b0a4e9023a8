"""The policy `diffusion_transformer`: variants, masks, loss, sampling, checkpoints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import draccus
import numpy as np
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.configs.types import NormalizationMode
from lerobot.policies.factory import make_pre_post_processors
from policy_support import (
    batch_for,
    build,
    check_trains_and_predicts,
    check_wrong_features_and_batches_are_explained,
    generators,
    tiny_config,
)
from torch import nn

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.vision import ResNet18
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)
from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import DiffusionTransformerPolicy
from robocasa_lerobot.policies.diffusion_transformer.network import DenoisingTransformer, causal_mask, memory_mask
from robocasa_lerobot.training.setup import builders

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "one observation": {"n_obs_steps": 1, "horizon": 9},
    "three observations": {"n_obs_steps": 3, "horizon": 12, "n_action_steps": 4},
    "offsets": {"observation_offsets": [-6, -4, -2, 0], "horizon": 12, "n_action_steps": 4},
    "all of the state": {"state_indices": None, "state_clip": None},
    "encoder per camera": {"vision_shared": False},
    "concatenated language": {"language_concat": True},
    "language without FiLM": {"language_concat": True, "language_film": False},
    "resized": {"image_size": (24, 24)},
    "uncropped": {"crop_fraction": 1.0},
    "own crops": {"crop_shared_over_time": False},
    "DDPM": {"noise_scheduler": "DDPM", "num_inference_steps": None, "num_train_timesteps": 6},
    "DDIM leading": {"noise_scheduler": "DDIM", "timestep_spacing": "leading", "num_inference_steps": 8},
    "predicts actions": {"prediction_type": "sample"},
    "multi-layer perceptron": {"n_condition_layers": 0},
    "several draws": {"noise_draws": 3},
    "mostly noisy times": {"time_alpha": 3.0},
    "looks ahead": {"look_ahead": 30},
    "looks ahead less far than a chunk": {"look_ahead": 5, "noise_draws": 2},
    "unmasked": {"mask_padded_actions": False},
    "resnet18": {"vision_encoder": "resnet18"},
    "grid": {"vision_grid": 3},
    "coarse stem": {"vision_stem": 4, "image_size": (32, 32)},
    "resnet18 with a grid": {"vision_encoder": "resnet18", "vision_grid": 2},
}


@pytest.mark.parametrize("overrides", VARIANTS.values(), ids=VARIANTS.keys())
def test_variant_trains_and_predicts(overrides: dict[str, Any]) -> None:
    config = tiny_config(**overrides)
    check_trains_and_predicts(*build(config), config.horizon)
    assert len(config.observation_delta_indices) == config.n_obs_steps
    assert config.observation_delta_indices[-1] == 0
    assert config.action_delta_indices[config.n_obs_steps - 1] == 0


@pytest.mark.costly
@pytest.mark.parametrize("name", ["default", "encoder per camera", "resnet18", "grid", "multi-layer perceptron"])
def test_compiled_it_has_the_same_loss_and_gradients(name: str) -> None:
    """Translated in parts, each without a break: one would be a wait for the GPU in every step."""
    plain, preprocess, _ = build(tiny_config(**VARIANTS[name]))
    compiled, _, _ = build(tiny_config(**VARIANTS[name]))
    compiled.load_state_dict(plain.state_dict())
    torch._dynamo.reset()
    compiled.compile(backend="eager", fullgraph=True)
    batch, losses = preprocess(batch_for(plain.config)), []
    for policy in (plain, compiled):
        torch.manual_seed(0)
        loss, _ = policy.train()(batch)
        loss.backward()
        losses.append(loss.detach())
    torch.testing.assert_close(*losses)
    for (name, one), two in zip(plain.named_parameters(), compiled.parameters(), strict=True):
        torch.testing.assert_close(one.grad, two.grad, msg=name)
    assert plain.state_dict().keys() == compiled.state_dict().keys(), "a checkpoint knows nothing of it"


def test_mixed_precision_trains_and_keeps_the_loss_in_float32() -> None:
    policy, preprocess, _ = build(tiny_config())
    batch = preprocess(batch_for(policy.config))
    with torch.autocast("cpu", torch.bfloat16):
        loss, _ = policy.train()(batch)
        chunk = policy.predict_action_chunk(batch)
    loss.backward()
    assert loss.dtype == chunk.dtype == torch.float32
    assert all(torch.isfinite(p.grad).all() for p in policy.parameters() if p.grad is not None)


def test_uint8_and_float_images_are_the_same() -> None:
    config = tiny_config()
    policy, preprocess, _ = build(config)
    a, b = (preprocess(batch_for(config, uint8=uint8)) for uint8 in (True, False))
    (x,), (y,) = generators(1), generators(1)
    torch.testing.assert_close(policy.predict_action_chunk(a, generator=x), policy.predict_action_chunk(b, generator=y))


def test_a_single_observation_is_the_same_with_its_time_axis_and_without() -> None:
    config = tiny_config(n_obs_steps=1, horizon=9)
    policy, preprocess, _ = build(config)
    without = preprocess(batch_for(config))
    assert without[contract.IMAGE_KEYS[0]].ndim == 4, "as LeRobot's datasets give it"
    with_axis = {k: x.unsqueeze(1) if k in contract.IMAGE_KEYS else x for k, x in without.items()}
    (a,), (b,), (c,), (d,) = (generators(1) for _ in range(4))
    torch.testing.assert_close(policy(without, generator=a)[0], policy(with_axis, generator=b)[0], rtol=0, atol=0)
    chunks = (policy.predict_action_chunk(batch, generator=g) for batch, g in ((without, c), (with_axis, d)))
    torch.testing.assert_close(*chunks, rtol=0, atol=0)


def test_masks() -> None:
    horizon, conditions = 10, 3
    causal, memory = causal_mask(horizon), memory_mask(horizon, conditions)
    for i in range(horizon):
        assert [not blocked for blocked in causal[i]] == [j <= i for j in range(horizon)]
        assert [not blocked for blocked in memory[i]] == [i >= j - 1 for j in range(conditions)]


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_dropout_of_embeddings_is_of_training_alone(share: float) -> None:
    config = tiny_config(dropout=0.0, dropout_embedding=share)
    net = build(config)[0].denoiser
    times, features = torch.tensor([3]), torch.randn(1, config.n_obs_steps, net.embed_observation.in_features)
    x = torch.randn(1, config.horizon, contract.ACTION_SIZE)
    for training in (True, False):
        net.train(training)
        assert torch.equal(net.condition(times, features), net.condition(times, features)) == (
            not training or not share
        )
        assert torch.equal(net(x, times, features), net(x, times, features)) == (not training or not share)


def test_encoders_decay_and_rates_go_as_they_are_asked_to() -> None:
    config = tiny_config(optimizer_encoder_weight_decay=0.25, scheduler_name="constant_with_warmup")
    policy = build(config)[0]
    encoder = {id(parameter) for parameter in policy.observation_encoder.parameters() if parameter.requires_grad}
    decays = {group.get("weight_decay"): {id(one) for one in group["params"]} for group in policy.get_optim_params()}
    assert decays[0.25] == encoder
    assert not encoder & (decays[None] | decays[0.0])
    for name, last in (("constant_with_warmup", 1.0), ("cosine", 0.0)):
        optimizer = torch.optim.SGD([nn.Parameter(torch.zeros(1))], lr=1.0)
        preset = tiny_config(scheduler_name=name, scheduler_warmup_steps=2).get_scheduler_preset()
        rate = preset.build(optimizer, 10).lr_lambdas[0]
        assert [rate(1), rate(2), rate(10)] == pytest.approx([0.5, 1.0, last])


@pytest.mark.parametrize("n_obs_steps", [1, 2, 3])
def test_actions_see_neither_later_actions_nor_later_observations(n_obs_steps: int) -> None:
    torch.manual_seed(0)
    horizon = 6
    # Without condition layers no condition token sees another, so the memory mask alone decides.
    net = DenoisingTransformer(4, 5, horizon, n_obs_steps, 16, 2, 2, n_condition_layers=0, dropout=0.0).eval()
    x, features, times = torch.randn(1, horizon, 4), torch.randn(1, n_obs_steps, 5), torch.tensor([3])
    before = net(x, times, features)
    for changed in range(horizon):
        y = x.clone()
        y[:, changed] += 1.0
        moved = (net(y, times, features) != before).any(dim=-1)[0].tolist()
        assert moved == [i >= changed for i in range(horizon)]
    for changed in range(n_obs_steps):
        f = features.clone()
        f[:, changed] += 1.0
        moved = (net(x, times, f) != before).any(dim=-1)[0].tolist()
        assert moved == [i >= changed for i in range(horizon)]
    assert (net(x, torch.tensor([4]), features) != before).any(dim=-1).all()


def test_film_modulates_each_of_the_eight_blocks() -> None:
    net = ResNet18(condition_dim=12)
    assert [block.film.to_shift_and_scale.out_features // 2 for block in net.blocks] == [
        64, 64, 128, 128, 256, 256, 512, 512,
    ]  # fmt: skip
    images, condition = torch.rand(1, 3, 64, 64), torch.rand(1, 12)
    outputs: list[torch.Tensor] = []
    hooks = [block.register_forward_hook(lambda _m, _i, out: outputs.append(out)) for block in net.blocks]
    net(images, condition)
    for i, block in enumerate(net.blocks):
        reference, state = outputs[i], block.film.to_shift_and_scale.weight.data.clone()
        block.film.to_shift_and_scale.weight.data += 0.1
        outputs.clear()
        net(images, condition)
        assert not torch.equal(outputs[i], reference)
        assert (outputs[i] >= 0).all()  # a ReLU follows the modulation
        block.film.to_shift_and_scale.weight.data = state
        outputs.clear()
        net(images, condition)
    for hook in hooks:
        hook.remove()
    assert not any(isinstance(m, nn.BatchNorm2d) for m in net.modules())


@pytest.mark.parametrize("masked", [True, False])
def test_padded_actions_in_the_loss(masked: bool) -> None:
    config = tiny_config(mask_padded_actions=masked)
    policy, preprocess, _ = build(config)
    policy.eval()
    padded = batch_for(config)
    padded["action_is_pad"][:, 7:] = True
    padded["action_is_pad"][:, 0] = True
    changed = {**padded, "action": padded["action"].clone()}
    changed["action"][padded["action_is_pad"]] = 0.123
    noise = torch.randn(4, config.horizon, contract.ACTION_SIZE, generator=generators(0)[0])
    times = torch.tensor([5, 50, 80, 99])
    # Causality would let padded actions reach later ones only; compare where the denoiser's input is the same.
    clean, _ = policy(preprocess(dict(padded)), noise=noise, times=times)
    whole, _ = policy(
        preprocess({**padded, "action_is_pad": torch.zeros(4, 10, dtype=torch.bool)}), noise=noise, times=times
    )
    assert (clean == whole) == (not masked)
    last_only = {**padded, "action": padded["action"].clone()}
    last_only["action"][:, 7:] = 0.123  # behind all that counts, so that only the loss can see it
    other, _ = policy(preprocess(last_only), noise=noise, times=times)
    assert (clean == other) == masked
    assert not torch.equal(changed["action"], padded["action"])


def test_sample_without_any_valid_action_counts_nothing() -> None:
    config = tiny_config()
    policy, preprocess, _ = build(config)
    batch = batch_for(config)
    batch["action_is_pad"][1] = True
    losses, _ = policy(preprocess(batch), reduction="none")
    assert losses[1] == 0
    assert (losses[[0, 2, 3]] > 0).all()


@pytest.mark.parametrize(("prediction_type", "steps", "share"), [("sample", 120, 0.1), ("epsilon", 200, 0.5)])
def test_overfits_one_batch(prediction_type: str, steps: int, share: float) -> None:
    config = tiny_config(
        prediction_type=prediction_type, width=64, n_heads=4, num_inference_steps=10, crop_fraction=1.0, noise_draws=4
    )
    policy, preprocess, postprocess = build(config)
    raw = batch_for(config)
    raw["action"] = raw["action"] * 0.8
    batch = preprocess(dict(raw))
    optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=3e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, max_lr=3e-3, total_steps=steps)
    generator = generators(0)[0]
    policy.train()
    losses = []
    for _ in range(steps):
        loss, _ = policy(batch, generator=generator)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
    assert np.mean(losses[80:100]) < 0.5 * np.mean(losses[:5])
    assert np.mean(losses[-20:]) < 0.2 * np.mean(losses[:5])
    wanted = raw["action"][:, 1 : 1 + config.n_action_steps].float()
    error = (postprocess(policy.predict_action_chunk(batch, generator=generator)) - wanted).abs().mean()
    untrained = (postprocess(build(config)[0].predict_action_chunk(batch, generator=generator)) - wanted).abs().mean()
    assert error < share * untrained
    # Instructions matter: with those of the neighbours something else comes out.
    swapped = preprocess({**raw, "task": raw["task"][::-1]})
    a, b = (policy.predict_action_chunk(x, generator=generators(1)[0]) for x in (batch, swapped))
    assert not torch.equal(a, b)


def test_loss_draws_from_the_generator_that_is_passed_in() -> None:
    policy, preprocess, _ = build(tiny_config())  # no dropout; crops, times and noise are what is random
    batch = preprocess(batch_for(policy.config))
    losses = []
    for global_seed, seed in ((1, 7), (2, 7), (2, 8)):
        torch.manual_seed(global_seed)
        losses.append(policy.train()(batch, generator=generators(seed)[0])[0].item())
    assert losses[0] == losses[1] != losses[2]


@pytest.mark.parametrize("scheduler", ["DDPM", "DDIM"])
def test_saved_and_loaded_policy_gives_the_same_actions(scheduler: str, tmp_path: Path) -> None:
    config = tiny_config(noise_scheduler=scheduler, image_size=(24, 24))
    policy, preprocess, postprocess = build(config)
    policy.save_pretrained(tmp_path)
    preprocess.save_pretrained(tmp_path)
    postprocess.save_pretrained(tmp_path)
    loaded_config = PreTrainedConfig.from_pretrained(tmp_path)
    assert loaded_config.type == "diffusion_transformer"
    assert draccus.encode(loaded_config) == draccus.encode(config)
    loaded = DiffusionTransformerPolicy.from_pretrained(tmp_path)
    pre, post = make_pre_post_processors(loaded_config, pretrained_path=str(tmp_path))
    raw = batch_for(config)
    before = postprocess(policy.predict_action_chunk(preprocess(dict(raw)), generator=generators(1, 2, 3, 4)))
    after = post(loaded.predict_action_chunk(pre(dict(raw)), generator=generators(1, 2, 3, 4)))
    assert torch.equal(before, after)


def test_frames_to_drop_follow_from_the_lengths_of_a_later_phase(tmp_path: Path) -> None:
    """Unless they were said, they are those of each phase: config.json does not hold what followed in one before."""
    tiny_config(horizon=10, n_action_steps=8).save_pretrained(tmp_path / "followed")
    tiny_config(horizon=10, n_action_steps=8, drop_n_last_frames=0).save_pretrained(tmp_path / "said")
    for name, wanted in (("followed", {8: 1, 4: 5}), ("said", {8: 0, 4: 0})):
        for steps, dropped in wanted.items():
            config: Any = builders.policy_config({"n_action_steps": steps}, tmp_path / name, "cpu")
            assert config.drop_n_last_frames == dropped


@pytest.mark.parametrize("scheduler", ["DDPM", "DDIM"])
def test_actions_depend_on_the_samples_generator_and_not_on_its_batch(scheduler: str) -> None:
    config = tiny_config(noise_scheduler=scheduler)
    policy, preprocess, _ = build(config)
    batch = preprocess(batch_for(config))
    together = policy.predict_action_chunk(batch, generator=generators(1, 2, 3, 4))
    torch.manual_seed(123)  # the global generator has no part in it
    for i in range(4):
        one = {k: v[i : i + 1] for k, v in batch.items() if k.startswith("observation.")}
        alone = policy.predict_action_chunk(one, generator=generators(i + 1))
        torch.testing.assert_close(alone[0], together[i])
    noise = torch.randn(4, config.horizon, contract.ACTION_SIZE)
    if scheduler == "DDIM":
        assert torch.equal(*(policy.predict_action_chunk(batch, noise=noise) for _ in range(2)))
    with pytest.raises(UserError, match="noise of shape"):
        policy.predict_action_chunk(batch, noise=noise[:2])


@pytest.mark.parametrize(
    ("offsets", "n_action_steps"),
    [([0], 1), ([0], 4), ([-1, 0], 1), ([-1, 0], 4), ([-2, -1, 0], 2), ([-6, -4, -2, 0], 3), ([-5, 0], 2)],
)
def test_select_action_steps_through_chunks_of_the_true_history(offsets: list[int], n_action_steps: int) -> None:
    count = len(offsets)
    chosen_offsets = {"n_obs_steps": count} if offsets[0] == 1 - count else {"observation_offsets": offsets}
    config = tiny_config(**chosen_offsets, n_action_steps=n_action_steps, horizon=8)
    policy, preprocess, _ = build(config)
    episode = [
        {k: v[:, -1] if k == contract.STATE_KEY or getattr(v, "ndim", 0) == 5 else v for k, v in batch.items()}
        for batch in (batch_for(config, size=2, seed=t) for t in range(9))
    ]
    steps = [preprocess({k: v for k, v in step.items() if not k.startswith("action")}) for step in episode]
    noise = torch.randn(2, 8, contract.ACTION_SIZE, generator=generators(0)[0])
    looked_at = set()
    policy.reset()
    chosen = []
    for t, step in enumerate(steps):
        if policy.needs_observation:
            looked_at.add(t)
            chosen.append(policy.select_action(step, noise=noise))
        else:  # what nobody looks at may be missing
            chosen.append(policy.select_action({}, noise=noise))
    for start in range(0, len(steps), n_action_steps):
        history = [max(0, start + offset) for offset in offsets]
        assert set(history) <= looked_at | {0}
        stacked = dict(steps[start])
        for key in (*contract.IMAGE_KEYS, contract.STATE_KEY):
            stacked[key] = torch.stack([steps[t][key] for t in history], dim=1)
        chunk = policy.predict_action_chunk(stacked, noise=noise)
        for i in range(min(n_action_steps, len(steps) - start)):
            assert torch.equal(chosen[start + i], chunk[:, i])
    policy.reset()
    assert policy.needs_observation
    assert torch.equal(
        policy.select_action(steps[0], noise=noise), policy.predict_action_chunk(steps[0], noise=noise)[:, 0]
    )


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"vision_encoder": "resnet81"}, "Did you mean 'resnet18'"),
        ({"text_encoder": "tokens"}, "Did you mean 'token'"),
        ({"noise_scheduler": "ddim"}, "Did you mean 'DDIM'"),
        ({"prediction_type": "noise"}, "unknown prediction_type"),
        ({"n_action_steps": 10}, "reaches only 9 actions"),
        ({"width": 30, "n_heads": 4}, "multiple of n_heads"),
        ({"crop_fraction": 0.0}, "crop_fraction is 0.0"),
        ({"num_inference_steps": 101}, "num_inference_steps is 101"),
        ({"language_film": False}, "would not be used"),
        ({"vision_channels": [12]}, "multiples of 8"),
        ({"horizon": 0}, "expected at least 1"),
        ({"vision_grid": 0}, "vision_grid is 0"),
        ({"vision_stem": 0}, "vision_stem is 0"),
        ({"look_ahead": -1}, "look_ahead is -1"),
        ({"time_alpha": 0.0}, "time_alpha 0.0"),
        ({"vision_keypoints": 0}, "vision_keypoints is 0"),
        ({"normalization_mapping": {"ACTION": NormalizationMode.MEAN_STD}}, "clip_sample is true"),
    ],
)
def test_wrong_fields_are_explained(overrides: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        tiny_config(**overrides)


def test_wrong_features_and_batches_are_explained() -> None:
    check_wrong_features_and_batches_are_explained(DiffusionTransformerPolicy, DiffusionTransformerConfig, tiny_config)
