"""The prefix: pictures and an instruction through a vision model and a language model, to keys and values.

Pictures and words see each other in both directions. The language model is a decoder of `transformers` (Llama or
Gemma), read layer by layer through its key/value cache; it is small and new, or a pretrained one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import torch
from lerobot.utils.constants import OBS_LANGUAGE_ATTENTION_MASK, OBS_LANGUAGE_TOKENS
from torch import Tensor, nn

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.images import center_crop, random_crop, resize, to_signed_float
from robocasa_lerobot.policies.common.language import PADDING
from robocasa_lerobot.policies.common.vision import ConvNet
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.expert import PrefixCache, Rotary, rotate


class LastLayer(nn.Module):
    """Of the last layer of a language model only what makes its keys and values; nobody reads the rest."""

    def __init__(self, layer: nn.Module) -> None:
        super().__init__()
        attention: Any = layer.self_attn
        self.input_layernorm = layer.input_layernorm
        self.k_proj, self.v_proj = attention.k_proj, attention.v_proj
        self.head_dim, self.layer_idx = int(attention.head_dim), int(attention.layer_idx)

    def forward(self, hidden_states: Tensor, position_embeddings: Rotary, past_key_values: Any, **_: Any) -> Tensor:
        """Puts keys and values (B, kv_heads, P, head_dim) into the cache; the tokens stay as they are."""
        normed = self.input_layernorm(hidden_states)
        k, v = (p(normed).unflatten(-1, (-1, self.head_dim)).transpose(1, 2) for p in (self.k_proj, self.v_proj))
        past_key_values.update(rotate(k, position_embeddings), v, self.layer_idx)
        return hidden_states


class Prefix(nn.Module, ABC):
    """What both kinds of prefix share; `parts` says which modules see and which read."""

    language_model: nn.Module
    image_size: tuple[int, int]

    def __init__(self, config: FlowVlaConfig) -> None:
        super().__init__()
        self.config = config
        self.image_keys = list(config.image_features)

    @abstractmethod
    def embed_images(self, images: Tensor) -> Tensor:
        """Pictures (N, 3, H, W) in [-1, 1] as tokens (N, T, width)."""

    @abstractmethod
    def embed_words(self, tokens: Tensor) -> Tensor:
        """Tokens of the preprocessor as vectors (B, W, width)."""

    @abstractmethod
    def parts(self) -> dict[str, list[nn.Module]]:
        """The modules of `vision` and of `language`."""

    def checkpoint_config(self) -> dict[str, Any] | None:
        """What a checkpoint needs to build this prefix without the pretrained model."""
        return None

    @property
    def shape(self) -> dict[str, int]:
        """Layers, heads, kv_heads and head_dim of the language model, which the expert takes over."""
        config: Any = self.language_model.config
        return {
            "layers": int(config.num_hidden_layers),
            "heads": int(config.num_attention_heads),
            "kv_heads": int(config.num_key_value_heads),
            "head_dim": int(self.language_model.layers[-1].head_dim),
        }

    def rotary(self, like: Tensor, positions: Tensor) -> Rotary:
        """Cosines and sines (B, S, head_dim) of positions (B, S)."""
        cos, sin = self.language_model.rotary_emb(like, positions)
        return cos, sin

    def tokens(self, batch: dict[str, Tensor], generator: torch.Generator | None) -> tuple[Tensor, Tensor]:
        """All tokens (B, P, width), pictures first, and the mask (B, P) of those that count.

        Args:
            batch: cameras (B, 3, H, W) as uint8 or float in [0, 1]; language tokens and their mask.
            generator: for the random crops while training; None uses the global one.
        """
        if OBS_LANGUAGE_TOKENS not in batch:
            raise UserError(
                f"the batch has no {OBS_LANGUAGE_TOKENS!r}: pass it through the policy's preprocessor, which makes "
                "tokens of the instruction."
            )
        pictures = torch.cat([self._prepare(batch[key], generator) for key in self.image_keys])
        seen = torch.cat(self._place(self.embed_images(pictures)), dim=1)
        words = self.embed_words(batch[OBS_LANGUAGE_TOKENS])
        mask = batch[OBS_LANGUAGE_ATTENTION_MASK].bool()
        dtype = self.language_model.layers[-1].k_proj.weight.dtype
        tokens = torch.cat([seen.to(dtype), words.to(dtype)], dim=1)
        return tokens, torch.cat([mask.new_ones(seen.shape[:2]), mask], dim=1)

    def forward(self, batch: dict[str, Tensor], generator: torch.Generator | None = None) -> PrefixCache:
        """Read a batch once; arguments as for `tokens`."""
        from transformers import DynamicCache

        # All frozen: no activations are kept. Asked of the parameters, as LoRA adds some to frozen models.
        learns = any(p.requires_grad for p in self.parameters())
        with torch.set_grad_enabled(torch.is_grad_enabled() and learns):
            tokens, mask = self.tokens(batch, generator)
            unseen = torch.zeros(mask.shape, dtype=tokens.dtype, device=tokens.device)
            unseen = unseen.masked_fill(~mask, torch.finfo(tokens.dtype).min)[:, None, None, :]
            cache = DynamicCache()
            self.language_model(
                inputs_embeds=tokens,
                attention_mask=unseen.expand(-1, 1, mask.shape[1], -1),  # everybody sees all that counts
                position_ids=(mask.cumsum(dim=1) - 1).clamp(min=0),
                past_key_values=cache,
                use_cache=True,
            )
        return PrefixCache([layer.keys for layer in cache.layers], [layer.values for layer in cache.layers], mask)

    def freeze(self) -> None:
        """Make the parts that the configuration freezes constant, and hold them in `frozen_dtype`."""
        for part, frozen in (("vision", self.config.freeze_vision), ("language", self.config.freeze_language)):
            for module in self.parts()[part] if frozen else ():
                module.requires_grad_(False)
                for parameter in module.parameters():  # not buffers: frequencies of positions stay exact
                    parameter.data = parameter.data.to(getattr(torch, self.config.frozen_dtype))
        self.train(self.training)

    def train(self, mode: bool = True) -> Prefix:
        """As always, but frozen modules stay in eval mode (GR00T's rule): no dropout where nothing can adapt to it."""
        super().train(mode)
        for part, frozen in (("vision", self.config.freeze_vision), ("language", self.config.freeze_language)):
            for module in self.parts()[part] if frozen else ():
                module.eval()
        return self

    def _place(self, seen: Tensor) -> list[Tensor]:
        """Tokens of all pictures (cameras * B, T, width), by camera."""
        return list(seen.chunk(len(self.image_keys)))

    def _prepare(self, images: Tensor, generator: torch.Generator | None) -> Tensor:
        x = resize(images.squeeze(1) if images.ndim == 5 else images, self.image_size)
        fraction = self.config.crop_fraction
        x = random_crop(x, fraction, generator) if self.training else center_crop(x, fraction)
        return to_signed_float(resize(x, self.image_size))

    def _keep_what_is_read(self) -> None:
        """Drop what only the language model's own output would need."""
        model: Any = self.language_model
        model.layers[-1] = LastLayer(model.layers[-1])
        model.norm = nn.Identity()


class ScratchPrefix(Prefix):
    """Convolutions and a transformer over the patches of each picture, hashed words, and a new Llama over all."""

    def __init__(self, config: FlowVlaConfig) -> None:
        from transformers import LlamaConfig, LlamaModel

        super().__init__(config)
        assert config.image_size is not None  # set by the configuration
        height, breadth = config.image_size
        self.image_size = height, breadth
        width = config.prefix_width
        self.vision = PatchTransformer(
            config.vision_channels, width, config.prefix_heads, config.vision_layers, self.image_size
        )
        self.camera_embedding = nn.Embedding(len(self.image_keys), width)
        nn.init.normal_(self.camera_embedding.weight, std=0.02)
        self.word_embedding = HashedWordEmbedding(config.language_buckets, width)
        self.language_model = LlamaModel(
            LlamaConfig(
                vocab_size=1,
                hidden_size=width,
                intermediate_size=4 * width,
                num_hidden_layers=config.prefix_depth,
                num_attention_heads=config.prefix_heads,
                num_key_value_heads=config.prefix_kv_heads,
                head_dim=config.prefix_head_dim,
            )
        )
        self.language_model.embed_tokens = None  # `word_embedding` does its work
        self._keep_what_is_read()

    def embed_images(self, images: Tensor) -> Tensor:
        """Pictures as tokens, one for each patch."""
        return self.vision(images.to(self.vision.position.dtype))

    def embed_words(self, tokens: Tensor) -> Tensor:
        """Hashed words (B, W, pieces) as vectors."""
        return self.word_embedding(tokens)

    def parts(self) -> dict[str, list[nn.Module]]:
        """The modules of `vision` and of `language`."""
        return {
            "vision": [self.vision, self.camera_embedding],
            "language": [self.language_model, self.word_embedding],
        }

    def _place(self, seen: Tensor) -> list[Tensor]:
        return list(seen.unflatten(0, (len(self.image_keys), -1)) + self.camera_embedding.weight[:, None, None, :])


class PatchTransformer(nn.Module):
    """A small vision transformer whose patches come from strided convolutions.

    Convolutions before attention make small transformers train faster and with less data (Xiao et al. 2021).
    """

    def __init__(self, channels: list[int], width: int, heads: int, layers: int, image_size: tuple[int, int]) -> None:
        super().__init__()
        self.stem = ConvNet(channels, None)
        self.project = nn.Linear(channels[-1], width)
        height, breadth = image_size
        for _ in channels:  # each convolution halves, rounding up
            height, breadth = (height + 1) // 2, (breadth + 1) // 2
        self.position = nn.Parameter(torch.randn(1, height * breadth, width) * 0.02)
        self.layers = nn.ModuleList(
            [
                nn.TransformerEncoderLayer(
                    width, heads, 4 * width, dropout=0.0, activation="gelu", batch_first=True, norm_first=True
                )
                for _ in range(layers)
            ]
        )

    def forward(self, images: Tensor) -> Tensor:
        """Maps images (N, 3, H, W) in [-1, 1] to (N, H * W / 4^len(channels), width)."""
        x = self.stem(images, images)  # without FiLM the condition is not looked at
        x = self.project(x.flatten(2).transpose(1, 2)) + self.position
        for layer in self.layers:
            x = layer(x)
        return x


class HashedWordEmbedding(nn.Module):
    """One vector per word: the mean of the embeddings of its hashed pieces."""

    def __init__(self, buckets: int, width: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(1 + buckets, width, padding_idx=PADDING)

    def forward(self, tokens: Tensor) -> Tensor:
        """Maps tokens (B, W, pieces) to (B, W, width)."""
        pieces = (tokens != PADDING).sum(dim=-1, keepdim=True).clamp(min=1)
        return self.embedding(tokens).sum(dim=-2) / pieces
