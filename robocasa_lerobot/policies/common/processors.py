"""The processors of our policies; they are saved with them, statistics and tokenizers included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lerobot.processor import (
    ObservationProcessorStep,
    PolicyAction,
    PolicyProcessorPipeline,
    make_default_policy_processor_steps,
    make_policy_processor_pipelines,
)
from lerobot.utils.constants import ACTION, OBS_STATE

from robocasa_lerobot.policies.common.configuration import ActionChunkConfig
from robocasa_lerobot.policies.common.statistics import leave_components, widen_constant_components

Pipelines = tuple[
    PolicyProcessorPipeline[dict[str, Any], dict[str, Any]], PolicyProcessorPipeline[PolicyAction, PolicyAction]
]


def make_pipelines(
    config: ActionChunkConfig,
    dataset_stats: Mapping[str, Mapping[str, Any]] | None,
    tokens: ObservationProcessorStep,
    state_as_it_is: Sequence[int] = (),
) -> Pipelines:
    """The preprocessor (instruction to tokens, device, normalisation) and the postprocessor (actions in data units).

    Args:
        config: of the policy, with its features set.
        dataset_stats: LeRobot's statistics; constant components are widened (`policies/common/statistics.py`).
        tokens: the step that makes tokens of the instruction.
        state_as_it_is: components of the state that are not normalised.
    """
    stats = None
    if dataset_stats is not None:
        stats = widen_constant_components(dataset_stats, (OBS_STATE, ACTION), config.constant_range)
        if state_as_it_is:
            stats = leave_components(stats, OBS_STATE, state_as_it_is)
    steps = make_default_policy_processor_steps(config, stats)
    return make_policy_processor_pipelines(
        input_steps=[steps.rename_observations, steps.add_batch_dim, tokens, steps.to_device, steps.normalize],
        output_steps=[steps.unnormalize, steps.to_cpu],
    )
