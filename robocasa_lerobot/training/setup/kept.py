"""What a phase that keeps a checkpoint's processors keeps with them: settings that live there, and names of inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lerobot.configs.policies import PreTrainedConfig
from lerobot.processor import (
    NormalizerProcessorStep,
    PolicyProcessorPipeline,
    RenameObservationsProcessorStep,
    UnnormalizerProcessorStep,
    rename_stats,
)

from robocasa_lerobot.errors import UserError

# Settings that go into the processors when these are made, by type of policy; beside the mapping that all have.
_ALL = ("normalization_mapping",)
_RELATIVE = ("use_relative_actions", "relative_exclude_joints")
IN_PROCESSORS: dict[str, tuple[str, ...]] = {
    "diffusion_transformer": ("constant_range", "quaternions_as_they_are", "max_words", "clip_path"),
    "flow_vla": ("constant_range", "max_words", "max_tokens", "prefix_path"),
    "groot": ("embodiment_tag", "chunk_size", "max_state_dim", "max_action_dim", *_RELATIVE),
    "multi_task_dit": (
        *("text_encoder_name", "tokenizer_max_length"),
        *("tokenizer_padding", "tokenizer_padding_side", "tokenizer_truncation"),
    ),
    "pi0": ("tokenizer_max_length", *_RELATIVE),
    "pi05": ("tokenizer_max_length", "max_state_dim", *_RELATIVE),
    "smolvla": ("vlm_model_name", "tokenizer_max_length", "pad_language_to"),
    "xvla": ("tokenizer_name", "tokenizer_max_length", "pad_language_to", "tokenizer_padding_side"),
}


def check_kept_settings(config: PreTrainedConfig, before: PreTrainedConfig, phase: str, begun: bool = False) -> None:
    """Check that a policy which goes on with the processors of `before` is asked for nothing else in them.

    Args:
        config: what the phase asks for.
        before: of the checkpoint.
        phase: its name.
        begun: the checkpoint is one of the phase itself.

    Raises:
        UserError: a setting has changed that the processors would not follow, and config.json would say wrongly.
    """
    names = [*_ALL, *IN_PROCESSORS.get(config.type, ())]
    if not getattr(config, "clip_saved", True):
        names.remove("clip_path")  # where the weights are: a setting of the machine
    changed = [
        f"{name}: {_shown(getattr(before, name))} -> {_shown(getattr(config, name))}"
        for name in names
        if getattr(before, name) != getattr(config, name)
    ]
    if changed:
        why = "goes on with its own processors" if begun else "keeps the checkpoint's processors (`statistics: keep`)"
        remedy = "" if begun else ", or set `statistics: replace` or `pool`, which make new ones"
        raise UserError(
            f"phase {phase!r} {why}. They hold settings of the policy, expected as they were; found: "
            f"{'; '.join(changed)}. Put the old values back{remedy}."
        )


def rename_kept(processor: PolicyProcessorPipeline[Any, Any], names: Mapping[str, str]) -> None:
    """Give what a checkpoint's processor normalises the data's names, by the checkpoint's names of it.

    Without, pictures under other names would pass as they are.
    """
    for step in processor.steps if names else ():
        if isinstance(step, RenameObservationsProcessorStep):
            step.rename_map = {}  # to the checkpoint's names, which nothing has any more
        elif isinstance(step, NormalizerProcessorStep | UnnormalizerProcessorStep):
            step.features = {names.get(key, key): feature for key, feature in step.features.items()}
            step.stats = rename_stats(step.stats or {}, dict(names))
            if step.normalize_observation_keys is not None:
                step.normalize_observation_keys = {names.get(key, key) for key in step.normalize_observation_keys}
            step.to()  # the tensors that it computes with follow from `stats`


def _shown(value: Any) -> str:
    """A setting as it is written in an experiment file."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_shown(mode)}" for key, mode in value.items()) + "}"
    return str(getattr(value, "value", value))
