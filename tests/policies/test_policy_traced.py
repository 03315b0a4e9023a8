"""Recorded networks give the module's own bits and follow its weights; frozen ones its values; copies hold none."""

from __future__ import annotations

import copy
import io
import pickle

import pytest
import torch
from torch import Tensor, nn

from robocasa_lerobot.policies.common.traced import Traced
from robocasa_lerobot.policies.diffusion_transformer.network import DenoisingTransformer


def denoiser() -> DenoisingTransformer:
    torch.manual_seed(0)
    made = DenoisingTransformer(4, 16, horizon=6, n_obs_steps=1, width=32, n_heads=4, n_decoder_layers=2)
    return made.eval()


def inputs(seed: int, batch: int = 1) -> tuple[Tensor, Tensor, Tensor]:
    random = torch.Generator().manual_seed(seed)
    noisy = torch.randn(batch, 6, 4, generator=random)
    return noisy, torch.randint(100, (batch,), generator=random), torch.randn(batch, 1, 16, generator=random)


def recordings(traced: Traced) -> list[bool]:
    """Of each shape, whether it is run as a recording."""
    return [isinstance(one, torch.jit.ScriptModule) for one in traced._recorded.values()]


def test_bits_are_the_modules_for_other_values_and_batches() -> None:
    module = denoiser()
    traced = Traced(module)
    with torch.inference_mode():
        for seed in range(20):
            given = inputs(seed, batch=1 + seed % 3)
            assert torch.equal(traced(*given), module(*given))
    assert recordings(traced) == [True, True, True]


def test_a_recording_follows_weights_that_change_in_place() -> None:
    module = denoiser()
    traced, given = Traced(module), inputs(1)
    with torch.no_grad():
        before = traced(*given)
        for parameter in module.parameters():
            parameter.mul_(1.1)
        swapped = traced(*given)
        assert not torch.equal(before, swapped)
        assert torch.equal(swapped, module(*given))
        for parameter in module.parameters():  # as averages are put in and taken out
            parameter.data = parameter.data / 2
        assert torch.equal(traced(*given), module(*given))


def test_autocast_and_recordings_leave_each_other_alone() -> None:
    module = denoiser()
    traced, given, found = Traced(module), inputs(1), []
    for autocast in (True, False, True, False):
        with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16, enabled=autocast):
            found.append(traced(*given))
            assert torch.equal(found[-1], module(*given))
        with torch.no_grad():
            for parameter in module.parameters():
                parameter.mul_(1.1)
    assert not torch.equal(found[0], found[2])
    assert recordings(traced) == [True]


def test_gradients_and_dropout_come_from_the_module() -> None:
    module = denoiser()
    traced, given = Traced(module), inputs(2)
    traced(*given).sum().backward()
    assert all(parameter.grad is not None for parameter in module.head.parameters())
    module.train()  # dropout of 0.3
    with torch.no_grad():
        assert not torch.equal(traced(*given), traced(*given))
    assert recordings(traced) == []


class DependsOnValues(nn.Module):
    """Another course for other values, which a recording cannot take; and numbers that no two calls share."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = 0

    def forward(self, x: Tensor) -> Tensor:
        self.calls += 1
        return x + self.calls


def test_what_cannot_be_recorded_is_called() -> None:
    traced, x = Traced(DependsOnValues().eval()), torch.zeros(2)
    with torch.no_grad():
        first, second = traced(x), traced(x)
    assert recordings(traced) == [False]
    assert not torch.equal(first, second)


@pytest.mark.parametrize("inner", [False, True])
def test_hooks_are_called(inner: bool) -> None:
    module, seen = denoiser(), []
    traced = Traced(module)
    hooked = module.head if inner else module
    if not inner:
        with torch.no_grad():
            traced(*inputs(4))  # what was recorded before steps aside
    hooked.register_forward_hook(lambda _module, given, _out: seen.append(type(given[0].shape[0])))
    with torch.no_grad():
        traced(*inputs(4))
        traced(*inputs(5))
    assert seen == [int, int]


def test_shapes_are_forgotten_one_by_one() -> None:
    traced = Traced(denoiser())
    with torch.no_grad():
        for batch in range(1, 12):
            traced(*inputs(batch, batch))
    assert len(traced._recorded) == 8


@pytest.mark.parametrize("how", ["deepcopy", "pickle"])
def test_copies_hold_no_recording_and_have_weights_of_their_own(how: str) -> None:
    module = denoiser()
    traced, given = Traced(module), inputs(3)
    with torch.no_grad():
        expected = traced(*given)
        copied = copy.deepcopy(traced) if how == "deepcopy" else pickle.load(io.BytesIO(pickle.dumps(traced)))
        assert recordings(copied) == []
        for parameter in module.parameters():
            parameter.zero_()
        assert torch.equal(copied(*given), expected)
