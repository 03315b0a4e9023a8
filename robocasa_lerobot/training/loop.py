"""The training loop: one for every policy, from batches to checkpoints, readable from top to bottom.

All randomness of a step (noise, diffusion times, crops, dropout) follows from the phase's seed and the number of
the step, and the samples follow from their position, so a run that was killed goes on to the same losses.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from accelerate import Accelerator
from tqdm import tqdm

from robocasa_lerobot.data.mixture import StepBatches
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.checkpoint import TrainingState, save_checkpoint
from robocasa_lerobot.training.config import PhaseConfig

METRICS = "metrics.jsonl"


@dataclass
class PhaseRun:
    """Everything that a phase trains with.

    `batches` holds parts of a batch (`gradient_accumulation` of them make one), `stop` is asked after each step
    whether to save and end early, and `train_config` goes into the checkpoints for LeRobot.
    """

    config: PhaseConfig
    folder: Path
    state: TrainingState
    batches: StepBatches
    camera_keys: list[str]
    grad_clip_norm: float
    seed: int
    workers: int
    train_config: Any
    stop: Callable[[int], bool]


def train_phase(run: PhaseRun, accelerator: Accelerator) -> bool:
    """Train from `run.state.step` to the phase's last step; returns whether it got there.

    Raises:
        UserError: the loss is no longer a finite number.
    """
    config, state, parts = run.config, run.state, run.config.gradient_accumulation
    policy, optimizer = accelerator.prepare(state.policy, state.optimizer)
    policy.train()
    batches = _loader(run, first=state.step * parts, end=config.steps * parts)
    if state.step == 0 and config.save_initial:
        _save(run, accelerator)
    progress = tqdm(
        total=config.steps,
        initial=state.step,
        desc=config.name,
        unit="step",
        smoothing=0.05,
        mininterval=0.2 if sys.stderr.isatty() else 10.0,  # seconds; a log file needs few lines
        disable=not accelerator.is_main_process,
    )
    began, stopped = time.perf_counter(), False
    while state.step < config.steps and not stopped:
        waited, loss_sum = 0.0, torch.zeros((), device=accelerator.device)
        for part in range(parts):
            asked = time.perf_counter()
            batch = state.preprocessor(_as_float(next(batches), run.camera_keys))
            waited += time.perf_counter() - asked
            torch.manual_seed(_step_seed(run.seed, state.step, part, accelerator.process_index))
            with nullcontext() if part == parts - 1 else accelerator.no_sync(policy):
                with accelerator.autocast():
                    loss, outputs = policy(batch)
                accelerator.backward(loss / parts)
            loss_sum += loss.detach() / parts
        clip = run.grad_clip_norm if run.grad_clip_norm > 0 else math.inf
        grad_norm = accelerator.clip_grad_norm_(policy.parameters(), clip)
        learning_rate = optimizer.param_groups[0]["lr"]
        optimizer.step()
        optimizer.zero_grad()
        if state.scheduler is not None:
            state.scheduler.step()
        if state.ema is not None:
            state.ema.update()
        state.step += 1
        progress.update(1)

        mean_loss = accelerator.reduce(loss_sum, reduction="mean")
        _note(state.log_window, loss=mean_loss, grad_norm=grad_norm, seconds=time.perf_counter() - began, waited=waited)
        _note(state.log_window, **{f"policy/{k}": v for k, v in _scalars(outputs).items() if k != "loss"})
        began = time.perf_counter()
        if state.step % config.log_every == 0 or state.step == config.steps:
            line = _metrics_line(state, learning_rate, config.batch_size)
            progress.set_postfix(loss=f"{line['loss']:.4f}", lr=f"{learning_rate:.1e}", refresh=False)
            if not math.isfinite(line["loss"]):
                raise UserError(
                    f"phase {config.name!r}: the loss is {line['loss']} at step {state.step}. Lower `learning_rate`, "
                    "set `grad_clip_norm`, or look for bad values in the data with `robocasa-lerobot verify`. The "
                    "checkpoints written so far are sound."
                )
            if accelerator.is_main_process:
                with (run.folder / METRICS).open("a") as file:
                    file.write(json.dumps(line) + "\n")
        stopped = _agree(run.stop(state.step), accelerator)
        due = config.save_every > 0 and state.step % config.save_every == 0
        if due or stopped or state.step == config.steps:
            _save(run, accelerator)
            began = time.perf_counter()
    progress.close()
    return state.step >= config.steps


def truncate_metrics(folder: Path, step: int) -> None:
    """Drop the lines of steps that will be done again, and a last line that was cut off."""
    path = folder / METRICS
    if not path.is_file():
        return
    lines = path.read_text().splitlines(keepends=True)
    kept = [line for line in lines if line.endswith("}\n") and json.loads(line)["step"] <= step]
    aside = path.with_suffix(".tmp")
    aside.write_text("".join(kept))
    aside.replace(path)


def _loader(run: PhaseRun, first: int, end: int) -> Iterator[dict[str, Any]]:
    loader = torch.utils.data.DataLoader(
        run.batches,
        batch_size=None,  # an item is a whole batch
        sampler=range(first, end),
        num_workers=run.workers,
        prefetch_factor=2 if run.workers else None,
        multiprocessing_context="spawn" if run.workers else None,  # forked video decoders can hang
        pin_memory=torch.cuda.is_available(),
    )
    return iter(loader)


def _as_float(batch: dict[str, Any], camera_keys: list[str]) -> dict[str, Any]:
    """Pictures as float32 in [0, 1], which is what LeRobot's policies take."""
    return {key: value.float().div_(255) if key in camera_keys else value for key, value in batch.items()}


def _step_seed(seed: int, step: int, part: int, process: int) -> int:
    return int(np.random.SeedSequence((seed, step, part, process)).generate_state(1, np.uint64)[0] >> np.uint64(1))


def _scalars(outputs: Any) -> dict[str, float]:
    found = {}
    for key, value in (outputs or {}).items():
        if isinstance(value, int | float) or (isinstance(value, torch.Tensor) and value.numel() == 1):
            found[key] = float(value)
    return found


def _agree(stop: bool, accelerator: Accelerator) -> bool:
    """Whether any process wants to stop: a signal may reach one of them only, and all must save together."""
    if accelerator.num_processes == 1:
        return stop
    return bool(accelerator.reduce(torch.tensor(float(stop), device=accelerator.device), reduction="sum") > 0)


def _note(window: dict[str, list[Any]], **values: Any) -> None:
    for key, value in values.items():
        window.setdefault(key, []).append(value)


def _metrics_line(state: TrainingState, learning_rate: float, batch_size: int) -> dict[str, Any]:
    """Means over the log window, which is emptied."""
    window = {key: [float(v) for v in values] for key, values in state.log_window.items()}
    state.log_window.clear()
    seconds, waited = sum(window.pop("seconds")), sum(window.pop("waited"))
    steps = len(window["loss"])
    line = {"step": state.step, "samples": state.step * batch_size, "learning_rate": learning_rate}
    line |= {key: sum(values) / len(values) for key, values in window.items()}
    return line | {"seconds_per_step": seconds / steps, "data_seconds_per_step": waited / steps}


def _save(run: PhaseRun, accelerator: Accelerator) -> None:
    run.state.log_window = {key: [float(v) for v in values] for key, values in run.state.log_window.items()}
    if accelerator.is_main_process:
        save_checkpoint(run.folder, run.state, run.train_config)
    accelerator.wait_for_everyone()
