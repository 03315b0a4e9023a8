"""Values of settings that both policies share, or hand to libraries whose errors name no setting."""

from __future__ import annotations

from typing import Any

import pytest
from lerobot.configs.policies import PreTrainedConfig

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.registry import register_policies
from robocasa_lerobot.training.setup import builders

BOTH = ("diffusion_transformer", "flow_vla")


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"image_size": (0, 64)}, r"image_size is \[0, 64\]"),
        ({"state_clip": -1.0}, "state_clip is -1.0, expected more than 0"),
        ({"scheduler_warmup_steps": -5}, "scheduler_warmup_steps is -5"),
    ],
)
def test_shared_fields(kind: str, fields: dict[str, Any], message: str) -> None:
    register_policies()
    with pytest.raises(UserError, match=message):
        PreTrainedConfig.get_choice_class(kind)(**fields)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"dropout": 1.5}, "dropout is 1.5, expected at least 0 and below 1"),
        ({"dropout_embedding": -0.1}, "dropout_embedding is -0.1"),
        ({"beta_schedule": "squaredcos"}, "Did you mean 'squaredcos_cap_v2'"),
        ({"drop_n_last_frames": -3}, "drop_n_last_frames is -3, expected 0 or more"),
        ({"clip_sample_range": 0.0}, "clip_sample_range is 0.0"),
        ({"num_train_timesteps": 0, "num_inference_steps": None}, "num_train_timesteps is 0"),
        ({"vision_features": 0}, "vision_features is 0"),
    ],
)
def test_fields_of_diffusion(fields: dict[str, Any], message: str) -> None:
    register_policies()
    with pytest.raises(UserError, match=message):
        PreTrainedConfig.get_choice_class("diffusion_transformer")(**fields)


@pytest.mark.parametrize("kind", [*BOTH, "act"])
@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"STAT": "MIN_MAX"}, "unknown kind of feature 'STAT'. Did you mean 'STATE'"),
        ({"STATE": "MINMAX"}, r"unknown way to normalise 'MINMAX'. Did you mean 'MIN_MAX'.*STATE in"),
        ("MIN_MAX", "normalization_mapping is 'MIN_MAX', expected a mapping"),
    ],
)
def test_what_is_normalised_and_how(kind: str, mapping: Any, message: str) -> None:
    with pytest.raises(UserError, match=message):
        builders.policy_config({"type": kind, "normalization_mapping": mapping}, None, "cpu")
