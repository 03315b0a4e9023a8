"""How far a policy that clips what it samples must reach, where data come that its normalisation does not know."""

from __future__ import annotations

from typing import Any

import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.processor import NormalizerProcessorStep, PolicyProcessorPipeline, TransitionKey
from lerobot.processor.converters import create_transition
from lerobot.utils.constants import ACTION

from robocasa_lerobot.data.statistics import Statistics

RANGE = "clip_sample_range"
_ROUNDING = 1e-3  # what statistics in float32 may put the data's own extremes beyond 1


def clips(config: PreTrainedConfig) -> bool:
    """Whether a policy clips the normalised actions that it samples: diffusion policies do."""
    return bool(getattr(config, "clip_sample", False)) and hasattr(config, RANGE)


def widen_clip_range(
    config: PreTrainedConfig, preprocessor: PolicyProcessorPipeline[Any, Any], stats: Statistics
) -> float | None:
    """Let a policy reach all actions of its data, normalised as its checkpoint normalises them.

    Actions beyond those of the earlier data lie beyond [-1, 1] there. The loss takes them as they are; sampling would
    cut them off, so that the policy could never do what it has learned: drive, if nothing drove before.

    Args:
        config: of a policy that clips; its range is changed.
        preprocessor: of the checkpoint.
        stats: of the data.

    Returns:
        The new range, or None where the old one was enough.
    """
    normalizer = next((step for step in preprocessor.steps if isinstance(step, NormalizerProcessorStep)), None)
    if normalizer is None or ACTION not in stats:
        return None
    extremes = torch.stack([torch.as_tensor(stats[ACTION][name], dtype=torch.float32) for name in ("min", "max")])
    normalised = normalizer(create_transition(action=extremes.to(config.device)))[TransitionKey.ACTION]
    reach = float(torch.as_tensor(normalised).abs().max())
    if reach <= float(getattr(config, RANGE)) + _ROUNDING:
        return None
    setattr(config, RANGE, reach)
    return reach
