"""Shared pieces of policies: images, text encoders and their processor steps, safe statistics."""

from __future__ import annotations

import copy
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.policies.factory import make_pre_post_processors
from policy_support import batch_for, tiny_config, unit_stats
from torch.nn import functional

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.attention import short_attention
from robocasa_lerobot.policies.common.images import center_crop, crop_size, random_crop, resize, to_signed_float
from robocasa_lerobot.policies.common.language import (
    PADDING,
    SUBWORDS,
    ClipTextEncoder,
    TokenEncoder,
    hashed_words,
    token_tensor,
)
from robocasa_lerobot.policies.common.language_processor import ClipTokensStep
from robocasa_lerobot.policies.common.statistics import leave_components, widen_constant_components
from robocasa_lerobot.policies.common.vision import ConvNet, FeatureGrid, SpatialSoftmax
from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import DiffusionTransformerPolicy
from robocasa_lerobot.policies.diffusion_transformer.processor_diffusion_transformer import QUATERNION_COMPONENTS


def test_images_are_scaled_and_cropped() -> None:
    assert to_signed_float(torch.tensor([0, 255], dtype=torch.uint8)).tolist() == [-1.0, 1.0]
    assert to_signed_float(torch.tensor([0.0, 0.5, 1.0])).tolist() == [-1.0, 0.0, 1.0]
    assert crop_size((256, 256), 0.875) == (224, 224)
    images = torch.arange(2 * 1 * 8 * 8).view(2, 1, 8, 8)
    assert torch.equal(center_crop(images, 0.5), images[..., 2:6, 2:6])
    grey = torch.full((1, 3, 64, 64), 51, dtype=torch.uint8)
    torch.testing.assert_close(resize(grey, (16, 16)), torch.full((1, 3, 16, 16), 0.2))
    assert resize(grey, (64, 64)) is grey


def test_random_crops_are_reproducible_and_reach_every_place() -> None:
    images = torch.arange(36.0).view(1, 1, 6, 6).expand(400, 1, 6, 6)
    a, b = (random_crop(images, 0.5, torch.Generator().manual_seed(3)) for _ in range(2))
    assert torch.equal(a, b)
    corners = {int(crop[0, 0, 0]) for crop in a}
    assert corners == {6 * row + column for row in range(4) for column in range(4)}
    for crop in a:
        row, column = divmod(int(crop[0, 0, 0]), 6)
        assert torch.equal(crop[0], images[0, 0, row : row + 3, column : column + 3])


@pytest.mark.parametrize("shape", [(5, 6, 8), (5, 3, 6, 8), (5, 2, 3, 6, 8)])
def test_crops_by_one_kernel_are_those_by_slices(shape: tuple[int, ...]) -> None:
    """As on a GPU, and in what `torch.compile` translates."""
    images = torch.rand(shape, generator=torch.Generator().manual_seed(0))
    torch._dynamo.reset()
    compiled = torch.compile(random_crop, backend="eager", fullgraph=True)
    torch.manual_seed(1)
    expected = random_crop(images, 0.7)
    torch.manual_seed(1)
    assert torch.equal(compiled(images, 0.7), expected)


def test_spatial_softmax_finds_a_peak() -> None:
    pool = SpatialSoftmax(1, 1)
    pool.to_keypoints.weight.data.fill_(1.0)
    pool.to_keypoints.bias.data.zero_()
    for row, column in [(0, 0), (2, 4), (4, 1)]:
        heat = torch.zeros(1, 1, 5, 5)
        heat[0, 0, row, column] = 100.0
        expected = torch.tensor([[column / 2 - 1, row / 2 - 1]])
        torch.testing.assert_close(pool(heat), expected)


def test_a_feature_grid_keeps_what_is_in_each_cell() -> None:
    images = torch.zeros(1, 2, 6, 6)
    images[0, 1, 4, 1] = 8.0  # second channel, lower left of 2x2 cells
    grid = FeatureGrid(2, 2)
    expected = torch.zeros(1, 8)
    expected[0, 4 + 2] = 8.0 / 9
    torch.testing.assert_close(grid(images), expected)
    torch.testing.assert_close(FeatureGrid(2, 6)(images), images.flatten(1))
    assert (grid.features, FeatureGrid(2, 6).features) == (8, 72)


@pytest.mark.parametrize(("stem", "side"), [(2, 64), (2, 60), (4, 64), (4, 60)])
def test_a_convnet_ends_at_the_resolution_that_it_names(stem: int, side: int) -> None:
    net = ConvNet([8, 16, 16], None, stem)
    out = net(torch.rand(2, 3, side, side), torch.zeros(2, 1))
    expected = -(-side // (4 * stem))  # rounded up
    assert out.shape == (2, 16, expected, expected)


@pytest.mark.costly
def test_hashed_words() -> None:
    words = hashed_words("Open the LEFT drawer!", 32, 100)
    assert words == hashed_words("open the left drawer!", 32, 100)
    assert len(words) == 5
    assert all(len(word) == SUBWORDS and all(0 <= token <= 100 for token in word) for word in words)
    assert len(hashed_words("a b c d", 3, 100)) == 3
    # An unseen word shares trigrams with a known one.
    (drawer,), (drawers,) = hashed_words("drawer", 1, 10**6), hashed_words("drawers", 1, 10**6)
    assert len((set(drawer) & set(drawers)) - {PADDING}) >= 4
    code = "from robocasa_lerobot.policies.common.language import hashed_words as h; print(h('open it', 4, 1000))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == str(hashed_words("open it", 4, 1000))  # Python's own hash differs between processes


def test_token_encoder_reads_words_in_order_and_ignores_padding() -> None:
    torch.manual_seed(0)
    encoder = TokenEncoder(buckets=256, max_words=12, dim=16).eval()

    def encode(*texts: str) -> torch.Tensor:
        tokens = token_tensor(list(texts), 12, 256)
        return encoder(tokens, (tokens != PADDING).any(dim=-1))

    a = encode(
        "put the cup left of the bowl", "put the bowl left of the cup", "open", "", "put the cup left of the bowl"
    )
    assert a.shape == (5, 16)
    assert torch.isfinite(a).all()
    assert torch.equal(a[0], a[4])
    assert (a[0] - a[1]).abs().max() > 1e-3
    for i, text in enumerate(["put the cup left of the bowl", "put the bowl left of the cup", "open", ""]):
        torch.testing.assert_close(encode(text)[0], a[i])


def test_instructions_are_encoded_alike_each_once_and_sample_by_sample() -> None:
    """On a CPU each instruction is encoded once; on a GPU, and compiled, each sample's, with all its padding."""
    torch.manual_seed(0)
    encoder = TokenEncoder(buckets=256, max_words=12, dim=16)
    tokens = token_tensor(["open the drawer", "close it", "open the drawer", ""], 12, 256)
    mask = (tokens != PADDING).any(dim=-1)
    compiled = torch.compile(encoder, backend="eager", fullgraph=True)
    torch.testing.assert_close(compiled(tokens, mask), encoder(tokens, mask))


def test_an_instruction_that_is_asked_for_again_is_encoded_by_the_present_weights() -> None:
    torch.manual_seed(0)
    encoder = TokenEncoder(buckets=256, max_words=12, dim=16).eval()
    tokens = token_tensor(["open the drawer"], 12, 256)
    mask = (tokens != PADDING).any(dim=-1)
    encoded: list[int] = []
    own = encoder._encode_each_once
    encoder._encode_each_once = lambda *inputs: encoded.append(1) or own(*inputs)  # type: ignore[func-returns-value,method-assign]

    @torch.inference_mode()
    def sampled() -> torch.Tensor:
        return encoder(tokens, mask)

    @torch.no_grad()
    def fresh() -> torch.Tensor:
        return own(tokens, mask)

    first = sampled()
    with torch.no_grad():
        encoder(tokens, mask).zero_()  # what a caller does with it changes nothing
    assert torch.equal(sampled(), first)
    assert len(encoded) == 1
    copied = copy.deepcopy(encoder)  # as for a moving average of the weights
    with torch.no_grad():
        assert torch.equal(copied(tokens, mask), first)
    assert encoder(tokens, mask).requires_grad  # with gradients nothing is remembered
    with torch.no_grad():
        encoder.norm.bias += 1.0
    assert torch.equal(sampled(), fresh())
    encoder.norm.bias.data = encoder.norm.bias.data - 1.0
    assert torch.equal(sampled(), fresh())
    encoder.load_state_dict({name: 0.5 * weight for name, weight in encoder.state_dict().items()})
    assert torch.equal(sampled(), fresh())
    other = token_tensor(["close the drawer"], 12, 256)
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of values that a recording takes for constants, such as the number of words
        recorded = torch.jit.trace(encoder, (tokens, mask), check_trace=False)
        assert torch.equal(recorded(other, mask), own(other, mask)), "what is remembered is no constant of a recording"
    with torch.inference_mode():
        assert torch.equal(copy.deepcopy(encoder)(tokens, mask), fresh()), "weights without a count of their changes"
    encoder.train()
    encoder.norm.bias.data.add_(1.0)  # which no counter notices
    encoder.eval()
    assert torch.equal(sampled(), fresh())


def test_constant_components_keep_their_scale() -> None:
    stats = {
        contract.STATE_KEY: {
            "min": np.array([0.0, 0.7, 1.0]),
            "max": np.array([2.0, 0.7 + 1e-9, 1.5]),
            "mean": np.array([1.0, 0.7, 1.2]),
            "std": np.array([0.5, 1e-10, 0.1]),
        },
        "untouched": {"mean": np.zeros(1)},
    }
    safe = widen_constant_components(stats, (contract.STATE_KEY, contract.ACTION_KEY), 1e-3)
    np.testing.assert_allclose(safe[contract.STATE_KEY]["min"], [0.0, -0.3, 1.0])
    np.testing.assert_allclose(safe[contract.STATE_KEY]["max"], [2.0, 1.7, 1.5])
    np.testing.assert_allclose(safe[contract.STATE_KEY]["std"], [0.5, 1.0, 0.1])
    assert stats[contract.STATE_KEY]["std"][1] == 1e-10
    left = leave_components(stats, contract.STATE_KEY, [2])
    np.testing.assert_allclose(left[contract.STATE_KEY]["min"], [0.0, 0.7, -1.0])
    np.testing.assert_allclose(left[contract.STATE_KEY]["std"], [0.5, 1e-10, 1.0])


def test_quantiles_that_do_not_see_a_component_move_become_its_ends() -> None:
    ends = {"min": [0.0, 0.7, 0.0], "max": [1.0, 0.7, 1.0]}
    quantiles = {"q01": [0.1, 0.7, 0.0], "q99": [0.9, 0.7, 0.9], "q10": [0.2, 0.7, 0.0], "q90": [0.8, 0.7, 0.0]}
    stats = {contract.ACTION_KEY: {name: np.array(values) for name, values in (ends | quantiles).items()}}
    safe = widen_constant_components(stats, (contract.ACTION_KEY,), 1e-3)[contract.ACTION_KEY]
    np.testing.assert_allclose(safe["q01"], [0.1, -0.3, 0.0])
    np.testing.assert_allclose(safe["q99"], [0.9, 1.7, 0.9])
    np.testing.assert_allclose(safe["q10"], [0.2, -0.3, 0.0])
    np.testing.assert_allclose(safe["q90"], [0.8, 1.7, 1.0])  # the third: its end, where q10 is q90
    np.testing.assert_allclose(safe["min"], [0.0, -0.3, 0.0])


@pytest.mark.parametrize("mode", ["MIN_MAX", "MEAN_STD"])
def test_constant_dimensions_do_not_explode(mode: str) -> None:
    mapping = {"VISUAL": "IDENTITY", "STATE": mode, "ACTION": mode}
    config = tiny_config(state_indices=None)
    config.normalization_mapping = {
        k: type(next(iter(config.normalization_mapping.values())))(v) for k, v in mapping.items()
    }
    stats = unit_stats()
    torso = contract.component_names(contract.ACTION_PARTS).index("torso")
    for key, value in stats.items():
        value["mean"], value["std"] = np.zeros_like(value["min"]), np.ones_like(value["min"])
        for name in ("min", "max", "mean"):
            value[name][torso] = 0.25
        value["std"][torso] = 0.0
        assert key in (contract.STATE_KEY, contract.ACTION_KEY)
    preprocess, postprocess = make_pre_post_processors(config, dataset_stats=stats)
    raw = batch_for(config)
    raw["action"][..., torso] = 0.25 + 1e-6  # as after a detour over float32
    raw["action"][0, 0, torso] = 0.5  # a later dataset in which the torso moves
    out = preprocess(dict(raw))["action"][..., torso]
    assert out.abs().max() <= 0.26
    normalised = preprocess(dict(raw))["action"]
    torch.testing.assert_close(postprocess(normalised).double(), raw["action"], atol=1e-5, rtol=1e-5)


def test_published_state_normalisation_leaves_quaternions() -> None:
    names = contract.component_names(contract.STATE_PARTS)
    assert [names[i] for i in QUATERNION_COMPONENTS] == [f"{p}_q{c}" for p in ("base", "eef") for c in "xyzw"]
    stats = unit_stats()
    stats[contract.STATE_KEY]["max"] = np.full(contract.STATE_SIZE, 3.0)
    config = tiny_config(quaternions_as_they_are=True)
    preprocess, _ = make_pre_post_processors(config, dataset_stats=stats)
    raw = batch_for(config)
    state, out = raw[contract.STATE_KEY], preprocess(dict(raw))[contract.STATE_KEY]
    for i in range(contract.STATE_SIZE):
        expected = state[..., i] if i in QUATERNION_COMPONENTS else (state[..., i] + 1) / 2 - 1
        torch.testing.assert_close(out[..., i], expected)


@pytest.fixture(scope="module")
def clip_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small random CLIP text model with a tokenizer, as `save_pretrained` writes them."""
    from tokenizers import Tokenizer, models, pre_tokenizers, processors
    from transformers import CLIPTextConfig, CLIPTextModelWithProjection, PreTrainedTokenizerFast

    folder = tmp_path_factory.mktemp("small_clip")
    words = ["<pad>", "<unk>", "<start>", "<end>", "open", "close", "the", "left", "right", "drawer", "."]
    tokenizer = Tokenizer(models.WordLevel({w: i for i, w in enumerate(words)}, unk_token="<unk>"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    tokenizer.post_processor = processors.TemplateProcessing(
        single="<start> $A <end>", special_tokens=[("<start>", 2), ("<end>", 3)]
    )
    PreTrainedTokenizerFast(tokenizer_object=tokenizer, unk_token="<unk>", pad_token="<pad>").save_pretrained(folder)
    torch.manual_seed(1)
    config = CLIPTextConfig(
        vocab_size=len(words), hidden_size=16, intermediate_size=32, num_hidden_layers=1, num_attention_heads=2,
        projection_dim=12, bos_token_id=2, eos_token_id=3, pad_token_id=0,
    )  # fmt: skip
    CLIPTextModelWithProjection(config).save_pretrained(folder)
    return folder


def test_a_clip_in_half_precision_is_held_as_checkpoints_hold_it(clip_folder: Path, tmp_path: Path) -> None:
    from transformers import CLIPTextModelWithProjection

    half = tmp_path / "half"
    CLIPTextModelWithProjection.from_pretrained(clip_folder).half().save_pretrained(half)
    for saved in (True, False):
        encoder = ClipTextEncoder(str(half), None, saved)
        assert {p.dtype for p in encoder.text_model.parameters()} == {torch.float32}


@pytest.mark.parametrize("saved", [True, False])
def test_clip_policy_loads_offline(saved: bool, clip_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "clip"
    folder.symlink_to(clip_folder)
    config = tiny_config(text_encoder="clip", clip_path=str(folder), clip_saved=saved, language_concat=True)
    policy = DiffusionTransformerPolicy(config)
    preprocess, postprocess = make_pre_post_processors(config, dataset_stats=unit_stats())
    assert policy.observation_encoder.text_encoder.dim == 12
    raw = batch_for(config)
    batch = preprocess(dict(raw))
    assert batch["observation.language.tokens"].shape == (4, 77)
    policy.train()(batch)[0].backward()
    trained = {id(p) for group in policy.get_optim_params() for p in group["params"]}
    assert not trained & {id(p) for p in policy.observation_encoder.text_encoder.text_model.parameters()}
    checkpoint = tmp_path / "checkpoint"
    policy.save_pretrained(checkpoint)
    preprocess.save_pretrained(checkpoint)
    postprocess.save_pretrained(checkpoint)
    if saved:
        folder.unlink()  # everything is in the checkpoint
    loaded = DiffusionTransformerPolicy.from_pretrained(checkpoint)
    pre, _ = make_pre_post_processors(loaded.config, pretrained_path=str(checkpoint))
    again = pre(dict(raw))
    noise = torch.randn(4, config.horizon, contract.ACTION_SIZE)
    assert torch.equal(policy.predict_action_chunk(batch, noise), loaded.predict_action_chunk(again, noise))
    other = pre({**raw, "task": raw["task"][::-1]})
    assert not torch.equal(policy.predict_action_chunk(other, noise), policy.predict_action_chunk(batch, noise))
    if not saved:
        folder.unlink()
        with pytest.raises(UserError, match="Set clip_path to a folder"):
            DiffusionTransformerPolicy.from_pretrained(checkpoint)


def test_clip_memory_from_inference_serves_training(clip_folder: Path) -> None:
    config = tiny_config(text_encoder="clip", clip_path=str(clip_folder))
    policy = DiffusionTransformerPolicy(config)
    preprocess, _ = make_pre_post_processors(config, dataset_stats=unit_stats())
    batch = preprocess(batch_for(config))
    with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16):
        policy.predict_action_chunk(batch)
    (seen, *_) = policy.observation_encoder.text_encoder._memory.values()
    assert seen.dtype == torch.float32
    policy.train()(batch)[0].backward()


def test_clip_remembers_instructions(clip_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = tiny_config(text_encoder="clip", clip_path=str(clip_folder))
    policy = DiffusionTransformerPolicy(config)
    encoder = policy.observation_encoder.text_encoder
    tokens, mask = ClipTokensStep(path=str(clip_folder)).tokenize(["open the drawer", "close it"] * 3)
    sizes: list[int] = []
    forward = encoder.text_model.forward
    monkeypatch.setattr(encoder.text_model, "forward", lambda **kw: sizes.append(len(kw["input_ids"])) or forward(**kw))
    first = encoder(tokens, mask)
    assert torch.equal(first, encoder(tokens, mask))
    assert sizes == [1, 1]
    assert torch.equal(first[0], first[2])


def test_what_clip_makes_of_an_instruction_depends_on_no_other(clip_folder: Path) -> None:
    config = tiny_config(text_encoder="clip", clip_path=str(clip_folder))
    words = ["open the drawer", "close it", "open the left drawer .", "close the right drawer", "open it"]
    tokens, mask = ClipTokensStep(path=str(clip_folder)).tokenize(words)
    encoder = DiffusionTransformerPolicy(config).observation_encoder.text_encoder
    whole = encoder(tokens, mask)
    for i in reversed(range(len(words))):
        encoder._memory.clear()  # as after a restart
        assert torch.equal(encoder(tokens[i : i + 1], mask[i : i + 1])[0], whole[i])


@pytest.mark.parametrize("saved", [True, False])
def test_a_policy_with_clip_can_be_looked_at_without_its_weights(saved: bool, clip_folder: Path) -> None:
    config = tiny_config(text_encoder="clip", clip_path=str(clip_folder), clip_saved=saved)
    real = DiffusionTransformerPolicy(config)
    config = copy.deepcopy(config)
    config.device = "meta"
    with torch.device("meta"):
        shapes = DiffusionTransformerPolicy(config)
    assert all(parameter.is_meta for parameter in shapes.parameters())
    assert {n: p.shape for n, p in shapes.named_parameters()} == {n: p.shape for n, p in real.named_parameters()}


def test_missing_clip_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    missing = str(tmp_path / "nothing here")
    with pytest.raises(UserError, match="text_encoder to 'token'"):
        DiffusionTransformerPolicy(tiny_config(text_encoder="clip", clip_path=missing))
    with pytest.raises(UserError, match="the CLIP tokenizer could not be loaded"):
        ClipTokensStep(path=missing).tokenize(["open"])


def test_short_attention_is_the_same_attention() -> None:
    q, k, v = torch.randn(3, 2, 4, 10, 24, generator=torch.Generator().manual_seed(0)).unbind()
    fused = functional.scaled_dot_product_attention(q, k, v)
    with short_attention(q.device):
        plain = functional.scaled_dot_product_attention(q, k, v)
    torch.testing.assert_close(plain, fused, rtol=1e-5, atol=1e-6)
