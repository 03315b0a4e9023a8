"""The policy `flow_vla`: its prefix and masks, the cache, pretrained models, freezing, checkpoints."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import draccus
import pytest
import torch
from flow_vla_support import KINDS, build, check_variant, chunk_noise, pretrained_config, tiny_config, write_pretrained
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import make_pre_post_processors
from lerobot.utils.constants import OBS_LANGUAGE_ATTENTION_MASK, OBS_LANGUAGE_TOKENS
from policy_support import batch_for, generators
from torch import Tensor

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.flow_vla.expert import attention_mask, time_embedding
from robocasa_lerobot.policies.flow_vla.modeling_flow_vla import FlowVlaPolicy
from robocasa_lerobot.policies.flow_vla.pretrained import PretrainedPrefix


@pytest.fixture(scope="module", params=KINDS)
def pretrained(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_pretrained(tmp_path_factory.mktemp("models") / request.param, request.param)


@pytest.mark.parametrize("time_conditioning", ["mlp", "adaptive_norm"])
def test_pretrained_variant_trains_and_predicts(pretrained: Path, time_conditioning: str) -> None:
    check_variant(pretrained_config(pretrained, time_conditioning=time_conditioning))


def test_instructions_are_cut_to_so_many_tokens(pretrained: Path) -> None:
    tokens = {}
    for most in (48, 2):
        config = pretrained_config(pretrained, max_tokens=most)
        policy, preprocess, _ = build(config)
        batch = preprocess(batch_for(config))
        tokens[most] = batch[OBS_LANGUAGE_TOKENS]
        assert tokens[most].shape == batch[OBS_LANGUAGE_ATTENTION_MASK].shape == (4, most)
        assert torch.isfinite(policy(batch)[0])
    assert batch[OBS_LANGUAGE_ATTENTION_MASK].all()
    assert torch.equal(tokens[2], tokens[48][:, :2])


def test_attention_mask_has_three_blocks() -> None:
    prefix = torch.tensor([[True, True, True], [True, True, False]])
    mask = attention_mask(prefix, actions=2)
    assert mask.shape == (2, 1, 3, 6)
    for sample in range(2):
        words = prefix[sample].tolist()
        assert mask[sample, 0].tolist() == [
            [*words, True, False, False],
            [*words, True, True, True],
            [*words, True, True, True],
        ]


def test_time_embedding_has_the_published_periods() -> None:
    times = torch.tensor([0.0, 1e-3, 0.5])
    out = time_embedding(times, 8, 4e-3, 4.0)
    for i, t in enumerate(times.tolist()):
        for j, period in enumerate((4e-3, 4e-2, 4e-1, 4.0)):
            assert out[i, j].item() == pytest.approx(math.sin(2 * math.pi * t / period), abs=1e-4)
            assert out[i, 4 + j].item() == pytest.approx(math.cos(2 * math.pi * t / period), abs=1e-4)


def joint_velocity(policy: FlowVlaPolicy, batch: dict[str, Tensor], noisy: Tensor, times: Tensor) -> Tensor:
    """The same network as one pass over prefix and expert tokens under a mask of blocks, without any cache."""
    expert, model = policy.expert, policy.prefix.language_model
    p, mask = policy.prefix.tokens(batch, None)
    s, condition = expert.embed(policy._state(batch), noisy, times)
    n_prefix, n_own = p.shape[1], s.shape[1]
    counts = torch.cat([mask, mask.new_ones(len(mask), n_own)], dim=1)
    position = counts.cumsum(dim=1) - 1
    block = torch.tensor([0] * n_prefix + [1] + [2] * (n_own - 1))
    seen = (block[None, :] <= block[:, None]) & counts[:, None, :]
    angle = position[..., None] * torch.cat([model.rotary_emb.inv_freq] * 2)
    heads, dim = policy.prefix.shape["heads"], policy.prefix.shape["head_dim"]

    def split(x: Tensor) -> Tensor:
        return x.unflatten(-1, (-1, dim)).transpose(1, 2)

    def turn(x: Tensor) -> Tensor:
        a, b = x[..., : dim // 2], x[..., dim // 2 :]
        return x * angle.cos()[:, None] + torch.cat([-b, a], dim=-1) * angle.sin()[:, None]

    for i, (theirs, ours) in enumerate(zip(model.layers, expert.layers, strict=True)):
        last = i == len(model.layers) - 1
        read = theirs if last else theirs.self_attn
        a, (b, gate) = theirs.input_layernorm(p), ours.norm1(s, condition)
        q_prefix = split(b.new_zeros(len(b), n_prefix, heads * dim) if last else read.q_proj(a))
        q = turn(torch.cat([q_prefix, split(ours.q_proj(b))], dim=2))
        k = turn(torch.cat([split(read.k_proj(a)), split(ours.k_proj(b))], dim=2))
        v = torch.cat([split(read.v_proj(a)), split(ours.v_proj(b))], dim=2)
        k, v = (x.repeat_interleave(heads // x.shape[1], dim=1) for x in (k, v))
        scores = (q @ k.transpose(2, 3) / math.sqrt(dim)).masked_fill(~seen[:, None], -math.inf)
        out = (scores.softmax(dim=-1) @ v).transpose(1, 2).flatten(2)
        s = s + ours.o_proj(out[:, n_prefix:]) * (1 if gate is None else gate)
        b, gate = ours.norm2(s, condition)
        b = ours.down_proj(torch.nn.functional.gelu(ours.gate_proj(b), approximate="tanh") * ours.up_proj(b))
        s = s + b * (1 if gate is None else gate)
        if not last:
            p = p + read.o_proj(out[:, :n_prefix])
            p = p + theirs.mlp(theirs.post_attention_layernorm(p))
    return expert.head(expert.norm(s[:, 1:], condition)[0])


@pytest.mark.parametrize("time_conditioning", ["mlp", "adaptive_norm"])
@pytest.mark.parametrize("kind", ["scratch", *KINDS])
def test_cached_prefix_equals_one_pass_over_everything(kind: str, time_conditioning: str, tmp_path: Path) -> None:
    overrides = {"time_conditioning": time_conditioning}
    if kind == "scratch":
        config = tiny_config(prefix_depth=3, **overrides)
    else:
        config = pretrained_config(write_pretrained(tmp_path, kind), **overrides)
    policy, preprocess, _ = build(config)
    policy.eval()
    batch = preprocess(batch_for(config))
    noise, times = chunk_noise(config), torch.tensor([1.0, 0.7, 0.31, 0.001])
    with torch.no_grad():
        cached = policy.velocity(policy._state(batch), noise, times, policy.prefix(batch))
        joint = joint_velocity(policy, batch, noise, times)
    torch.testing.assert_close(cached, joint, atol=2e-5, rtol=1e-4)
    # And over all Euler steps, against reading the prefix anew in each of them.
    reads = []
    hook = policy.prefix.register_forward_hook(lambda *_: reads.append(1))
    whole = policy.sample(batch, noise=noise)
    assert len(reads) == 1
    anew = policy.sample(batch, noise=noise, cached_prefix=False)
    assert len(reads) == 1 + config.num_inference_steps
    hook.remove()
    torch.testing.assert_close(whole, anew, atol=1e-6, rtol=1e-5)


def test_padding_of_the_instruction_is_not_seen() -> None:
    policy, preprocess, _ = build(tiny_config())
    batch = preprocess(batch_for(policy.config))
    noise = chunk_noise(policy.config)
    expected = policy.sample(batch, noise=noise)
    tokens, mask = batch[OBS_LANGUAGE_TOKENS], batch[OBS_LANGUAGE_ATTENTION_MASK]
    assert not mask.all()
    garbage = torch.where(mask.unsqueeze(-1), tokens, torch.full_like(tokens, 7))
    torch.testing.assert_close(policy.sample({**batch, OBS_LANGUAGE_TOKENS: garbage}, noise=noise), expected)
    changed = torch.where(mask.unsqueeze(-1), torch.full_like(tokens, 7), tokens)
    assert (policy.sample({**batch, OBS_LANGUAGE_TOKENS: changed}, noise=noise) - expected).abs().max() > 1e-4
    shorter = {OBS_LANGUAGE_TOKENS: tokens[:, :7], OBS_LANGUAGE_ATTENTION_MASK: mask[:, :7]}
    torch.testing.assert_close(policy.sample({**batch, **shorter}, noise=noise), expected, atol=1e-5, rtol=1e-4)


def test_freezing_keeps_parts_as_they_are(pretrained: Path) -> None:
    for vision, language in ((True, False), (False, True), (True, True), (False, False)):
        for make in (tiny_config, lambda **o: pretrained_config(pretrained, **o)):
            policy, preprocess, _ = build(make(freeze_vision=vision, freeze_language=language))
            batch = preprocess(batch_for(policy.config))
            parts = {
                name: [p for module in modules for p in module.parameters()]
                for name, modules in policy.prefix.parts().items()
            }
            old = {name: [p.detach().clone() for p in ps] for name, ps in parts.items()}
            optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=1e-2, weight_decay=0.1)
            for _ in range(2):
                policy.train()
                optimizer.zero_grad()
                policy(batch)[0].backward()
                optimizer.step()
            for name, frozen in (("vision", vision), ("language", language)):
                same = [torch.equal(a, b) for a, b in zip(old[name], parts[name], strict=True)]
                assert all(same) == frozen
                assert any(p.requires_grad for p in parts[name]) == (not frozen)
                assert all(module.training != frozen for module in policy.prefix.parts()[name])
            assert all(p.requires_grad for p in policy.expert.parameters())


def test_lora_targets_exist_and_would_learn_in_a_frozen_prefix() -> None:
    policy, preprocess, _ = build(tiny_config(freeze_vision=True, freeze_language=True))
    targets = policy._get_default_peft_targets()
    names = [name for name, _ in policy.named_modules()]
    found = [name for name in names if re.fullmatch(targets["target_modules"], name)]
    assert any(name.startswith("prefix.language_model.layers.0.") for name in found)
    assert any(name.startswith("expert.layers.0.") for name in found)
    assert all(any(name.split(".")[-1] == kept for name in names) for kept in targets["modules_to_save"])
    # An adapter in a frozen prefix gets gradients: what is frozen is asked of the parameters.
    policy.prefix.language_model.layers[0].self_attn.q_proj.weight.requires_grad_(True)
    policy.train()(preprocess(batch_for(policy.config)))[0].backward()
    assert policy.prefix.language_model.layers[0].self_attn.q_proj.weight.grad.abs().max() > 0


def check_saved(policy: FlowVlaPolicy, preprocess: Any, postprocess: Any, folder: Path) -> FlowVlaPolicy:
    config = policy.config
    for part in (policy, preprocess, postprocess):
        part.save_pretrained(folder)
    raw = batch_for(config)
    before = postprocess(policy.predict_action_chunk(preprocess(dict(raw)), generator=generators(1, 2, 3, 4)))
    loaded_config = PreTrainedConfig.from_pretrained(folder)
    loaded = FlowVlaPolicy.from_pretrained(folder, config=loaded_config, strict=True)
    pre, post = make_pre_post_processors(loaded_config, pretrained_path=str(folder))
    after = post(loaded.predict_action_chunk(pre(dict(raw)), generator=generators(1, 2, 3, 4)))
    assert torch.equal(before, after)
    return loaded


@pytest.mark.parametrize("time_conditioning", ["mlp", "adaptive_norm"])
def test_saved_and_loaded_policy_gives_the_same_actions(time_conditioning: str, tmp_path: Path) -> None:
    policy, preprocess, postprocess = build(tiny_config(time_conditioning=time_conditioning))
    loaded = check_saved(policy, preprocess, postprocess, tmp_path)
    assert draccus.encode(loaded.config) == draccus.encode(policy.config)


@pytest.mark.parametrize("kind", KINDS)
def test_checkpoint_with_pretrained_prefix_needs_no_other_file(kind: str, tmp_path: Path) -> None:
    model = write_pretrained(tmp_path / "model", kind)
    config = pretrained_config(model, prefix_layers=2, freeze_vision=True, frozen_dtype="bfloat16")
    policy, preprocess, postprocess = build(config)
    assert policy.prefix.shape["layers"] == len(policy.expert.layers) == 2
    exact, _, _ = build(pretrained_config(model, prefix_layers=2))
    buffers = dict(policy.prefix.named_buffers())
    assert any("inv_freq" in name for name in buffers)
    for name, value in exact.prefix.named_buffers():  # frequencies of positions are no weights
        assert torch.equal(buffers[name], value), name
    assert config.prefix_config is None  # only a checkpoint has it: this object would load weights again
    preprocess(batch_for(config))
    model.rename(tmp_path / "elsewhere")
    loaded = check_saved(policy, preprocess, postprocess, tmp_path / "checkpoint")
    # A checkpoint of what was loaded is as good.
    check_saved(loaded, preprocess, postprocess, tmp_path / "again")
    kept = json.loads((tmp_path / "again/config.json").read_text())["prefix_config"]
    assert "_name_or_path" not in kept
    with pytest.raises(UserError, match="prefix_layers is 1, but the checkpoint's language model has 2 layers"):
        FlowVlaPolicy(pretrained_config(model, prefix_layers=1, prefix_config=kept))


def test_pretrained_weights_are_those_of_the_model(pretrained: Path) -> None:
    from transformers import AutoModel

    policy, _, _ = build(pretrained_config(pretrained))
    reference = AutoModel.from_pretrained(pretrained)
    assert isinstance(policy.prefix, PretrainedPrefix)
    state = {**reference.state_dict()}
    taken = {
        **{f"see.{k}": v for k, v in policy.prefix.vision.state_dict().items()},
        **{f"read.{k}": v for k, v in policy.prefix.language_model.state_dict().items()},
    }
    assert len(taken) > 20
    for name, value in taken.items():
        part, rest = name.split(".", 1)
        prefixes = {"see": ("vision_model", "vision_tower"), "read": ("text_model", "language_model")}[part]
        last = f"layers.{policy.prefix.shape['layers'] - 1}."
        rest = rest.replace(f"{last}k_proj", f"{last}self_attn.k_proj")
        rest = rest.replace(f"{last}v_proj", f"{last}self_attn.v_proj")
        found = [state[f"{p}.{rest}"] for p in prefixes if f"{p}.{rest}" in state]
        assert len(found) == 1, name
        assert torch.equal(found[0], value), name


def test_wrong_pretrained_models_are_explained(pretrained: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="could not be loaded from hub name or folder 'no/such-model'"):
        FlowVlaPolicy(pretrained_config(Path("no/such-model")))
    with pytest.raises(UserError, match="use 1 to 3"):
        FlowVlaPolicy(pretrained_config(pretrained, prefix_layers=4))
    with pytest.raises(UserError, match="image_size is"):
        FlowVlaPolicy(pretrained_config(pretrained, image_size=(36, 36)))
    (tmp_path / "config.json").write_text(json.dumps({"model_type": "clip"}))
    with pytest.raises(UserError, match="holds a 'clip' model"):
        FlowVlaPolicy(pretrained_config(tmp_path))
    without = shutil.copytree(pretrained, tmp_path / "without", ignore=shutil.ignore_patterns("tokenizer*"))
    config = pretrained_config(without)
    _, preprocess, _ = build(config)
    with pytest.raises(UserError, match="no tokenizer could be loaded"):
        preprocess(batch_for(config))


def test_smolvlm_reads_smaller_pictures(tmp_path: Path) -> None:
    config = pretrained_config(write_pretrained(tmp_path, "smolvlm"), image_size=(16, 16))
    policy, preprocess, _ = build(config)
    batch = preprocess(batch_for(config))
    words = batch[OBS_LANGUAGE_TOKENS].shape[1]
    assert policy.prefix(batch).mask.shape[1] == 3 * (16 // 4 // 2) ** 2 + words
