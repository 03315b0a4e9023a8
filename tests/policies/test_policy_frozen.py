"""Frozen policies are computed by ONNX Runtime: the same actions but for last bits, the same bits each time."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest
import torch
from flow_vla_support import tiny_config as tiny_flow
from policy_support import batch_for, build, generators, tiny_config
from torch import Tensor, nn

from robocasa_lerobot.policies.common import onnx_session as onnx
from robocasa_lerobot.policies.common.traced import Traced, freeze
from robocasa_lerobot.policies.registry import POLICY_TYPES

CLOSE = 1e-5  # actions are within [-1, 1]
POLICIES: dict[str, Callable[[], Any]] = {
    "diffusion, shared convnet with keypoints": tiny_config,
    "diffusion, a grid for each camera": lambda: tiny_config(vision_shared=False, vision_grid=2, crop_fraction=1.0),
    "diffusion, resnet": lambda: tiny_config(pixels=64, vision_encoder="resnet18", n_obs_steps=1),
    "diffusion, no condition layers, epsilon": lambda: tiny_config(n_condition_layers=0, prediction_type="epsilon"),
    "flow": tiny_flow,
    "flow, adaptive norms": lambda: tiny_flow(time_conditioning="adaptive_norm"),
}


def networks(policy: Any) -> list[Traced]:
    """What `freeze` is to find."""
    if hasattr(policy, "expert"):
        return [policy._ask_expert]
    return [policy._condition, policy._decode, *policy.observation_encoder._encoders.values()]


def by_onnx(traced: Traced) -> list[bool]:
    return [run.__qualname__.startswith("_session") for run in map(_plain, traced._recorded.values())]


def _plain(run: Any) -> Any:
    return run if hasattr(run, "__qualname__") else type(run)


@pytest.mark.parametrize("name", POLICIES)
def test_actions_are_those_of_pytorch_and_the_same_each_time(name: str) -> None:
    config = POLICIES[name]()
    pixels = next(iter(config.image_features.values())).shape[-1]
    policy, preprocess, _ = build(config)
    policy.eval()
    for weight in policy.parameters():  # what is zero at first would hide a mistake
        if weight.ndim > 1:
            nn.init.normal_(
                weight, std=weight[0].numel() ** -0.5, generator=torch.Generator().manual_seed(weight.numel())
            )
    frozen, again = copy.deepcopy(policy), copy.deepcopy(policy)
    freeze(frozen)
    freeze(again)
    moved = 0.0
    for seed in range(4):
        batch = preprocess(batch_for(config, 1, pixels, seed))
        with torch.inference_mode():
            expected = policy.predict_action_chunk(dict(batch), generator=generators(seed))
            found = frozen.predict_action_chunk(dict(batch), generator=generators(seed))
            assert torch.equal(found, again.predict_action_chunk(dict(batch), generator=generators(seed)))
        assert (found - expected).abs().max() < CLOSE
        moved = max(moved, float(expected.std()))
    assert moved > 0.01  # actions that differ from each other
    assert [by_onnx(network) for network in networks(frozen)] == [[True]] * len(networks(frozen))
    assert [by_onnx(network) for network in networks(policy)] == [[False]] * len(networks(policy))


def test_all_types_of_policies_are_there() -> None:
    assert {make().type for make in POLICIES.values()} == set(POLICY_TYPES)


class Sees(nn.Module):
    """A linear layer, by a formula of its own."""

    def __init__(self, formula: Callable[[Tensor], Tensor]) -> None:
        super().__init__()
        self.linear, self.formula = nn.Linear(4, 4), formula

    def forward(self, x: Tensor) -> Tensor:
        return self.formula(self.linear(x))


def differs(x: Tensor) -> Tensor:
    return x + 1 if torch.onnx.is_in_onnx_export() else x


@pytest.mark.parametrize(
    ("formula", "given"),
    [
        (torch.linalg.inv, torch.rand(4, 4)),  # ONNX has no word for it
        (differs, torch.rand(2, 4)),
        (lambda x: x.double() if torch.onnx.is_in_onnx_export() else x, torch.rand(2, 4)),
        (lambda x: x[:1] if torch.onnx.is_in_onnx_export() else x, torch.rand(2, 4)),
    ],
    ids=["not to be expressed", "another answer", "another type", "another shape"],
)
def test_what_onnx_gives_otherwise_pytorch_computes(
    formula: Callable[[Tensor], Tensor], given: Tensor, capfd: pytest.CaptureFixture[str]
) -> None:
    module = Sees(formula).eval()
    traced = Traced(module)
    traced.freeze()
    with torch.inference_mode():
        found = traced(given)
        assert torch.equal(found, module(given))
        assert found.dtype == module(given).dtype
    assert sum(map(len, capfd.readouterr())) == 0  # its exporter would print the whole network


def test_large_networks_and_other_types_are_left_to_pytorch(monkeypatch: pytest.MonkeyPatch) -> None:
    module, given = Sees(torch.tanh).eval(), torch.rand(2, 4)
    assert onnx.onnx_session(module, (given,)) is not None
    assert onnx.onnx_session(module.double(), (given.double(),)) is None
    monkeypatch.setattr(onnx, "LARGEST_BYTES", 79)
    assert onnx.onnx_session(module.float(), (given,)) is None  # 20 weights of 4 bytes


def test_without_the_runtime_pytorch_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    assert onnx.onnx_session(Sees(torch.tanh).eval(), (torch.rand(2, 4),)) is None


def test_the_way_pytorch_computes_is_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    module, given = Sees(torch.tanh).eval(), torch.rand(2, 4)
    for fast in (True, False):
        monkeypatch.setattr(torch.backends.mha, "_is_fastpath_enabled", fast)
        onnx.onnx_session(module, (given,))
        assert torch.backends.mha.get_fastpath_enabled() is fast


def test_a_copy_of_a_frozen_network_is_frozen_and_gradients_still_come_from_the_module() -> None:
    traced, given = Traced(Sees(torch.tanh).eval()), torch.rand(2, 4)
    traced.freeze()
    copied = copy.deepcopy(traced)
    with torch.no_grad():
        copied(given)
    assert by_onnx(copied) == [True]
    assert traced(given).requires_grad
