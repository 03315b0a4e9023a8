"""The second loss of the policy `diffusion_transformer`, told from the observation alone, and its training times."""

from __future__ import annotations

import pytest
import torch
from policy_support import batch_for, build, generators, tiny_config

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.diffusion_transformer.look_ahead import TRAVELLING, LookAhead


def _ahead(steps: int, first: int = 0) -> LookAhead:
    torch.manual_seed(0)
    return LookAhead(6, 8, contract.ACTION_SIZE, steps, first)


def test_what_is_told_is_how_far_the_steps_from_now_on_travel() -> None:
    ahead, features = _ahead(steps=16, first=-1), torch.randn(2, 2, 6)
    actions = torch.zeros(2, 20, contract.ACTION_SIZE)
    travelling = torch.cat([torch.arange(12)[contract.ACTION_SLICES[part]] for part in TRAVELLING])
    assert ahead.indices == travelling.tolist()
    told = ahead.layers(features[:, -1])
    actions[:, 1:17, travelling] = (told / 16**0.5).unsqueeze(1)
    assert ahead(features, {"action": actions}).max() < 1e-10
    for seen, step in ((False, 0), (True, 1), (True, 16), (False, 17)):
        changed = actions.clone()
        changed[:, step, travelling] += 5.0
        assert (ahead(features, {"action": changed}) > 1e-3).all() == seen, step
    others = [i for i in range(contract.ACTION_SIZE) if i not in ahead.indices]
    actions[..., others] = 3.0  # how the hand turns and whether it closes are not asked for
    assert ahead(features, {"action": actions}).max() < 1e-10


def test_padded_steps_are_left_out() -> None:
    ahead, features = _ahead(steps=4), torch.randn(3, 1, 6)
    actions = torch.zeros(3, 4, contract.ACTION_SIZE)
    actions[..., ahead.indices] = (ahead.layers(features[:, -1]) / 2).unsqueeze(1)
    padded = torch.tensor([[False] * 4, [False, False, True, True], [True] * 4])
    actions[padded] = 7.0
    losses = ahead(features, {"action": actions, "action_is_pad": padded})
    assert losses.max() < 1e-10
    assert (ahead(features, {"action": actions})[1:] > 0.1).all()


@pytest.mark.parametrize("look_ahead", [5, 30])
def test_it_is_weighed_beside_the_loss_of_actions_and_trained(look_ahead: int) -> None:
    losses = []
    for weight in (0.0, 1.0, 3.0):
        policy, preprocess, _ = build(tiny_config(look_ahead=look_ahead, look_ahead_weight=weight, crop_fraction=1.0))
        batch = preprocess(batch_for(policy.config))
        assert batch["action"].shape[1] == max(policy.config.horizon, look_ahead - 1 + policy.config.n_obs_steps)
        loss, told = policy.train()(batch, generator=generators(0)[0])
        losses.append(loss.item())
    assert losses[1] - losses[0] == pytest.approx(told["look_ahead_loss"].item(), rel=1e-4)
    assert losses[2] - losses[0] == pytest.approx(3 * told["look_ahead_loss"].item(), rel=1e-4)
    loss.backward()
    assert policy.look_ahead is not None
    asked = {id(p) for group in policy.get_optim_params() for p in group["params"]}
    for part in (policy.look_ahead, policy.observation_encoder.vision):
        assert all(id(p) in asked and p.grad is not None for p in part.parameters())


def test_what_lies_behind_a_chunk_is_not_learned_as_actions() -> None:
    policy, preprocess, _ = build(tiny_config(look_ahead=30, look_ahead_weight=0.0, crop_fraction=1.0))
    raw = batch_for(policy.config)
    other = {**raw, "action": raw["action"].clone()}
    other["action"][:, policy.config.horizon :] = 0.5
    assert not torch.equal(raw["action"], other["action"])
    one, two = (policy(preprocess(dict(b)), generator=generators(0)[0])[0] for b in (raw, other))
    assert one == two
    with pytest.raises(UserError, match="action_delta_indices"):  # a chunk alone is not enough to look ahead
        policy(preprocess({**raw, "action": raw["action"][:, : policy.config.horizon]}))


def test_training_times() -> None:
    """Evenly all of them; with an alpha of 3 the share below t is t^3."""
    for alpha in (1.0, 3.0):
        policy, _, _ = build(tiny_config(time_alpha=alpha))
        steps = policy.config.num_train_timesteps
        times = policy.sample_times(20_000, generators(0)[0])
        assert times.min() >= 0
        assert times.max() == steps - 1
        for share in (0.25, 0.5, 0.75):
            assert (times < share * steps).float().mean().item() == pytest.approx(share**alpha, abs=0.02)
    assert len(times.unique()) > 0.8 * steps
