"""Noise levels and DDIM's steps of `diffusion_transformer`, beside diffusers' and a denoiser that is never wrong."""

from __future__ import annotations

import pytest
import torch
from policy_support import batch_for, build, tiny_config

from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)
from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import (
    DiffusionTransformerPolicy,
    _noise_scheduler,
)
from robocasa_lerobot.policies.diffusion_transformer.sampling import DdimSteps, sampling_times

CLEAN = 0.3
SPACINGS = ("trailing", "leading", "linspace")


def sampled(config: DiffusionTransformerConfig) -> torch.Tensor:
    """What sampling comes to where every prediction is right."""
    scheduler = _noise_scheduler(config)
    x = torch.randn(2, 4, 3, generator=torch.Generator().manual_seed(0))
    times = sampling_times(config)
    steps = DdimSteps(scheduler, times)
    for number, time in enumerate(times):
        level = scheduler.alphas_cumprod[time]
        right = (x - level**0.5 * CLEAN) / (1 - level) ** 0.5
        prediction = right if config.prediction_type == "epsilon" else torch.full_like(x, CLEAN)
        x = steps.step(number, prediction, x)
    return x


@pytest.mark.parametrize("spacing", SPACINGS)
def test_any_number_of_steps_has_as_many_levels_and_ends_clean(spacing: str) -> None:
    for steps in range(1, 101):
        config = tiny_config(num_train_timesteps=100, num_inference_steps=steps, timestep_spacing=spacing)
        times = sampling_times(config)
        assert len(times) == len(set(times)) == steps
        assert times == sorted(times, reverse=True)
        assert 0 <= times[-1]
        assert times[0] <= 99
        if spacing == "trailing":
            assert times[0] == 99, "from pure noise on"
    for steps in (1, 6, 10, 15, 29, 60, 97, 100):
        for kind in ("epsilon", "sample"):
            config = tiny_config(
                num_train_timesteps=100, num_inference_steps=steps, timestep_spacing=spacing, prediction_type=kind
            )
            torch.testing.assert_close(sampled(config), torch.full((2, 4, 3), CLEAN), atol=2e-3, rtol=0)


@pytest.mark.parametrize("kind", ["epsilon", "sample"])
@pytest.mark.parametrize("spacing", ["trailing", "leading"])
def test_where_the_steps_divide_the_levels_it_is_diffusers_own(spacing: str, kind: str) -> None:
    for steps in (1, 2, 5, 10, 50, 100):
        config = tiny_config(
            num_train_timesteps=100, num_inference_steps=steps, timestep_spacing=spacing, prediction_type=kind
        )
        theirs = _noise_scheduler(config)
        theirs.set_timesteps(steps)
        times = sampling_times(config)
        assert theirs.timesteps.tolist() == times
        random = torch.Generator().manual_seed(1)
        x = torch.randn(2, 4, 3, generator=random)
        own = DdimSteps(theirs, times)
        for number, time in enumerate(times):
            prediction = torch.randn(2, 4, 3, generator=random)
            ours = own.step(number, prediction, x)
            x = theirs.step(prediction, time, x).prev_sample
            assert torch.equal(ours, x)


@pytest.mark.parametrize("scheduler", ["DDIM", "DDPM"])
def test_a_policy_asks_for_these_levels(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    config = tiny_config(num_train_timesteps=100, num_inference_steps=29, noise_scheduler=scheduler)
    policy, preprocess, _ = build(config)
    assert isinstance(policy, DiffusionTransformerPolicy)
    asked: list[int] = []

    def decode(x: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
        assert times.tolist() == [int(times[0])] * 2
        asked.append(int(times[0]))
        level = policy.scheduler.alphas_cumprod[asked[-1]]
        return (x - level**0.5 * CLEAN) / (1 - level) ** 0.5

    monkeypatch.setattr(policy, "_condition", lambda times, features: times)
    monkeypatch.setattr(policy, "_decode", decode)
    chunk = policy.sample(preprocess(batch_for(config, 2)))
    assert asked == sampling_times(config)
    torch.testing.assert_close(chunk, torch.full_like(chunk, CLEAN), atol=0.02, rtol=0)


def test_a_step_predicts_what_the_denoiser_does_for_its_sample_and_level(monkeypatch: pytest.MonkeyPatch) -> None:
    config = tiny_config(num_inference_steps=3)
    policy, preprocess, _ = build(config)
    policy.eval()
    batch = preprocess(batch_for(config, 2))
    features, levels = policy.observation_encoder(batch), iter(sampling_times(config))
    decode, seen = policy._decode, []

    def compared(x: torch.Tensor, memory: torch.Tensor) -> torch.Tensor:
        out: torch.Tensor = decode(x, memory)
        whole = policy.denoiser(x, torch.full((2,), next(levels)), features)
        torch.testing.assert_close(out, whole, atol=1e-6, rtol=1e-5)
        seen.append(out)
        return out

    monkeypatch.setattr(policy, "_decode", compared)
    policy.sample(batch)
    assert len(seen) == 3
    assert not torch.allclose(seen[0][0], seen[0][1])
    assert not torch.allclose(seen[0], seen[1])
