"""Processors of the policy `flow_vla`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lerobot.processor import ProcessorStepRegistry
from torch import Tensor

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.language_processor import ClipTokensStep, HashedWordsStep
from robocasa_lerobot.policies.common.processors import Pipelines, make_pipelines
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig


@dataclass
@ProcessorStepRegistry.register(name="robocasa_lerobot_prompt_tokens")
class PromptTokensStep(ClipTokensStep):
    """Tokens of a vision-language model's tokenizer: (B, max_length) int64, and the same shape bool.

    The instruction ends with a line break, which pi0 takes for the start of the answer. The tokenizer is part of the
    step's state, so a checkpoint needs no other file.
    """

    path: str = "HuggingFaceTB/SmolVLM2-500M-Video-Instruct"
    max_length: int = 48

    def tokenize(self, instructions: list[str]) -> tuple[Tensor, Tensor]:
        """Tokens of each instruction and its line break."""
        return super().tokenize([f"{instruction.strip()}\n" for instruction in instructions])

    def _json(self) -> str:
        if self._tokenizer_json is None:
            from transformers import AutoTokenizer

            try:
                tokenizer = AutoTokenizer.from_pretrained(self.path)
                self._tokenizer_json = str(tokenizer.backend_tokenizer.to_str())
            except (OSError, ValueError, AttributeError) as error:
                raise UserError(
                    f"no tokenizer could be loaded from {self.path!r}: {error} Set prefix_path to a folder that holds "
                    "the vision-language model and its tokenizer, allow access to the hub, or set prefix to "
                    "'scratch', which needs none."
                ) from error
        return self._tokenizer_json


def make_flow_vla_pre_post_processors(
    config: FlowVlaConfig, dataset_stats: Mapping[str, Mapping[str, Any]] | None = None
) -> Pipelines:
    """Pre- and postprocessor for the data of `dataset_stats`; LeRobot's discovery calls it by its name."""
    tokens = (
        HashedWordsStep(max_words=config.max_words, buckets=config.language_buckets)
        if config.prefix == "scratch"
        else PromptTokensStep(path=config.prefix_path, max_length=config.max_tokens)
    )
    return make_pipelines(config, dataset_stats, tokens)
