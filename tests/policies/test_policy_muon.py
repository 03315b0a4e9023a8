"""Muon for hidden matrices, AdamW for the rest: against PyTorch's own two, and through LeRobot's settings."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path

import draccus
import flow_vla_support
import policy_support
import pytest
import torch
from lerobot.optim import load_optimizer_state, save_optimizer_state
from lerobot.optim.optimizers import OptimizerConfig
from torch import nn

from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.policies.common.muon import MuonAdamW, MuonConfig, is_hidden_matrix


class Net(nn.Module):
    """A table, a convolution, a hidden layer and a head."""

    def __init__(self) -> None:
        super().__init__()
        self.embedding = nn.Embedding(5, 3)
        self.convolution = nn.Conv2d(3, 6, 3)
        self.linear = nn.Linear(6, 8)
        self.head = nn.Linear(8, 2)

    def forward(self, x: torch.Tensor, word: torch.Tensor) -> torch.Tensor:
        """Maps pictures (N, 3, 5, 5) and words (N,) to (N, 2)."""
        seen = self.convolution(x + self.embedding(word)[..., None, None]).amax(dim=(2, 3))
        return torch.as_tensor(self.head(torch.relu(self.linear(seen))))


def gradients(net: Net, steps: int, seed: int = 0) -> Iterator[None]:
    """Fill gradients in, step after step."""
    generator = torch.Generator().manual_seed(seed)
    for _ in range(steps):
        x = torch.randn(7, 3, 5, 5, generator=generator)
        net.zero_grad()
        (net(x, torch.randint(5, (7,), generator=generator)) ** 2).mean().backward()
        yield


def new() -> Net:
    torch.manual_seed(0)
    return Net()


def test_what_has_matrices_alone_is_moved_too() -> None:
    """As where a phase trains low-rank changes of attention and nothing else."""
    net = new()
    optimizer = MuonConfig().build({"linear.weight": net.linear.weight})
    before = net.linear.weight.detach().clone()
    for _ in gradients(net, 2):
        optimizer.step()
    assert not torch.equal(net.linear.weight, before)
    again = MuonConfig().build({"linear.weight": net.linear.weight})
    again.load_state_dict(optimizer.state_dict())
    assert again.state_dict()["state"].keys() == {0}


def test_matrices_and_the_rest_go_as_with_pytorchs_own_optimisers() -> None:
    ours, theirs = new(), new()
    settings = MuonConfig(lr=2e-3, matrix_lr=0.03, momentum=0.9, betas=(0.8, 0.9), weight_decay=0.1)
    optimizer = settings.build(dict(ours.named_parameters()))
    # Of a convolution PyTorch's takes a matrix, in the same memory.
    flat = nn.Parameter(theirs.convolution.weight.data.view(6, 27))
    muon = torch.optim.Muon([flat, theirs.linear.weight], lr=0.03, momentum=0.9, weight_decay=0.1)
    matrices = ("convolution.weight", "linear.weight")
    rest = [p for name, p in theirs.named_parameters() if name not in matrices]
    adamw = torch.optim.AdamW(rest, lr=2e-3, betas=(0.8, 0.9), weight_decay=0.0)
    before = copy.deepcopy(ours.state_dict())
    for _ in zip(gradients(ours, 5), gradients(theirs, 5), strict=True):
        assert theirs.convolution.weight.grad is not None
        flat.grad = theirs.convolution.weight.grad.view(6, 27)
        optimizer.step()
        muon.step()
        adamw.step()
    for name, value in ours.state_dict().items():
        assert torch.equal(value, theirs.state_dict()[name]), name
        assert not torch.equal(value, before[name]), name


def test_goes_on_from_a_checkpoint_to_the_same_weights(tmp_path: Path) -> None:
    whole, first = new(), new()
    optimizer = MuonConfig().build(dict(whole.named_parameters()))
    for _ in gradients(whole, 6):
        optimizer.step()
    begun = MuonConfig().build(dict(first.named_parameters()))
    steps = gradients(first, 6)
    for _ in range(3):
        next(steps)
        begun.step()
    save_optimizer_state(begun, tmp_path)
    other = MuonConfig(lr=1.0, matrix_lr=1.0).build(dict(first.named_parameters()))
    again = load_optimizer_state(other, tmp_path)
    assert isinstance(again, MuonAdamW)
    for _ in steps:
        again.step()
    for name, value in whole.state_dict().items():
        assert torch.equal(value, first.state_dict()[name]), name


def test_a_schedule_and_closures_reach_both(tmp_path: Path) -> None:
    net = new()
    optimizer = MuonConfig(lr=1e-3, matrix_lr=0.01).build(dict(net.named_parameters()))
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: 0.0 if step else 0.5)
    assert [group["lr"] for group in optimizer.param_groups] == [0.005, 0.0005]
    list(gradients(net, 1))
    assert optimizer.step(lambda: 3.0) == 3.0
    schedule.step()
    before = copy.deepcopy(net.state_dict())
    optimizer.step()
    assert all(torch.equal(value, before[name]) for name, value in net.state_dict().items()), "a rate of zero"


def test_what_is_hidden_in_our_policies() -> None:
    policy, _, _ = policy_support.build(policy_support.tiny_config(optimizer_name="muon"))
    hidden = {name for name, p in policy.named_parameters() if is_hidden_matrix(name, p)}
    parts = {name.split(".")[-2] if "norm" not in name else name for name in hidden}
    assert {"linear1", "linear2", "out_proj", "self_attn", "multihead_attn", "project"} <= parts
    assert any("convolutions" in name for name in hidden)
    left = {name for name, p in policy.named_parameters() if p.ndim > 1} - hidden
    known = ("embed", "position", "denoiser.head", "film", "text_encoder")
    assert all(any(part in name for part in known) for name in left)
    flow, _, _ = flow_vla_support.build(flow_vla_support.tiny_config(optimizer_name="muon"))
    assert sum(is_hidden_matrix(name, p) for name, p in flow.named_parameters()) > 10


@pytest.mark.parametrize("support", [policy_support, flow_vla_support])
def test_a_policy_that_asks_for_it_is_trained_by_it(support: object) -> None:
    """As LeRobot's own training makes its optimiser, of parameters and settings that the policy gives."""
    config = support.tiny_config(optimizer_name="muon", optimizer_matrix_lr=0.02, optimizer_lr=3e-3)  # type: ignore[attr-defined]
    policy, preprocess, _ = support.build(config)  # type: ignore[attr-defined]
    optimizer = config.get_optimizer_preset().build(policy.get_optim_params())
    assert [group["lr"] for group in optimizer.param_groups] == [0.02, 3e-3]
    held = [id(p) for group in optimizer.param_groups for p in group["params"]]
    assert sorted(held) == sorted(id(p) for p in policy.parameters() if p.requires_grad)
    batch = preprocess(policy_support.batch_for(config))
    losses = []
    for step in range(60):
        loss, _ = policy.train()(batch, generator=policy_support.generators(step % 4)[0])
        losses.append(loss.item())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert sum(losses[-4:]) < 0.5 * sum(losses[:4])


def test_settings_are_written_and_read_as_lerobots_others() -> None:
    settings = MuonConfig(lr=2e-3, matrix_lr=0.02)
    again = draccus.decode(OptimizerConfig, draccus.encode(settings, OptimizerConfig))
    assert again == settings
    assert again.type == "muon"


def test_mistakes() -> None:
    with pytest.raises(TypeError, match="by their names, found list"):
        MuonConfig().build(list(new().parameters()))
    with pytest.raises(UnknownNameError, match="Did you mean 'muon'"):
        policy_support.tiny_config(optimizer_name="muom").get_optimizer_preset()
