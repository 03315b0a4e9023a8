"""Processors of the policy `diffusion_transformer`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robocasa_lerobot.contract import STATE_PARTS, component_names
from robocasa_lerobot.policies.common.language_processor import ClipTokensStep, HashedWordsStep
from robocasa_lerobot.policies.common.processors import Pipelines, make_pipelines
from robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer import (
    DiffusionTransformerConfig,
)

QUATERNION_COMPONENTS = tuple(
    i for i, name in enumerate(component_names(STATE_PARTS)) if name.endswith(("_qx", "_qy", "_qz", "_qw"))
)


def make_diffusion_transformer_pre_post_processors(
    config: DiffusionTransformerConfig, dataset_stats: Mapping[str, Mapping[str, Any]] | None = None
) -> Pipelines:
    """Pre- and postprocessor for the data of `dataset_stats`; LeRobot's discovery calls it by its name."""
    tokens = (
        HashedWordsStep(max_words=config.max_words, buckets=config.language_buckets)
        if config.text_encoder == "token"
        else ClipTokensStep(path=config.clip_path)
    )
    as_they_are = QUATERNION_COMPONENTS if config.quaternions_as_they_are else ()
    return make_pipelines(config, dataset_stats, tokens, as_they_are)
