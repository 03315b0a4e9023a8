"""Processors of the policy `flow_vla`; they are saved with it, statistics and tokenizer included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lerobot.processor import (
    PolicyAction,
    PolicyProcessorPipeline,
    ProcessorStepRegistry,
    make_default_policy_processor_steps,
    make_policy_processor_pipelines,
)
from lerobot.utils.constants import ACTION, OBS_STATE
from torch import Tensor

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.language_processor import ClipTokensStep, HashedWordsStep
from robocasa_lerobot.policies.common.statistics import widen_constant_components
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig

Pipelines = tuple[
    PolicyProcessorPipeline[dict[str, Any], dict[str, Any]], PolicyProcessorPipeline[PolicyAction, PolicyAction]
]


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
    """The preprocessor (instruction to tokens, device, normalisation) and the postprocessor (actions in data units).

    Args:
        config: of the policy, with its features set.
        dataset_stats: LeRobot's statistics; constant components are widened (`policies/common/statistics.py`).
    """
    stats = None
    if dataset_stats is not None:
        stats = widen_constant_components(dataset_stats, (OBS_STATE, ACTION), config.constant_range)
    steps = make_default_policy_processor_steps(config, stats)
    tokens = (
        HashedWordsStep(max_words=config.max_words, buckets=config.language_buckets)
        if config.prefix == "scratch"
        else PromptTokensStep(path=config.prefix_path, max_length=config.max_tokens)
    )
    return make_policy_processor_pipelines(
        input_steps=[steps.rename_observations, steps.add_batch_dim, tokens, steps.to_device, steps.normalize],
        output_steps=[steps.unnormalize, steps.to_cpu],
    )
