"""Processor steps that turn the instruction (`task`) into tensors `observation.language.*`."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any

import torch
from lerobot.configs import FeatureType, PipelineFeatureType, PolicyFeature
from lerobot.lerobot_types import TransitionKey
from lerobot.processor import ObservationProcessorStep, ProcessorStepRegistry
from lerobot.utils.constants import OBS_LANGUAGE_ATTENTION_MASK, OBS_LANGUAGE_TOKENS
from torch import Tensor

from robocasa_lerobot.contract import TASK_KEY
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.language import PADDING, SUBWORDS, load_clip_tokenizer, token_tensor
from robocasa_lerobot.policies.common.transfer import each_once


class _InstructionStep(ObservationProcessorStep):
    """Adds tokens and attention mask of the instructions of a batch."""

    @abstractmethod
    def tokenize(self, instructions: list[str]) -> tuple[Tensor, Tensor]:
        """Tokens and the mask of those that count."""

    @abstractmethod
    def token_shape(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes of tokens and mask of one instruction."""

    def observation(self, observation: dict[str, Any]) -> dict[str, Any]:
        """The observation with the tokens of its instructions."""
        complementary = self.transition.get(TransitionKey.COMPLEMENTARY_DATA) or {}
        instructions = complementary.get(TASK_KEY)
        if isinstance(instructions, str):
            instructions = [instructions]
        if not isinstance(instructions, list | tuple) or not all(isinstance(i, str) for i in instructions):
            raise UserError(
                f"the batch has no instructions: {TASK_KEY!r} is {instructions!r}, expected a list of strings. "
                "Datasets carry it as their task; an env's loop adds it to the observation."
            )
        # A batch repeats few instructions: make tokens of each once.
        different, where = each_once(instructions)
        tokens, mask = (each[where] for each in self.tokenize(different))
        return {**observation, OBS_LANGUAGE_TOKENS: tokens, OBS_LANGUAGE_ATTENTION_MASK: mask}

    def transform_features(
        self, features: dict[PipelineFeatureType, dict[str, PolicyFeature]]
    ) -> dict[PipelineFeatureType, dict[str, PolicyFeature]]:
        """The features with those of the tokens."""
        tokens, mask = self.token_shape()
        added = {
            OBS_LANGUAGE_TOKENS: PolicyFeature(type=FeatureType.LANGUAGE, shape=tokens),
            OBS_LANGUAGE_ATTENTION_MASK: PolicyFeature(type=FeatureType.LANGUAGE, shape=mask),
        }
        observation = PipelineFeatureType.OBSERVATION
        return {**features, observation: {**features.get(observation, {}), **added}}


@dataclass
@ProcessorStepRegistry.register(name="robocasa_lerobot_hashed_words")
class HashedWordsStep(_InstructionStep):
    """Tokens of `TokenEncoder`: (B, max_words, SUBWORDS) int64, and (B, max_words) bool."""

    max_words: int = 64
    buckets: int = 8192

    def tokenize(self, instructions: list[str]) -> tuple[Tensor, Tensor]:
        """Hashed words; needs no vocabulary."""
        tokens = token_tensor(instructions, self.max_words, self.buckets)
        return tokens, (tokens != PADDING).any(dim=-1)

    def token_shape(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes of tokens and mask of one instruction."""
        return (self.max_words, SUBWORDS), (self.max_words,)

    def get_config(self) -> dict[str, Any]:
        """The fields."""
        return {"max_words": self.max_words, "buckets": self.buckets}


@dataclass
@ProcessorStepRegistry.register(name="robocasa_lerobot_clip_tokens")
class ClipTokensStep(_InstructionStep):
    """Tokens of a CLIP text encoder: (B, max_length) int64, and the same shape bool.

    The tokenizer itself is part of the step's state, so a checkpoint needs no other file.
    """

    path: str = "openai/clip-vit-large-patch14"
    max_length: int = 77

    _tokenizer_json: str | None = field(default=None, init=False, repr=False)
    _tokenizer: Any = field(default=None, init=False, repr=False)

    def tokenize(self, instructions: list[str]) -> tuple[Tensor, Tensor]:
        """CLIP's tokens with its start and end tokens, padded to `max_length` with the end token, as CLIP does."""
        if self._tokenizer is None:
            from tokenizers import Tokenizer

            self._tokenizer = Tokenizer.from_str(self._json())
            self._tokenizer.enable_truncation(self.max_length)
            self._tokenizer.no_padding()
        ids = [encoding.ids for encoding in self._tokenizer.encode_batch(instructions)]
        tokens = torch.tensor([i + [i[-1]] * (self.max_length - len(i)) for i in ids])
        lengths = torch.tensor([len(i) for i in ids])
        return tokens, torch.arange(self.max_length) < lengths[:, None]

    def token_shape(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes of tokens and mask of one instruction."""
        return (self.max_length,), (self.max_length,)

    def get_config(self) -> dict[str, Any]:
        """The fields."""
        return {"path": self.path, "max_length": self.max_length}

    def state_dict(self) -> dict[str, Tensor]:
        """The tokenizer as UTF-8 bytes of its JSON."""
        return {"tokenizer": torch.frombuffer(bytearray(self._json().encode()), dtype=torch.uint8)}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Take the tokenizer from `state_dict`."""
        self._tokenizer_json = state["tokenizer"].cpu().numpy().tobytes().decode()
        self._tokenizer = None

    def _json(self) -> str:
        if self._tokenizer_json is None:
            self._tokenizer_json = load_clip_tokenizer(self.path)
        return self._tokenizer_json
