"""The denoiser: a transformer from noisy actions, a diffusion time and observations to the noise (or the actions).

Structure as in Diffusion Policy (Chi et al. 2023), transformer variant: condition tokens are the time and one
token per observed step; action tokens attend to themselves causally and to the condition by a memory mask.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from torch import Tensor, nn

LONGEST_WAVELENGTH = 10_000.0  # of the sinusoidal time embedding, as in Vaswani et al. 2017
INITIAL_STD = 0.02


def causal_mask(length: int) -> Tensor:
    """Boolean (length, length), true where row i must not see column j: j > i."""
    index = torch.arange(length)
    return index[None, :] > index[:, None]


def memory_mask(horizon: int, conditions: int) -> Tensor:
    """Boolean (horizon, conditions), true where action i must not see condition j: unless i >= j - 1.

    Condition 0 is the time and condition j the observation of offset index j - 1, so that an action sees no
    observation that lies in its future.
    """
    action, condition = torch.arange(horizon), torch.arange(conditions)
    return action[:, None] < condition[None, :] - 1


class SinusoidalEmbedding(nn.Module):
    """Diffusion times to vectors of sines and cosines; no parameters."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        half = dim // 2
        rates = torch.exp(torch.arange(half) * (-math.log(LONGEST_WAVELENGTH) / max(1, half - 1)))
        self.register_buffer("rates", rates, persistent=False)

    def forward(self, times: Tensor) -> Tensor:
        """Maps (B,) to (B, dim)."""
        angles = times[:, None].to(self.rates.dtype) * self.rates
        return torch.cat([angles.sin(), angles.cos()], dim=-1)


class DenoisingTransformer(nn.Module):
    """Encoder over condition tokens and causal decoder over action tokens, pre-norm, GELU, feed-forward 4 x width."""

    def __init__(
        self,
        action_dim: int,
        feature_dim: int,
        horizon: int,
        n_obs_steps: int,
        width: int = 512,
        n_heads: int = 8,
        n_decoder_layers: int = 12,
        n_condition_layers: int = 4,
        dropout_embedding: float = 0.0,
        dropout: float = 0.3,
    ) -> None:
        super().__init__()
        conditions = 1 + n_obs_steps
        self.time_embedding = SinusoidalEmbedding(width)
        self.embed_observation = nn.Linear(feature_dim, width)
        self.embed_action = nn.Linear(action_dim, width)
        self.condition_position = nn.Parameter(torch.zeros(1, conditions, width))
        self.action_position = nn.Parameter(torch.zeros(1, horizon, width))
        self.dropout = nn.Dropout(dropout_embedding)
        layer = {
            "d_model": width,
            "nhead": n_heads,
            "dim_feedforward": 4 * width,
            "dropout": dropout,
            "activation": "gelu",
            "batch_first": True,
            "norm_first": True,
        }
        self.condition_encoder: nn.Module
        if n_condition_layers:
            self.condition_encoder = nn.TransformerEncoder(
                nn.TransformerEncoderLayer(**layer), n_condition_layers, enable_nested_tensor=False
            )
        else:
            self.condition_encoder = nn.Sequential(nn.Linear(width, 4 * width), nn.Mish(), nn.Linear(4 * width, width))
        self.decoder = nn.TransformerDecoder(nn.TransformerDecoderLayer(**layer), n_decoder_layers)
        self.norm = nn.LayerNorm(width)
        self.head = nn.Linear(width, action_dim)
        self.register_buffer("causal_mask", causal_mask(horizon), persistent=False)
        self.register_buffer("memory_mask", memory_mask(horizon, conditions), persistent=False)
        self.apply(_initialise)
        for position in (self.condition_position, self.action_position):
            nn.init.normal_(position, std=INITIAL_STD)

    def layers(self) -> Iterator[nn.Module]:
        """Of both transformers, from the condition to the actions."""
        for stack in (self.condition_encoder, self.decoder):
            yield from getattr(stack, "layers", ())

    def forward(self, noisy_actions: Tensor, times: Tensor, features: Tensor) -> Tensor:
        """Predict, for each action of a chunk, what the training target is (noise or clean action).

        Args:
            noisy_actions: (B, horizon, action_dim), normalised.
            times: (B,) diffusion steps, integers.
            features: (B, n_obs_steps, feature_dim) from the observation encoder.

        Returns:
            (B, horizon, action_dim).
        """
        return self.decode(noisy_actions, self.condition(times, features))

    def condition(self, times: Tensor, features: Tensor) -> Tensor:
        """Tokens of times (B,) and observations, as in `forward`, for `decode`: (B, 1 + n_obs_steps, width)."""
        time = self.time_embedding(times).unsqueeze(1).to(features.dtype)
        condition = torch.cat([time, self.embed_observation(features)], dim=1)
        memory: Tensor = self.condition_encoder(self.dropout(condition + self.condition_position))
        return memory

    def decode(self, noisy_actions: Tensor, memory: Tensor) -> Tensor:
        """What `forward` predicts, from noisy actions and what `condition` gives."""
        x = self.dropout(self.embed_action(noisy_actions) + self.action_position)
        # Told nothing about the masks, PyTorch compares them with a causal one of its own, each time.
        x = self.decoder(x, memory, self.causal_mask, self.memory_mask, tgt_is_causal=False, memory_is_causal=False)
        out: Tensor = self.head(self.norm(x))
        return out


def _initialise(module: nn.Module) -> None:
    if isinstance(module, nn.Linear):
        nn.init.normal_(module.weight, std=INITIAL_STD)
        if module.bias is not None:
            nn.init.zeros_(module.bias)
    elif isinstance(module, nn.MultiheadAttention):
        nn.init.normal_(module.in_proj_weight, std=INITIAL_STD)
        nn.init.zeros_(module.in_proj_bias)
    elif isinstance(module, nn.LayerNorm):
        nn.init.ones_(module.weight)
        nn.init.zeros_(module.bias)
