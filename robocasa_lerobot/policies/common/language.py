"""Text encoders: instruction tokens to one vector per instruction.

`TokenEncoder` needs no vocabulary file: a word is the mean of hashed embeddings of itself and of its character
trigrams (Bojanowski et al. 2017), so an unseen word still shares its parts with known ones.
`ClipTextEncoder` is the frozen text tower of CLIP (Radford et al. 2021), as published for the benchmark.
"""

from __future__ import annotations

import re
import zlib
from functools import lru_cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.configuration import LANGUAGE_HEADS
from robocasa_lerobot.policies.common.transfer import each_once, is_plain_cpu, to_device, without_weights

SUBWORDS = 8  # per word: the word itself and its first seven trigrams
PADDING = 0  # token of no word; hashes are 1 ... buckets
_WORD = re.compile(r"\w+|[^\w\s]")

_CLIP_FIELDS = (
    "vocab_size",
    "hidden_size",
    "intermediate_size",
    "num_hidden_layers",
    "num_attention_heads",
    "max_position_embeddings",
    "hidden_act",
    "layer_norm_eps",
    "projection_dim",
    "pad_token_id",
    "bos_token_id",
    "eos_token_id",
)


@lru_cache(maxsize=8192)
def hashed_words(text: str, max_words: int, buckets: int) -> tuple[tuple[int, ...], ...]:
    """Tokens of an instruction: for each of its first `max_words` words, `SUBWORDS` integers in [0, buckets].

    Case does not matter. The hash is CRC-32, the same in every process and on every machine.
    """
    words = _WORD.findall(text.lower())[:max_words]
    return tuple(_hashed_word(word, buckets) for word in words)


def count_words(text: str) -> int:
    """How many words an instruction has; signs count as such."""
    return len(_WORD.findall(text.lower()))


def _hashed_word(word: str, buckets: int) -> tuple[int, ...]:
    marked = f"<{word}>"
    pieces = [marked, *(marked[i : i + 3] for i in range(len(marked) - 2) if len(marked) > 3)][:SUBWORDS]
    tokens = [1 + zlib.crc32(piece.encode()) % buckets for piece in pieces]
    return tuple(tokens + [PADDING] * (SUBWORDS - len(tokens)))


def token_tensor(texts: list[str], max_words: int, buckets: int) -> Tensor:
    """Tokens of instructions, int64 of shape (N, max_words, SUBWORDS), padded with `PADDING`."""
    out = torch.full((len(texts), max_words, SUBWORDS), PADDING, dtype=torch.int64)
    for i, text in enumerate(texts):
        words = hashed_words(text, max_words, buckets)
        if words:
            out[i, : len(words)] = torch.tensor(words)
    return out


class TokenEncoder(nn.Module):
    """Hashed words and their order to a vector, by one transformer layer; trained with the policy."""

    def __init__(self, buckets: int, max_words: int, dim: int) -> None:
        super().__init__()
        self.dim = dim
        self.embedding = nn.Embedding(1 + buckets, dim, padding_idx=PADDING)
        self.position_embedding = nn.Parameter(torch.randn(1, max_words, dim) * 0.02)
        self.layer = nn.TransformerEncoderLayer(
            dim,
            nhead=LANGUAGE_HEADS,
            dim_feedforward=2 * dim,
            dropout=0.0,
            activation="gelu",
            batch_first=True,
            norm_first=True,
        )
        self.norm = nn.LayerNorm(dim)
        self._last: tuple[Any, Tensor] | None = None

    def forward(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Maps tokens (N, W, SUBWORDS) and mask (N, W), true where there is a word, to (N, dim)."""
        if not is_plain_cpu(tokens.device):  # how many instructions and words there are would be shapes
            return self._encode(tokens, mask)
        differs = self.training or torch.is_grad_enabled() or torch.is_autocast_enabled("cpu")
        # A recording would take what is remembered for a constant, and tensors of inference mode do not count changes.
        if differs or torch.jit.is_tracing() or any(weight.is_inference() for weight in self.parameters()):
            return self._encode_each_once(tokens, mask)
        # A trial asks with the same instruction again and again, which takes a tenth of a small policy's time.
        weights = tuple((weight.data_ptr(), weight._version) for weight in self.parameters())
        asked = (tokens.shape, tokens.numpy().tobytes(), mask.numpy().tobytes(), weights)
        if self._last is None or self._last[0] != asked:
            with torch.inference_mode(False), torch.no_grad():  # what is kept may be copied with the policy
                self._last = asked, self._encode_each_once(tokens, mask)
        return self._last[1].clone()

    def train(self, mode: bool = True) -> TokenEncoder:
        """As of any module; what was encoded is forgotten, since weights change between the two."""
        self._last = None
        return super().train(mode)

    def _encode_each_once(self, tokens: Tensor, mask: Tensor) -> Tensor:
        # A batch repeats few instructions: encode each once.
        unique, where = torch.unique(torch.cat([tokens.flatten(1), mask.long()], dim=1), dim=0, return_inverse=True)
        words = int(mask.sum(dim=1).max().clamp(min=1))
        mask = unique[:, -mask.shape[1] :][:, :words].bool()
        tokens = unique[:, : tokens.shape[1] * SUBWORDS].unflatten(1, (-1, SUBWORDS))[:, :words]
        return self._encode(tokens, mask)[where]

    def _encode(self, tokens: Tensor, mask: Tensor) -> Tensor:
        pieces = (tokens != PADDING).sum(dim=-1, keepdim=True).clamp(min=1)
        x = self.embedding(tokens).sum(dim=-2) / pieces + self.position_embedding[:, : tokens.shape[1]]
        # An empty instruction attends to its first (empty) place: a softmax over nothing is not a number.
        attended = mask.bool().clone()
        attended[:, 0] = True
        x = self.norm(self.layer(x, src_key_padding_mask=~attended))
        weight = attended.unsqueeze(-1).to(x.dtype)
        out: Tensor = (x * weight).sum(dim=1) / weight.sum(dim=1)
        return out


class ClipTextEncoder(nn.Module):
    """Frozen CLIP text encoder with a memory of the instructions it has seen.

    Its weights are part of the module (and so of a checkpoint) if `saved`, else they are only held.
    """

    def __init__(self, path: str, config: dict[str, Any] | None, saved: bool) -> None:
        super().__init__()
        from transformers import CLIPTextConfig, CLIPTextModelWithProjection

        if saved and config is not None:  # weights follow from the checkpoint
            model = CLIPTextModelWithProjection(CLIPTextConfig(**config))
        else:
            model = _from_pretrained(CLIPTextModelWithProjection, path, "text encoder", CLIPTextConfig)
        self.config = {name: getattr(model.config, name) for name in _CLIP_FIELDS}
        self.dim = int(model.config.projection_dim)
        model.requires_grad_(False)
        if saved:
            self.model = model
        else:
            self._held = [model]  # a list hides it from parameters(), state_dict() and so from checkpoints
        self._memory: dict[bytes, Tensor] = {}

    @property
    def text_model(self) -> nn.Module:
        """The CLIP model itself."""
        return self.model if hasattr(self, "model") else self._held[0]

    # Cached embeddings must be the same under automatic mixed precision and usable for training although first
    # seen in inference mode. `torch.compile` has nothing to translate in a dictionary.
    @torch.compiler.disable
    @torch.inference_mode(False)
    @torch.no_grad()
    def forward(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Maps CLIP's tokens (N, L) and attention mask (N, L) to its text embeddings (N, dim), in float32."""
        keys = [row.numpy().tobytes() for row in tokens.cpu()]
        different, where = each_once(keys)
        new = [keys.index(key) for key in different if key not in self._memory]
        if new:
            model = self.text_model.to(tokens.device).eval()
            with torch.autocast(tokens.device.type, enabled=False):
                for i in new:
                    # By itself: beside others its last bits would depend on which of them are new, too, and so on
                    # whether training was interrupted, or which trials an evaluation runs together.
                    one = slice(i, i + 1)
                    found = model(input_ids=tokens[one], attention_mask=mask[one].long()).text_embeds
                    self._memory[keys[i]] = found[0].float()
        known = torch.stack([self._memory[key].to(tokens.device) for key in different])
        return known[to_device(where, tokens.device)]

    def _load_from_state_dict(self, *args: Any, **kwargs: Any) -> None:
        self._memory.clear()  # what other weights gave
        super()._load_from_state_dict(*args, **kwargs)


def _from_pretrained(cls: Any, path: str, what: str, config: Any = None) -> Any:
    try:
        if config is None:
            return cls.from_pretrained(path)
        if without_weights():
            return cls(config.from_pretrained(path))
        return cls.from_pretrained(path, dtype="float32")  # as it is held in checkpoints, whatever the file's is
    except (OSError, ValueError) as error:
        kind = "folder" if Path(path).exists() else "hub name or folder"
        raise UserError(
            f"the CLIP {what} could not be loaded from {kind} {path!r}: {error} "
            "Set clip_path to a folder that holds a CLIP model and its tokenizer (as `save_pretrained` writes it), "
            "allow access to the hub, or set text_encoder to 'token', which needs no download."
        ) from error


def load_clip_tokenizer(path: str) -> str:
    """The tokenizer of a CLIP model, from a hub name or folder, as the JSON text of the `tokenizers` library.

    Raises:
        UserError: nothing loadable at `path`.
    """
    from transformers import AutoTokenizer

    return str(_from_pretrained(AutoTokenizer, path, "tokenizer").backend_tokenizer.to_str())
