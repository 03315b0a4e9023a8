"""The training loop: one for every policy, from batches to checkpoints, readable from top to bottom.

All randomness of a step (noise, diffusion times, crops, dropout) follows from the phase's seed and the number of
the step, and the samples follow from their position, so a run that was killed goes on to the same losses.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from accelerate import Accelerator
from lerobot.configs.policies import PreTrainedConfig

from robocasa_lerobot.data.mixture import StepBatches
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import written_aside
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.training.augment import augment
from robocasa_lerobot.training.config.phase import PhaseConfig
from robocasa_lerobot.training.cpu_tuning import keep_freed_memory
from robocasa_lerobot.training.held_out import HeldOut
from robocasa_lerobot.training.loading import load_batches
from robocasa_lerobot.training.metrics import HELD_OUT, METRICS, append_line, draw_curve, track
from robocasa_lerobot.training.shared_noise import SharedNoise
from robocasa_lerobot.training.weights.checkpoint import TrainingState, prune, save_checkpoint

BAD_BATCH = "bad_batch"
# Policies whose loss is a mean over the actions inside the episode, of which parts of a batch have different numbers;
# and the setting with which that of LeRobot's diffusion and multi_task_dit is one, too.
MEAN_OF_INSIDE = ("act", "groot", "smolvla")
MASKS_PADDING = "do_mask_loss_for_padding"


@dataclass
class PhaseRun:
    """Everything that a phase trains with.

    `batches` holds parts of a batch (`gradient_accumulation` of them make one), `stop` is asked after each step
    whether to save and end early, `always_eval` are modules that keep out of training mode, `train_config` goes into
    the checkpoints for LeRobot, `earlier_steps` are those of the phases before, and without `save` there are no
    checkpoints.
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
    stop: Callable[[], bool]
    held_out: HeldOut | None = None
    always_eval: list[torch.nn.Module] = field(default_factory=list)
    earlier_steps: int = 0
    save: bool = True


def train_phase(run: PhaseRun, accelerator: Accelerator) -> bool:
    """Train from `run.state.step` to the phase's last step; returns whether it got there.

    Raises:
        UserError: the loss is no longer a finite number; the batch is saved beside the checkpoints.
    """
    config, state, parts = run.config, run.state, run.config.gradient_accumulation
    if accelerator.device.type == "cpu":
        keep_freed_memory()
    policy, optimizer = accelerator.prepare(state.policy, state.optimizer)
    if config.compile:
        state.policy.compile()
    _set_training(run)
    batches = load_batches(run.batches, state.step * parts, config.steps * parts, run.workers)
    if state.step == 0 and config.save_initial:
        _save(run, accelerator)
    progress = Bar(
        total=config.steps,
        initial=state.step,
        desc=config.name,
        unit="step",
        smoothing=0.05,
        mininterval=0.2,  # seconds
        disable=not accelerator.is_main_process,
    )
    began, stopped = time.perf_counter(), False
    while state.step < config.steps and not stopped:
        asked = time.perf_counter()
        loaded = [next(batches) for _ in range(parts)]
        waited = time.perf_counter() - asked
        shares = part_shares(loaded, state.policy.config, accelerator)
        loss_sum = torch.zeros((), device=accelerator.device)
        for part, (batch, share) in enumerate(zip(loaded, shares, strict=True)):
            prepared = _prepare(run, batch, accelerator, part)
            with nullcontext() if part == parts - 1 else accelerator.no_sync(policy):
                with accelerator.autocast(), _noise(run, part, accelerator):
                    loss, outputs = policy(prepared)
                accelerator.backward(loss * share)
            loss_sum += loss.detach() * share
        mean_loss = accelerator.reduce(loss_sum, reduction="mean")
        clip = run.grad_clip_norm if run.grad_clip_norm > 0 else math.inf
        grad_norm = accelerator.clip_grad_norm_(policy.parameters(), clip)
        _check_finite(run, loaded, mean_loss, grad_norm, accelerator)
        learning_rate = max(group["lr"] for group in optimizer.param_groups)
        optimizer.step()
        optimizer.zero_grad()
        if state.scheduler is not None:
            state.scheduler.step()
        if state.ema is not None:
            state.ema.update()
        state.step += 1
        progress.update(1)

        _note(state.log_window, loss=mean_loss, grad_norm=grad_norm, seconds=time.perf_counter() - began, waited=waited)
        _note(state.log_window, **{f"policy/{k}": v for k, v in _scalars(outputs).items() if k != "loss"})
        began = time.perf_counter()
        if state.step % config.log_every == 0 or state.step == config.steps:
            line = _metrics_line(state, learning_rate, config.batch_size)
            progress.set_postfix(loss=f"{line['loss']:.4f}", lr=f"{learning_rate:.1e}", refresh=False)
            if accelerator.is_main_process:
                append_line(run.folder / METRICS, line)
            track(accelerator, config.name, line, run.earlier_steps)
        if run.held_out is not None and run.held_out.due(state.step, config.steps):
            _measure_held_out(run, run.held_out, accelerator)
            began = time.perf_counter()
        stopped = any_process(run.stop(), accelerator)
        due = config.save_every > 0 and state.step % config.save_every == 0
        if due or stopped or state.step == config.steps:
            _save(run, accelerator)
            began = time.perf_counter()
    progress.close()
    if accelerator.is_main_process:
        draw_curve(run.folder)
    return state.step >= config.steps


def _prepare(run: PhaseRun, batch: dict[str, Any], accelerator: Accelerator, part: int | None = None) -> dict[str, Any]:
    """A batch as the policy takes it: pictures as float32 in [0, 1], changed while training, then normalised.

    Pictures travel to the device as bytes, a quarter of their size as floats. `part` None is not training.
    """
    batch = dict(batch)
    for key in run.camera_keys:
        batch[key] = batch[key].to(accelerator.device, non_blocking=True).float().div_(255)
    if part is not None:
        rank, processes = accelerator.process_index, accelerator.num_processes
        if run.config.augment is not None:
            seed = step_seed(run.seed, run.state.step, part, 0)
            batch = augment(batch, run.camera_keys, run.config.augment, seed, rank, processes)
        # Some preprocessors draw: GR00T's crops come from `random`. A number of its own, beyond those of the parts,
        # keeps this apart from the noise, which `_noise` seeds afterwards.
        drawn = step_seed(run.seed, run.state.step, run.config.gradient_accumulation + part, rank)
        random.seed(drawn)
        torch.manual_seed(drawn)
    prepared: dict[str, Any] = run.state.preprocessor(batch)
    return prepared


def _noise(run: PhaseRun, part: int, accelerator: Accelerator) -> AbstractContextManager[Any]:
    """Seed the policy's randomness of a part of a step, alike for any number of processes where that can be."""
    rank, processes = accelerator.process_index, accelerator.num_processes
    torch.manual_seed(step_seed(run.seed, run.state.step, part, rank))
    if processes == 1 or run.config.compile:  # compiled code would leave the mode out
        return nullcontext()
    samples = run.batches.batch_size // processes
    return SharedNoise(samples, rank, processes, step_seed(run.seed, run.state.step, part, 0))


def step_seed(seed: int, step: int, part: int, process: int) -> int:
    """The seed of what a process draws for a part of a step."""
    return int(np.random.SeedSequence((seed, step, part, process)).generate_state(1, np.uint64)[0] >> np.uint64(1))


def part_shares(loaded: list[dict[str, Any]], config: PreTrainedConfig, accelerator: Accelerator) -> list[float]:
    """What each part's loss counts, so that parts and processes add up to the loss of the whole batch.

    Gradients are averaged over the processes afterwards, so the shares of all processes sum to their number.
    """
    equal = [1 / len(loaded)] * len(loaded)
    processes = accelerator.num_processes
    counts = config.type in MEAN_OF_INSIDE or getattr(config, MASKS_PADDING, False)
    if not counts or len(loaded) * processes == 1 or "action_is_pad" not in loaded[0]:
        return equal
    inside = torch.stack([(~batch["action_is_pad"]).sum() for batch in loaded]).double()
    total = float(accelerator.reduce(inside.sum().float().to(accelerator.device), reduction="sum"))
    return [float(count) * processes / total for count in inside] if total else equal


def _check_finite(
    run: PhaseRun, loaded: list[dict[str, Any]], loss: torch.Tensor, grad_norm: Any, accelerator: Accelerator
) -> None:
    """Stop before a step that would make the weights worthless, and keep the batch that led to it.

    Raises:
        UserError: the loss or the gradient is no finite number.
    """
    scaled = accelerator.scaler is not None  # fp16 skips steps whose gradient is too large, by itself
    norm = 0.0 if scaled or grad_norm is None else float(grad_norm)
    if math.isfinite(float(loss)) and math.isfinite(norm):
        return
    step, state = run.state.step, run.state
    path = run.folder / f"{BAD_BATCH}_{step:06d}_rank{accelerator.process_index}.pt"
    with written_aside(path) as aside:
        torch.save({"step": step, "loss": float(loss), "grad_norm": norm, "parts": loaded}, aside)
    bad = sorted(
        {
            k
            for b in loaded
            for k, v in b.items()
            if torch.is_tensor(v) and v.is_floating_point() and not v.isfinite().all()
        }
    )
    found = f"Not finite in it: {', '.join(bad)}. " if bad else "Its values are finite. "
    rates = [group["lr"] for group in state.optimizer.param_groups]
    what = f"the loss is {float(loss)}" + ("" if math.isfinite(norm) else f", the gradient's norm {norm}")
    raise UserError(
        f"phase {run.config.name!r}: {what} at step {step + 1}; the learning rate is {max(rates):.2g}. The batch is in "
        f"{path}. {found}Lower `learning_rate`, set `grad_clip_norm`, or look for bad values in the data with "
        "`robocasa-lerobot verify`. The checkpoints written so far are sound."
    )


def _measure_held_out(run: PhaseRun, held_out: HeldOut, accelerator: Accelerator) -> None:
    """Loss of the weights that checkpoints hold, without augmentation and dropout."""
    state = run.state
    state.policy.eval()
    with state.ema.applied() if state.ema is not None else nullcontext(), accelerator.autocast():
        losses = held_out.measure(lambda b: state.policy(_prepare(run, b, accelerator)), run.seed, accelerator)
    _set_training(run)
    line = {"step": state.step, "loss": sum(losses.values()) / len(losses), "tasks": losses}
    if accelerator.is_main_process:
        append_line(run.folder / HELD_OUT, line)
    tracked = {**line, "held_out_loss": line["loss"], "loss": None}
    track(accelerator, run.config.name, tracked, run.earlier_steps)


def _set_training(run: PhaseRun) -> None:
    run.state.policy.train()
    for module in run.always_eval:
        module.eval()


def _scalars(outputs: Any) -> dict[str, float]:
    found = {}
    for key, value in (outputs or {}).items():
        if isinstance(value, int | float) or (isinstance(value, torch.Tensor) and value.numel() == 1):
            found[key] = float(value)
    return found


def any_process(stop: bool, accelerator: Accelerator) -> bool:
    """Whether any process wants to stop: a signal may reach one of them only, and all must save and end together."""
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
    times = {"seconds_per_step": seconds / steps, "data_seconds_per_step": waited / steps}
    return line | times | {"data_share": waited / seconds, "samples_per_second": steps * batch_size / seconds}


def _save(run: PhaseRun, accelerator: Accelerator) -> None:
    run.state.log_window = {key: [float(v) for v in values] for key, values in run.state.log_window.items()}
    if accelerator.is_main_process and run.save:
        save_checkpoint(run.folder, run.state, run.train_config)
        prune(run.folder, run.config.keep_last, run.config.keep_every)
    accelerator.wait_for_everyone()
