"""Processors of the policy `diffusion_transformer`; they are saved with it, statistics and tokenizer included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lerobot.processor import (
    PolicyAction,
    PolicyProcessorPipeline,
    make_default_policy_processor_steps,
    make_policy_processor_pipelines,
)
from lerobot.utils.constants import ACTION, OBS_STATE

from robocasa_lerobot.contract import STATE_PARTS, component_names
from robocasa_lerobot.policies.common.language_processor import ClipTokensStep, HashedWordsStep
from robocasa_lerobot.policies.common.statistics import leave_components, widen_constant_components
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)

QUATERNION_COMPONENTS = tuple(
    i for i, name in enumerate(component_names(STATE_PARTS)) if name.endswith(("_qx", "_qy", "_qz", "_qw"))
)
Pipelines = tuple[
    PolicyProcessorPipeline[dict[str, Any], dict[str, Any]], PolicyProcessorPipeline[PolicyAction, PolicyAction]
]


def make_diffusion_transformer_pre_post_processors(
    config: DiffusionTransformerConfig, dataset_stats: Mapping[str, Mapping[str, Any]] | None = None
) -> Pipelines:
    """The preprocessor (instruction to tokens, device, normalisation) and the postprocessor (actions in data units).

    Args:
        config: of the policy, with its features set.
        dataset_stats: LeRobot's statistics; constant components are widened (`policies/common/statistics.py`).
    """
    stats = None
    if dataset_stats is not None:
        stats = widen_constant_components(dataset_stats, (OBS_STATE, ACTION), config.constant_range)
        if config.quaternions_as_they_are:
            stats = leave_components(stats, OBS_STATE, QUATERNION_COMPONENTS)
    steps = make_default_policy_processor_steps(config, stats)
    tokens = (
        HashedWordsStep(max_words=config.max_words, buckets=config.language_buckets)
        if config.text_encoder == "token"
        else ClipTokensStep(path=config.clip_path)
    )
    return make_policy_processor_pipelines(
        input_steps=[steps.rename_observations, steps.add_batch_dim, tokens, steps.to_device, steps.normalize],
        output_steps=[steps.unnormalize, steps.to_cpu],
    )
