"""Optimisers and schedules of the learning rate: the policy's own, with what a phase changes."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any

import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.optim.optimizers import OptimizerConfig
from lerobot.optim.schedulers import CosineDecayWithWarmupSchedulerConfig, DiffuserSchedulerConfig, LRSchedulerConfig
from lerobot.policies.pretrained import PreTrainedPolicy

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.common.chunks import trained_by_name
from robocasa_lerobot.policies.common.muon import MuonConfig
from robocasa_lerobot.training.config.phase import PhaseConfig
from robocasa_lerobot.training.weights.master_weights import MasterWeights

_SHARED = ("lr", "weight_decay", "grad_clip_norm", "betas", "eps")  # what optimisers of several types have
_BY_NAME = ("xvla-adamw", "muon")  # optimisers whose rates go by the names of parameters


def check_optimizer(config: PreTrainedConfig, phase: PhaseConfig) -> None:
    """Whether a phase's optimiser and schedule can be made, before there are weights.

    Raises:
        UserError: a setting that they do not have, or a value that does not fit.
    """
    preset, weight = _optimizer_settings(config, phase), torch.nn.Parameter(torch.zeros(1))
    try:
        stand_in = preset.build({"weight": weight} if preset.type in _BY_NAME else [weight])
    except ValueError as error:  # of PyTorch, which names the value
        raise UserError(f"phase {phase.name!r}: optimiser {preset.type!r}: {error}.") from error
    if phase.learning_rate is not None and not preset.lr:
        raise UserError(f"phase {phase.name!r}: learning_rate scales the policy's own rate, which is 0.")
    _schedule(config, phase, _one_of(stand_in, config))


def make_optimizer(
    policy: PreTrainedPolicy, phase: PhaseConfig, masters: MasterWeights | None = None
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.LRScheduler | None, float]:
    """The policy's own optimiser and schedule with the phase's changes, and the largest gradient norm (0: any).

    It updates the float32 copies in `masters` of weights in half precision; None makes them.

    Raises:
        UserError: a setting that the optimiser or schedule does not have, or nothing to train.
    """
    preset = _optimizer_settings(policy.config, phase)
    masters = MasterWeights(policy) if masters is None else masters
    optimizer = preset.build(masters.groups(_trained_groups(policy, phase, by_name=preset.type in _BY_NAME)))
    optimizer = _one_of(optimizer, policy.config)
    for group in optimizer.param_groups:
        # One kernel for all elements instead of a dozen: on a CPU the update is several times faster.
        if "fused" in group and policy.config.device == "cpu":
            group["fused"] = True
    masters.follow(optimizer)
    if phase.learning_rate is not None:
        for group in optimizer.param_groups:
            group["lr"] *= phase.learning_rate / preset.lr
    clip = preset.grad_clip_norm if phase.grad_clip_norm is None else phase.grad_clip_norm
    return optimizer, _schedule(policy.config, phase, optimizer), float(clip or 0.0)


def _one_of(built: Any, config: PreTrainedConfig) -> torch.optim.Optimizer:
    if not isinstance(built, torch.optim.Optimizer):
        raise UserError(f"policy {config.type!r} wants several optimisers, which training does not support.")
    return built


def in_lerobots_words(config: PreTrainedConfig, phase: PhaseConfig) -> tuple[OptimizerConfig, LRSchedulerConfig | None]:
    """The optimiser and schedule of a phase as LeRobot's training would be told of them."""
    preset = _optimizer_settings(config, phase)
    asked = {"lr": phase.learning_rate, "grad_clip_norm": phase.grad_clip_norm}
    changes = {name: value for name, value in asked.items() if value is not None}
    if isinstance(preset, MuonConfig) and phase.learning_rate is not None:
        changes["matrix_lr"] = preset.matrix_lr * phase.learning_rate / preset.lr
    return dataclasses.replace(preset, **changes), _schedule_settings(config, phase)


def _optimizer_settings(config: PreTrainedConfig, phase: PhaseConfig) -> OptimizerConfig:
    """The policy's own optimiser with the phase's changes."""
    settings: OptimizerConfig = _changed(OptimizerConfig, config.get_optimizer_preset(), phase.optimizer, "optimizer")
    return settings


def _schedule_settings(config: PreTrainedConfig, phase: PhaseConfig) -> LRSchedulerConfig | None:
    """The policy's own schedule of the learning rate with the phase's changes."""
    schedule = config.get_scheduler_preset()
    if phase.scheduler.get("type") == "none":
        schedule = None
    elif phase.scheduler:
        schedule = _changed(LRSchedulerConfig, schedule, phase.scheduler, "scheduler")
    if schedule is None and phase.warmup_steps:
        schedule = DiffuserSchedulerConfig(name="constant_with_warmup", num_warmup_steps=phase.warmup_steps)
    elif schedule is not None and phase.warmup_steps is not None:
        schedule = dataclasses.replace(schedule, num_warmup_steps=phase.warmup_steps)
    if isinstance(schedule, CosineDecayWithWarmupSchedulerConfig) and _warmup_is_given(phase):
        # For a training shorter than its decay, LeRobot shortens the warm-up, too: not one that was asked for.
        total = phase.schedule_steps or phase.steps
        schedule = dataclasses.replace(schedule, num_decay_steps=min(schedule.num_decay_steps, total))
    return schedule


def _schedule(
    config: PreTrainedConfig, phase: PhaseConfig, optimizer: torch.optim.Optimizer
) -> torch.optim.lr_scheduler.LRScheduler | None:
    """The same for an optimiser."""
    settings, steps = _schedule_settings(config, phase), phase.schedule_steps or phase.steps
    if isinstance(settings, DiffuserSchedulerConfig) and "cosine" in settings.name and steps < phase.steps:
        raise UserError(
            f"phase {phase.name!r}: schedule_steps is {steps}, but there are {phase.steps} steps, and past its end a "
            f"cosine rises again to the full rate. Give at least {phase.steps}, or leave it out."
        )
    try:
        return settings.build(optimizer, steps) if settings is not None else None
    except ValueError as error:  # of diffusers, about a name that it does not know, or what that lacks
        raise UserError(f"phase {phase.name!r}: `scheduler`: {error}.") from error


def _changed(registry: Any, preset: Any, changes: Mapping[str, Any], what: str) -> Any:
    """The policy's own settings with changes, or another type's with the given fields."""
    kind = changes.get("type", preset.type if preset is not None else None)
    fields = {key: value for key, value in changes.items() if key != "type"}
    if kind not in registry.get_known_choices():
        none = ["none"] if what == "scheduler" else []
        raise UnknownNameError(f"type of {what}", str(kind), [*registry.get_known_choices(), *none])
    chosen = registry.get_choice_class(kind)
    names = [f.name for f in dataclasses.fields(chosen)]
    for key in fields:
        if key not in names:
            raise UnknownNameError("key", key, names, f"(in `{what}`)")
    fields = {key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}
    _check_types(chosen, fields, what)
    if preset is not None and kind == preset.type:
        return dataclasses.replace(preset, **fields)
    # What both have stays the policy's own: LeRobot's defaults are another rate and another clipping.
    common = {name: getattr(preset, name) for name in _SHARED if name in names and hasattr(preset, name)}
    try:
        return chosen(**{**common, **fields})
    except TypeError as error:
        raise UserError(f"`{what}` of type {kind!r}: {error}.") from error


def _check_types(kind: type, values: Mapping[str, Any], what: str) -> None:
    """Check that numbers are numbers and tuples of them tuples, which neither LeRobot nor PyTorch does in words."""
    for key, hint in typing.get_type_hints(kind).items():
        if key not in values or (values[key] is None and type(None) in typing.get_args(hint)):
            continue
        value, wanted = values[key], next((one for one in (hint, *typing.get_args(hint)) if one in (int, float)), hint)
        if typing.get_origin(hint) is tuple:
            count = len(typing.get_args(hint))
            right = isinstance(value, tuple) and len(value) == count and all(map(_is_number, value))
            expected = f"a list of {count} numbers"
        else:
            right = wanted not in (int, float) or _is_number(value, whole=wanted is int)
            expected = "a whole number" if wanted is int else "a number"
        if not right:
            raise UserError(f"`{what}.{key}` is {value!r}, expected {expected}.")


def _is_number(value: Any, whole: bool = False) -> bool:
    return isinstance(value, int if whole else (int, float)) and not isinstance(value, bool)


def _warmup_is_given(phase: PhaseConfig) -> bool:
    return phase.warmup_steps is not None or "num_warmup_steps" in phase.scheduler


def trained_parameters(policy: PreTrainedPolicy, phase: PhaseConfig) -> dict[str, torch.nn.Parameter]:
    """Those that are not frozen, by their names.

    Raises:
        UserError: all are.
    """
    trained = trained_by_name(policy)
    if not trained:
        raise UserError(f"phase {phase.name!r}: `freeze` leaves nothing of the policy to train.")
    return trained


def _trained_groups(policy: PreTrainedPolicy, phase: PhaseConfig, by_name: bool) -> Any:
    """The policy's parameter groups without frozen parameters; one group where low-rank changes are trained.

    For an optimiser that goes `by_name`, the parameters by their names.
    """
    trained = trained_parameters(policy, phase)
    if by_name:
        return trained
    if phase.lora is not None:
        return [{"params": list(trained.values())}]
    params = policy.get_optim_params()
    params = list(params.values() if isinstance(params, dict) else params)
    groups = params if params and isinstance(params[0], dict) else [{"params": params}]
    kept = [{**group, "params": [p for p in group["params"] if p.requires_grad]} for group in groups]
    return [group for group in kept if group["params"]]
