"""Checkpoints in LeRobot's layout, complete or not there at all.

<phase>/checkpoints/000100/pretrained_model/   config.json, model.safetensors, processors, train_config.json,
                                               origin.json (experiment, phase, step)
<phase>/checkpoints/000100/training_state/     optimiser, schedule, step, log window; the weights as they are
                                               trained, where `pretrained_model` has averaged or merged ones; float32
                                               weights and averages, where its own are in half precision
<phase>/checkpoints/last -> 000100
"""

from __future__ import annotations

import json
import shutil
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from lerobot.common.train_utils import load_training_state, save_training_state
from lerobot.optim import load_optimizer_state_dict, load_scheduler_state
from lerobot.policies.pretrained import PreTrainedPolicy
from safetensors import SafetensorError
from safetensors.torch import load_file, load_model, save_file, save_model
from torch.optim.lr_scheduler import LambdaLR, LRScheduler

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.origin import Origin, experiment_of
from robocasa_lerobot.training.weights.adapters import merged_state
from robocasa_lerobot.training.weights.card import write_model_card
from robocasa_lerobot.training.weights.ema import Ema
from robocasa_lerobot.training.weights.master_weights import MasterWeights

CHECKPOINTS, LAST, LINK_ASIDE = "checkpoints", "last", ".last"
PRETRAINED, STATE = "pretrained_model", "training_state"
RAW_WEIGHTS, AVERAGE, LOG_WINDOW = "raw_model.safetensors", "average.safetensors", "log_window.json"
MASTERS = "master_weights.safetensors"
SCALER = "gradient_scaler.json"


@dataclass
class TrainingState:
    """What training changes, and a checkpoint therefore holds; `step` optimiser steps are done."""

    policy: PreTrainedPolicy
    preprocessor: Any
    postprocessor: Any
    optimizer: torch.optim.Optimizer
    scheduler: LRScheduler | None
    ema: Ema | None
    masters: MasterWeights
    low_rank: bool = False
    step: int = 0
    log_window: dict[str, list[float]] = field(default_factory=dict)
    scaler: torch.amp.GradScaler | None = None  # of fp16

    @property
    def average_apart(self) -> bool:
        """Whether the weights of `pretrained_model` do not tell the averages: they are merged, or rounded."""
        return self.ema is not None and (self.low_rank or self.ema.in_half_precision)


def last_checkpoint(phase_dir: Path) -> Path | None:
    """The newest complete checkpoint of a phase, or None."""
    return max(_checkpoints(phase_dir), key=checkpoint_step, default=None)


def tidy(phase_dir: Path) -> None:
    """Bring a phase's checkpoints in order after a kill: nothing half-written, and `last` points at the newest."""
    parent = phase_dir / CHECKPOINTS
    for stale in [*parent.glob(".writing-*"), *parent.glob(".dropped-*")]:
        shutil.rmtree(stale)
    (parent / LINK_ASIDE).unlink(missing_ok=True)
    newest = last_checkpoint(phase_dir)
    link = parent / LAST
    if newest is not None and not (link.is_symlink() and link.readlink() == Path(newest.name)):
        _point_last_at(newest)


def prune(phase_dir: Path, keep_last: int, keep_every: int) -> None:
    """Remove checkpoints beyond the newest `keep_last` (0 keeps all).

    The initial one stays, and so do those whose step is a multiple of `keep_every` (0: none).
    """
    if not keep_last:
        return
    for checkpoint in sorted(_checkpoints(phase_dir), key=checkpoint_step)[:-keep_last]:
        step = checkpoint_step(checkpoint)
        if step and not (keep_every and step % keep_every == 0):
            _drop(checkpoint)


def _checkpoints(phase_dir: Path) -> list[Path]:
    return [path for path in (phase_dir / CHECKPOINTS).glob("[0-9]*") if path.name.isdigit() and path.is_dir()]


def _drop(checkpoint: Path) -> None:
    """Remove it whole or not at all: a folder with half its files would look like a checkpoint."""
    aside = checkpoint.with_name(f".dropped-{checkpoint.name}")
    checkpoint.rename(aside)
    shutil.rmtree(aside)


def _point_last_at(checkpoint: Path) -> None:
    link = checkpoint.with_name(LINK_ASIDE)
    link.unlink(missing_ok=True)
    link.symlink_to(checkpoint.name)
    last = checkpoint.with_name(LAST)
    if last.is_dir() and not last.is_symlink():  # the training was copied by something that follows links
        _drop(last)
    link.replace(checkpoint.with_name(LAST))


def checkpoint_step(checkpoint: Path) -> int:
    """The number of steps that made a checkpoint."""
    return int(checkpoint.name)


def pretrained_model(checkpoint: Path) -> Path:
    """Its folder that LeRobot loads."""
    return checkpoint / PRETRAINED


def save_checkpoint(phase_dir: Path, state: TrainingState, train_config: Any) -> Path:
    """Write a checkpoint aside, rename it, and point `last` at it.

    Raises:
        UserError: it cannot be written, as where the disk is full; those before it stay.
    """
    parent = phase_dir / CHECKPOINTS
    parent.mkdir(parents=True, exist_ok=True)
    tidy(phase_dir)
    final, aside = parent / f"{state.step:06d}", parent / f".writing-{state.step:06d}"
    try:
        _write(aside, phase_dir, state, train_config)
    except (OSError, SafetensorError) as error:
        shutil.rmtree(aside, ignore_errors=True)  # what others on a full disk may need
        before = last_checkpoint(phase_dir)
        goes_on = f"goes on from step {checkpoint_step(before)}" if before is not None else "begins the phase anew"
        raise UserError(
            f"the checkpoint of step {state.step} cannot be written to {parent}: {error}. Free some disk, or keep "
            f"fewer checkpoints (`keep_last`, `keep_every`); then the same command {goes_on}."
        ) from error
    if final.exists():
        _drop(final)
    aside.rename(final)
    _point_last_at(final)
    return final


def _write(aside: Path, phase_dir: Path, state: TrainingState, train_config: Any) -> None:
    model_dir, state_dir = aside / PRETRAINED, aside / STATE
    save_training_state(aside, state.step, state.optimizer, state.scheduler)
    (state_dir / LOG_WINDOW).write_text(json.dumps(state.log_window))
    if state.scaler is not None:
        (state_dir / SCALER).write_text(json.dumps(state.scaler.state_dict()))
    if state.ema is not None or state.low_rank:
        save_model(state.policy, str(state_dir / RAW_WEIGHTS))
    if state.ema is not None and state.average_apart:
        save_file(state.ema.state(), state_dir / AVERAGE)
    if len(state.masters):
        save_file(state.masters.state(), state_dir / MASTERS)
    with state.ema.applied() if state.ema is not None else nullcontext():
        state.policy.save_pretrained(model_dir, state_dict=merged_state(state.policy))
    state.preprocessor.save_pretrained(model_dir)
    state.postprocessor.save_pretrained(model_dir)
    train_config.save_pretrained(model_dir)
    experiment = experiment_of(getattr(train_config, "job_name", None), phase_dir.name)
    Origin(experiment, phase_dir.name, state.step).write(model_dir)
    write_model_card(model_dir, str(state.policy.name), experiment, phase_dir, state.step)


def restore(checkpoint: Path, state: TrainingState) -> None:
    """Continue from a checkpoint whose `pretrained_model` weights the policy (and its average) already has.

    Optimiser and schedule keep the settings that they were made with, which may be others than those of before.

    Raises:
        UserError: the checkpoint has no training state, or one of another optimiser or policy.
    """
    folder = checkpoint / STATE
    if not folder.is_dir():
        raise UserError(f"{checkpoint} has no {STATE}/, so training cannot go on from it; start a new phase from it.")
    raw = folder / RAW_WEIGHTS
    if raw.is_file() != (state.ema is not None or state.low_rank):
        raise UserError(
            f"{checkpoint} was written with{'' if raw.is_file() else 'out'} `ema` or `lora`; the phase says otherwise."
        )
    try:
        if raw.is_file():
            load_model(state.policy, str(raw), strict=True)
        if len(state.masters):
            state.masters.load(load_file(folder / MASTERS))
        if state.ema is not None and state.average_apart:
            state.ema.load(load_file(folder / AVERAGE))
    except (RuntimeError, OSError) as error:
        raise UserError(f"{folder} does not fit the phase's policy: {error}") from error
    try:
        state.step, _, _ = load_training_state(checkpoint, state.optimizer, None, load_optimizer=False)
        _load_optimizer(folder, state.optimizer)
        if state.scheduler is not None:
            _load_schedule(folder, state.scheduler, state.step)
    except (KeyError, ValueError, TypeError, OSError) as error:
        raise UserError(f"{folder} does not fit the phase's optimiser: {error}") from error
    state.log_window = json.loads((folder / LOG_WINDOW).read_text())
    if state.scaler is not None and (folder / SCALER).is_file():  # checkpoints of before have none
        state.scaler.load_state_dict(json.loads((folder / SCALER).read_text()))
    if state.ema is not None:
        state.ema.step = state.step


def _load_optimizer(folder: Path, optimizer: torch.optim.Optimizer) -> None:
    """The moments of the weights, and nothing else: what a group has beside them are settings.

    Raises:
        ValueError: it was another type of optimiser, or one of other weights.
    """
    saved, own = load_optimizer_state_dict(folder), optimizer.state_dict()["param_groups"]
    if list(map(_kind, saved["param_groups"])) != list(map(_kind, own)):
        raise ValueError("it is of another type, or has other weights")
    moments = {int(number): values for number, values in saved["state"].items()}
    optimizer.load_state_dict({"state": moments, "param_groups": own})


def _kind(group: dict[str, Any]) -> tuple[int, set[str]]:
    """Of a group of weights: their number, and what the optimiser calls its settings."""
    return len(group["params"]), group.keys() - {"params", "initial_lr"}  # the latter is a schedule's


def _load_schedule(folder: Path, scheduler: LRScheduler, step: int) -> None:
    """The rates after so many steps: from the schedule's own settings if it follows from them, as LeRobot's all do."""
    if isinstance(scheduler, LambdaLR):
        scheduler.last_epoch = step
        factors = [factor(step) for factor in scheduler.lr_lambdas]
        rates = [base * factor for base, factor in zip(scheduler.base_lrs, factors, strict=True)]
    else:
        rates = load_scheduler_state(scheduler, folder).get_last_lr()
    for group, rate in zip(scheduler.optimizer.param_groups, rates, strict=True):
        group["lr"] = rate
