"""The action expert: from a state, noisy actions and a time to the velocity of the actions.

Its tokens are one for the state and one for each action. Each of its layers attends to the keys and values that the
same layer of the prefix left behind, and to its own: the prefix is read once, whatever the number of Euler steps.
Structure as in pi0 (Black et al. 2024); adaptive norms as in pi0.5 (Physical Intelligence 2025), after DiT (Peebles
and Xie 2023).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

NORM_EPS = 1e-6
type Rotary = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class PrefixCache:
    """What the prefix leaves for the expert.

    keys, values: per layer (B, kv_heads, P, head_dim), keys with their rotary positions.
    mask: (B, P), true for tokens that count; the others are padding of instructions.
    """

    keys: Sequence[Tensor]
    values: Sequence[Tensor]
    mask: Tensor

    def repeated(self, times: int) -> PrefixCache:
        """Each sample `times` times in a row."""
        if times == 1:
            return self
        return PrefixCache(
            [k.repeat_interleave(times, dim=0) for k in self.keys],
            [v.repeat_interleave(times, dim=0) for v in self.values],
            self.mask.repeat_interleave(times, dim=0),
        )


def attention_mask(prefix_mask: Tensor, actions: int) -> Tensor:
    """Who sees whom, true where a token (row) sees another (column): (B, 1, 1 + actions, P + 1 + actions).

    The state sees the prefix and itself, actions see the prefix, the state and each other. `prefix_mask` is (B, P).
    """
    batch, length = prefix_mask.shape
    own = torch.ones(1 + actions, 1 + actions, dtype=torch.bool, device=prefix_mask.device)
    own[0, 1:] = False
    prefix = prefix_mask[:, None, :].expand(batch, 1 + actions, length)
    return torch.cat([prefix, own.expand(batch, -1, -1)], dim=-1).unsqueeze(1)


def expert_context(
    prefix: PrefixCache, actions: int, rotary: Callable[[Tensor, Tensor], Rotary], like: Tensor
) -> list[Tensor]:
    """What the expert takes of a prefix: the mask, cosines, sines, and the layers' keys and values.

    Args:
        prefix: its keys and values; positions go on after its last token that counts.
        actions: length of a chunk.
        rotary: cosines and sines of positions (B, 1 + actions), of the prefix's kind.
        like: has the expert's type, which may be finer than a frozen prefix's.
    """
    positions = prefix.mask.sum(dim=1, keepdim=True) + torch.arange(1 + actions, device=prefix.mask.device)
    cosines, sines = rotary(like, positions)
    return [attention_mask(prefix.mask, actions), cosines, sines, *prefix.keys, *prefix.values]


def time_embedding(times: Tensor, dim: int, min_period: float, max_period: float) -> Tensor:
    """Times (B,) in [0, 1] as sines and cosines (B, dim), with periods that grow geometrically; in float32.

    Formula and the usual periods, 4e-3 to 4, as in pi0.
    """
    half = dim // 2
    fraction = torch.linspace(0.0, 1.0, half, device=times.device, dtype=torch.float32)
    periods = min_period * (max_period / min_period) ** fraction
    angles = times.float()[:, None] * (2.0 * math.pi / periods)
    return torch.cat([angles.sin(), angles.cos()], dim=-1)


def rotate(x: Tensor, rotary: Rotary) -> Tensor:
    """Rotary position embedding (Su et al. 2021) of x (B, heads, S, D), with cosines and sines (B, S, D) of halves."""
    cos, sin = (r.unsqueeze(1).to(x.dtype) for r in rotary)
    first, second = x.chunk(2, dim=-1)
    return x * cos + torch.cat([-second, first], dim=-1) * sin


class Norm(nn.Module):
    """Root-mean-square norm; with a condition, its scale, shift and gate (of what follows) are linear in that."""

    def __init__(self, width: int, condition_dim: int | None, gated: bool = True) -> None:
        super().__init__()
        self.width, self.gated = width, gated
        self.weight = nn.Parameter(torch.ones(width)) if condition_dim is None else None
        self.modulation = None if condition_dim is None else nn.Linear(condition_dim, (3 if gated else 2) * width)
        if self.modulation is not None:
            # Zero: at first every layer lets its input pass (DiT), which keeps deep experts trainable.
            nn.init.zeros_(self.modulation.weight)
            nn.init.zeros_(self.modulation.bias)

    def forward(self, x: Tensor, condition: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """Maps x (B, S, width) and condition (B, D) or None to the normed x and the gate (B, 1, width) or None."""
        if torch.onnx.is_in_onnx_export():  # which has no word for it
            y = x * torch.rsqrt(x.square().mean(dim=-1, keepdim=True) + NORM_EPS)
        else:
            y = functional.rms_norm(x, (self.width,), None, NORM_EPS)
        if self.modulation is None:
            return y * self.weight, None
        scale, shift, *gate = self.modulation(condition).unsqueeze(1).split(self.width, dim=-1)
        return y * (1.0 + scale) + shift, gate[0] if self.gated else None


class ExpertLayer(nn.Module):
    """Attention to prefix and own tokens, then a gated feed-forward network."""

    def __init__(
        self, width: int, hidden: int, heads: int, kv_heads: int, head_dim: int, condition_dim: int | None
    ) -> None:
        super().__init__()
        self.head_dim = head_dim
        self.norm1 = Norm(width, condition_dim)
        self.q_proj = nn.Linear(width, heads * head_dim, bias=False)
        self.k_proj = nn.Linear(width, kv_heads * head_dim, bias=False)
        self.v_proj = nn.Linear(width, kv_heads * head_dim, bias=False)
        self.o_proj = nn.Linear(heads * head_dim, width, bias=False)
        self.norm2 = Norm(width, condition_dim)
        self.gate_proj = nn.Linear(width, hidden, bias=False)
        self.up_proj = nn.Linear(width, hidden, bias=False)
        self.down_proj = nn.Linear(hidden, width, bias=False)

    def forward(
        self, x: Tensor, condition: Tensor | None, keys: Tensor, values: Tensor, mask: Tensor, rotary: Rotary
    ) -> Tensor:
        """Maps x (B, S, width) to the same shape; keys and values (B, kv_heads, P, head_dim) are the prefix's."""
        normed, gate = self.norm1(x, condition)
        q, k, v = (self._heads(proj(normed)) for proj in (self.q_proj, self.k_proj, self.v_proj))
        k = torch.cat([keys.to(k.dtype), rotate(k, rotary)], dim=2)
        v = torch.cat([values.to(v.dtype), v], dim=2)
        grouped = not torch.onnx.is_in_onnx_export()
        if not grouped:  # ONNX has no word for heads that share keys and values
            k, v = (one.repeat_interleave(q.shape[1] // one.shape[1], dim=1) for one in (k, v))
        seen = functional.scaled_dot_product_attention(rotate(q, rotary), k, v, attn_mask=mask, enable_gqa=grouped)
        x = _add(x, self.o_proj(seen.transpose(1, 2).flatten(2)), gate)
        normed, gate = self.norm2(x, condition)
        y = self.down_proj(functional.gelu(self.gate_proj(normed), approximate="tanh") * self.up_proj(normed))
        return _add(x, y, gate)

    def _heads(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (-1, self.head_dim)).transpose(1, 2)


class ActionExpert(nn.Module):
    """State token and action tokens through the layers, to one velocity per action.

    Args:
        state_dim: components of the state that enter.
        action_dim: components of an action.
        width: of the expert's tokens.
        hidden: width inside its feed-forward networks.
        layers: as many as the prefix has.
        heads: of the queries; `kv_heads` and `head_dim` are the prefix's.
        adaptive: time through adaptive norms (pi0.5) instead of joined to each action token by an MLP (pi0).
        periods: shortest and longest of the time embedding.
    """

    def __init__(
        self,
        state_dim: int,
        action_dim: int,
        width: int,
        hidden: int,
        layers: int,
        heads: int,
        kv_heads: int,
        head_dim: int,
        adaptive: bool,
        periods: tuple[float, float],
    ) -> None:
        super().__init__()
        self.width, self.periods, self.adaptive = width, periods, adaptive
        self.embed_state = nn.Linear(state_dim, width)
        self.embed_action = nn.Linear(action_dim, width)
        # pi0 mixes time into each action token, pi0.5 makes one condition of it.
        self.time_mlp = nn.Sequential(
            nn.Linear(width if adaptive else 2 * width, width), nn.SiLU(), nn.Linear(width, width)
        )
        condition_dim = width if adaptive else None
        self.layers = nn.ModuleList(
            [ExpertLayer(width, hidden, heads, kv_heads, head_dim, condition_dim) for _ in range(layers)]
        )
        self.norm = Norm(width, condition_dim, gated=False)
        self.head = nn.Linear(width, action_dim)

    def embed(self, state: Tensor, noisy_actions: Tensor, times: Tensor) -> tuple[Tensor, Tensor | None]:
        """Tokens (B, 1 + T, width) and, for adaptive norms, the condition (B, width)."""
        time = time_embedding(times, self.width, *self.periods).to(self.head.weight.dtype)
        actions = self.embed_action(noisy_actions)
        condition = None
        if self.adaptive:
            condition = functional.silu(self.time_mlp(time))
        else:
            actions = self.time_mlp(torch.cat([actions, time.unsqueeze(1).expand_as(actions)], dim=-1))
        return torch.cat([self.embed_state(state).unsqueeze(1), actions], dim=1), condition

    def forward(
        self,
        state: Tensor,
        noisy_actions: Tensor,
        times: Tensor,
        mask: Tensor,
        cosines: Tensor,
        sines: Tensor,
        *keys_and_values: Tensor,
    ) -> Tensor:
        """Predict the velocity, noise - actions; what follows the times is of `expert_context`.

        Args:
            state: (B, S), normalised.
            noisy_actions: (B, T, A), normalised.
            times: (B,) in [0, 1], 1 is noise.
            mask: who sees whom, see `attention_mask`.
            cosines: of the positions of state and actions, (B, 1 + T, head_dim).
            sines: likewise.
            keys_and_values: of the prefix, all layers' keys and then all layers' values.

        Returns:
            (B, T, A).
        """
        x, condition = self.embed(state, noisy_actions, times)
        keys, values = keys_and_values[: len(self.layers)], keys_and_values[len(self.layers) :]
        for layer, k, v in zip(self.layers, keys, values, strict=True):
            x = layer(x, condition, k, v, mask, (cosines, sines))
        return self.head(self.norm(x[:, 1:], condition)[0])


def _add(x: Tensor, y: Tensor, gate: Tensor | None) -> Tensor:
    return x + y if gate is None else x + y * gate
