"""Checkpoints in LeRobot's layout, complete or not there at all.

<phase>/checkpoints/000100/pretrained_model/   config.json, model.safetensors, processors, train_config.json
<phase>/checkpoints/000100/training_state/     optimiser, schedule, step, raw weights if averaged, log window
<phase>/checkpoints/last -> 000100
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from lerobot.common.train_utils import load_training_state, save_training_state
from lerobot.policies.pretrained import PreTrainedPolicy
from safetensors.torch import load_model, save_model

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.ema import Ema

CHECKPOINTS, LAST = "checkpoints", "last"
PRETRAINED, STATE = "pretrained_model", "training_state"
RAW_WEIGHTS, LOG_WINDOW = "raw_model.safetensors", "log_window.json"


@dataclass
class TrainingState:
    """What training changes, and a checkpoint therefore holds; `step` optimiser steps are done."""

    policy: PreTrainedPolicy
    preprocessor: Any
    postprocessor: Any
    optimizer: torch.optim.Optimizer
    scheduler: torch.optim.lr_scheduler.LRScheduler | None
    ema: Ema | None
    step: int = 0
    log_window: dict[str, list[float]] = field(default_factory=dict)


def last_checkpoint(phase_dir: Path) -> Path | None:
    """The newest complete checkpoint of a phase, or None."""
    found = [path for path in (phase_dir / CHECKPOINTS).glob("[0-9]*") if path.name.isdigit() and path.is_dir()]
    return max(found, key=lambda path: int(path.name), default=None)


def checkpoint_step(checkpoint: Path) -> int:
    """The number of steps that made a checkpoint."""
    return int(checkpoint.name)


def pretrained_model(checkpoint: Path) -> Path:
    """Its folder that LeRobot loads."""
    return checkpoint / PRETRAINED


def save_checkpoint(phase_dir: Path, state: TrainingState, train_config: Any) -> Path:
    """Write a checkpoint aside, rename it, and point `last` at it."""
    parent = phase_dir / CHECKPOINTS
    parent.mkdir(parents=True, exist_ok=True)
    for stale in parent.glob(".writing-*"):  # what a killed process left
        shutil.rmtree(stale)
    final, aside = parent / f"{state.step:06d}", parent / f".writing-{state.step:06d}"
    model_dir, state_dir = aside / PRETRAINED, aside / STATE
    save_training_state(aside, state.step, state.optimizer, state.scheduler)
    (state_dir / LOG_WINDOW).write_text(json.dumps(state.log_window))
    if state.ema is None:
        state.policy.save_pretrained(model_dir)
    else:
        save_model(state.policy, str(state_dir / RAW_WEIGHTS))
        with state.ema.applied():
            state.policy.save_pretrained(model_dir)
    state.preprocessor.save_pretrained(model_dir)
    state.postprocessor.save_pretrained(model_dir)
    train_config.save_pretrained(model_dir)
    if final.exists():
        shutil.rmtree(final)
    aside.rename(final)
    link = parent / ".last"
    link.unlink(missing_ok=True)
    link.symlink_to(final.name)
    link.replace(parent / LAST)
    return final


def restore(checkpoint: Path, state: TrainingState) -> None:
    """Continue from a checkpoint whose `pretrained_model` weights the policy (and its average) already has.

    Raises:
        UserError: the checkpoint has no training state, or one of another optimiser or policy.
    """
    folder = checkpoint / STATE
    if not folder.is_dir():
        raise UserError(f"{checkpoint} has no {STATE}/, so training cannot go on from it; start a new phase from it.")
    raw = folder / RAW_WEIGHTS
    if raw.is_file() != (state.ema is not None):
        raise UserError(
            f"{checkpoint} was written with{'' if raw.is_file() else 'out'} `ema`; the phase says otherwise."
        )
    if raw.is_file():
        load_model(state.policy, str(raw), strict=True)
    try:
        state.step, _, _ = load_training_state(checkpoint, state.optimizer, state.scheduler)
    except (KeyError, ValueError, TypeError) as error:
        raise UserError(f"{folder} does not fit the phase's optimiser: {error}") from error
    state.log_window = json.loads((folder / LOG_WINDOW).read_text())
    if state.ema is not None:
        state.ema.step = state.step
