"""Weights in half precision, and their averages, are trained in float32."""

from __future__ import annotations

import pytest
import torch

from robocasa_lerobot.training.config.phase import EmaConfig
from robocasa_lerobot.training.weights.ema import Ema
from robocasa_lerobot.training.weights.master_weights import MasterWeights

STEPS = 200


def trained(dtype: torch.dtype, steps: int = STEPS) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Weights before and after steps of AdamW at pi0's rate, and their average; the gradients are alike for all."""
    layer = torch.nn.Linear(64, 64, bias=False)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        layer.weight.copy_(0.02 * torch.randn(64, 64, generator=generator))
    layer = layer.to(torch.bfloat16).to(dtype)  # the same beginning
    start = layer.weight.detach().float().clone()
    gradient = torch.randn(64, 64, generator=generator)
    masters = MasterWeights(layer)
    optimizer = torch.optim.AdamW(masters.groups(layer.parameters()), lr=2.5e-5, betas=(0.9, 0.95))
    masters.follow(optimizer)
    ema = Ema(layer, EmaConfig(min_decay=0.99, max_decay=0.99), masters=masters)
    for _ in range(steps):
        layer.weight.grad = gradient.to(dtype)
        optimizer.step()
        optimizer.zero_grad()
        assert layer.weight.grad is None
        ema.update()
    (average,) = ema.state().values()
    return start, layer.weight.detach().float(), average.clone()


def test_half_precision_learns_what_float32_learns() -> None:
    start, float32, float32_average = trained(torch.float32)
    _, rounded, average = trained(torch.bfloat16)
    moved = (float32 - start).abs().mean()
    assert float((rounded - start).abs().mean()) == pytest.approx(float(moved), rel=0.1)
    # One bit of bfloat16 is 2 ** -8 of a weight: nothing but this last rounding differs.
    torch.testing.assert_close(rounded, float32, rtol=2**-8, atol=1e-6)
    torch.testing.assert_close(average, float32_average, rtol=0, atol=1e-6)
    assert average.dtype == torch.float32


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_average_lends_its_weights_and_gives_the_others_back(dtype: torch.dtype) -> None:
    layer = torch.nn.Linear(4, 4).to(dtype)
    ema = Ema(layer, EmaConfig(min_decay=0.5, max_decay=0.5))
    with torch.no_grad():
        layer.weight.add_(1.0)
    ema.update()
    before, average = layer.weight.detach().clone(), {k: v.clone() for k, v in ema.state().items()}
    with ema.applied():
        assert torch.equal(layer.weight, average["000000"].to(dtype))
        assert not torch.equal(layer.weight, before)
    assert torch.equal(layer.weight, before)
    assert layer.weight.dtype == dtype
    assert all(torch.equal(value, average[key]) for key, value in ema.state().items())


def test_masters_of_other_parameters_are_refused() -> None:
    masters = MasterWeights(torch.nn.Linear(2, 2).to(torch.bfloat16))
    assert len(masters) == 2
    with pytest.raises(RuntimeError, match="1 master weights for 2 parameters"):
        masters.load({"000000": torch.zeros(2, 2)})
    assert not len(MasterWeights(torch.nn.Linear(2, 2)))
