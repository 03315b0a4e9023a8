"""Runs the phases of an experiment: what is finished is skipped, what was begun goes on."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import torch
import yaml
from accelerate import Accelerator, DistributedDataParallelKwargs
from lerobot.configs.default import DatasetConfig
from lerobot.configs.train import TrainPipelineConfig

from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches, open_mixture
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training import builders, overlay
from robocasa_lerobot.training.checkpoint import (
    TrainingState,
    checkpoint_step,
    last_checkpoint,
    pretrained_model,
    restore,
)
from robocasa_lerobot.training.config import FROM_SCRATCH, ExperimentConfig, PhaseConfig, to_yaml
from robocasa_lerobot.training.ema import Ema
from robocasa_lerobot.training.loop import PhaseRun, train_phase, truncate_metrics

EXPERIMENT_FILE, PHASE_FILE = "experiment.yaml", "phase.json"
# Settings that may change while a phase is under way, because the losses do not depend on them.
FREE_SETTINGS = ("loader.workers", "loader.cache", "device", "save_every", "log_every")


def run_experiment(experiment: ExperimentConfig, stop_after: int | None = None, force: bool = False) -> bool:
    """Run the phases that are not finished yet; returns whether all are.

    Args:
        experiment: what to run; the same experiment again continues where it was.
        stop_after: save and end after this many optimiser steps, for time slices.
        force: continue although settings of a begun phase have changed.

    Raises:
        UserError: settings or data of a begun phase have changed, or something in the configuration does not fit.
    """
    output = Path(experiment.output_dir)
    device = builders.best_device(experiment.device)
    accelerator = Accelerator(
        cpu=device == "cpu",
        mixed_precision=experiment.mixed_precision,
        # As in LeRobot's training: some policies leave parameters unused.
        kwargs_handlers=[DistributedDataParallelKwargs(find_unused_parameters=True)],
    )
    check_unchanged(experiment, output, force)
    for phase in experiment.phases:  # a mistake in the last phase should not wait for the first to finish
        if not is_finished(output, phase):
            builders.policy_config(*_planned_policy(experiment, phase), device)
            open_mixture(phase.mixture, experiment.loader)
    if accelerator.is_main_process:
        output.mkdir(parents=True, exist_ok=True)
        aside = output / f".{EXPERIMENT_FILE}"
        aside.write_text(to_yaml(experiment))
        aside.replace(output / EXPERIMENT_FILE)
    accelerator.wait_for_everyone()
    with _stop_requests(stop_after) as stop:
        for phase in experiment.phases:
            if is_finished(output, phase):
                accelerator.print(f"phase {phase.name}: finished before")
                continue
            run = prepare_phase(experiment, phase, device, accelerator, stop)
            if not train_phase(run, accelerator):
                accelerator.print(f"stopped in phase {phase.name} at step {run.state.step}; the same command goes on")
                return False
    return True


def is_finished(output: Path, phase: PhaseConfig) -> bool:
    """Whether a phase has the checkpoint of its last step."""
    last = last_checkpoint(output / phase.name)
    return last is not None and checkpoint_step(last) >= phase.steps


def prepare_phase(
    experiment: ExperimentConfig,
    phase: PhaseConfig,
    device: str,
    accelerator: Accelerator,
    stop: Callable[[int], bool] = lambda _: False,
) -> PhaseRun:
    """Data, policy, processors and optimiser of a phase, continued from its last checkpoint if it has one."""
    folder = Path(experiment.output_dir) / phase.name
    init = _checkpoint_dir(experiment, phase, Path(experiment.output_dir))
    last = last_checkpoint(folder)
    if last is not None:
        config = builders.policy_config({}, pretrained_model(last), device)
    else:
        config = builders.policy_config(_policy_settings(experiment, phase), init, device)
    dataset = open_mixture(phase.mixture, experiment.loader)
    builders.set_windows(dataset, config)
    keep = init is not None and phase.statistics == "keep"
    dataset.set_picture_size(builders.frame_size(config))
    keep = init is not None and phase.statistics == "keep"
    accelerator.print(f"phase {phase.name}: {phase.steps} steps from {init or 'scratch'} on")
    accelerator.print("  " + dataset.describe().replace("\n", "\n  "))
    if init is not None:
        accelerator.print(
            f"  normalised with the statistics of {'the checkpoint it starts from' if keep else 'these data'}"
        )
    _cache_frames(experiment, dataset)
    if last is None and not keep:
        dataset.meta.stats = dataset.statistics()
        if phase.image_statistics == "imagenet":
            cameras = dataset.meta.camera_keys
            dataset.meta.stats = builders.with_imagenet_statistics(dataset.meta.stats, cameras)

    seed = phase_seed(experiment.seed, phase.name)
    torch.manual_seed(seed)
    start = pretrained_model(last) if last is not None else init
    policy = builders.make_phase_policy(config, dataset.meta, start)
    pre, post = builders.make_processors(config, dataset.meta, start, keep_statistics=keep or last is not None)
    optimizer, scheduler, clip = builders.make_optimizer(policy, phase)
    ema = Ema(policy, phase.ema) if phase.ema.enabled else None
    state = TrainingState(policy, pre, post, optimizer, scheduler, ema)
    about = _about(experiment, phase, dataset, policy, init)
    if last is not None:
        _check_same_data(folder, about)
        restore(last, state)
        accelerator.print(f"phase {phase.name}: going on from step {state.step}")
    accelerator.wait_for_everyone()  # all have read what is replaced now
    if accelerator.is_main_process:
        folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f".{PHASE_FILE}"
        aside.write_text(json.dumps(about, indent=2))
        aside.replace(folder / PHASE_FILE)
        truncate_metrics(folder, state.step)
    sampler = dataset.sampler(seed, drop_last_frames=getattr(config, "drop_n_last_frames", None) or 0)
    share = phase.batch_size // phase.gradient_accumulation
    return PhaseRun(
        config=phase,
        folder=folder,
        state=state,
        batches=StepBatches(dataset, sampler, share, accelerator.process_index, accelerator.num_processes),
        camera_keys=dataset.meta.camera_keys,
        grad_clip_norm=clip,
        seed=seed,
        workers=experiment.loader.workers,
        train_config=_lerobot_config(experiment, phase, config),
        stop=stop,
    )


def phase_seed(seed: int, name: str) -> int:
    """The seed of a phase: no two phases of an experiment see the same noise or sample order."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:4], "big")


def check_unchanged(experiment: ExperimentConfig, output: Path, force: bool) -> None:
    """Check that what has begun in `output` is continued as it began.

    Raises:
        UserError: a setting that matters is different; all of them are listed.
    """
    path = output / EXPERIMENT_FILE
    if not path.is_file() or force:
        return
    begun = {phase.name for phase in experiment.phases if last_checkpoint(output / phase.name)}
    old = overlay.flatten(yaml.safe_load(path.read_text()))
    new = overlay.flatten(yaml.safe_load(to_yaml(experiment)))
    lines = [
        f"  {key}: {old.get(key, '(not set)')} -> {new.get(key, '(not set)')}"
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key) and begun and not _may_change(key, begun)
    ]
    if lines:
        raise UserError(
            f"{output} holds the same experiment with other settings:\n" + "\n".join(lines) + "\nGive another "
            "`--output_dir`, remove the folder, or pass `--resume=force` to go on with the new settings."
        )


def _may_change(key: str, begun: set[str]) -> bool:
    if key.startswith("phases."):
        name = next((name for name in begun if key.startswith(f"phases.{name}.")), None)
        return name is None or key.removeprefix(f"phases.{name}.") in FREE_SETTINGS
    return key.startswith(FREE_SETTINGS) or key in ("name", "output_dir")


def _policy_settings(experiment: ExperimentConfig, phase: PhaseConfig) -> dict[str, Any]:
    """What the policy's configuration is made of, or what changes in the checkpoint's it starts from."""
    init = experiment.init_of(phase)
    own = experiment.policy if init in (FROM_SCRATCH, experiment.policy.get("path")) else {}
    settings = {**own, **phase.policy}
    if init == FROM_SCRATCH and "type" not in settings:
        raise UserError(f"phase {phase.name!r} starts {FROM_SCRATCH}, so `policy` needs a `type`.")
    return settings


def _planned_policy(experiment: ExperimentConfig, phase: PhaseConfig) -> tuple[dict[str, Any], Path | None]:
    """Settings of a phase's policy, with those of the phases it builds on, and the checkpoint at their beginning."""
    init = experiment.init_of(phase)
    earlier = next((other for other in experiment.phases if other.name == init), None)
    if earlier is None:
        return _policy_settings(experiment, phase), None if init == FROM_SCRATCH else Path(init)
    settings, checkpoint = _planned_policy(experiment, earlier)
    return {**settings, **_policy_settings(experiment, phase)}, checkpoint


def _checkpoint_dir(experiment: ExperimentConfig, phase: PhaseConfig, output: Path) -> Path | None:
    """The `pretrained_model` folder that a phase starts from, or None."""
    init = experiment.init_of(phase)
    if init == FROM_SCRATCH:
        return None
    if init not in (other.name for other in experiment.phases):
        return Path(init)
    last = last_checkpoint(output / init)
    if last is None:
        raise UserError(f"phase {phase.name!r} starts from {init!r}, which has no checkpoint in {output}.")
    return pretrained_model(last)


def _cache_frames(experiment: ExperimentConfig, dataset: MixtureDataset) -> None:
    loader = experiment.loader
    if loader.cache_frames is False:
        return
    folder = Path(loader.cache_dir) if loader.cache_dir else Path(experiment.output_dir) / "frame_cache"
    budget = None if loader.cache_frames else loader.cache_budget_gb * 1e9
    dataset.cache_frames(folder, budget)


def _about(
    experiment: ExperimentConfig,
    phase: PhaseConfig,
    dataset: MixtureDataset,
    policy: torch.nn.Module,
    init: Path | None,
) -> dict[str, Any]:
    return {
        "experiment": experiment.name,
        "phase": phase.name,
        "init": str(init) if init else FROM_SCRATCH,
        "statistics": phase.statistics if init else "recompute",
        "data": dataset.describe().splitlines(),
        "data_fingerprint": dataset.fingerprint,
        "parameters": sum(p.numel() for p in policy.parameters()),
        "trainable_parameters": sum(p.numel() for p in policy.parameters() if p.requires_grad),
        "versions": {name: metadata.version(name) for name in ("robocasa-lerobot", "lerobot", "torch", "accelerate")},
        "git_commit": _git_commit(),
    }


def _check_same_data(folder: Path, about: dict[str, Any]) -> None:
    path = folder / PHASE_FILE
    if not path.is_file():
        return
    before = json.loads(path.read_text())
    if before["data_fingerprint"] != about["data_fingerprint"]:
        raise UserError(
            f"{folder} was begun with other data: {before['data']}; now: {about['data']} (or their content changed). "
            "Restore them, or start in another `--output_dir`."
        )


@functools.cache
def _git_commit() -> str | None:
    """Commit of the checkout that holds this code, if it is one."""
    here = Path(__file__).parent
    out = subprocess.run(["git", "-C", str(here), "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return out.stdout.strip() or None if out.returncode == 0 else None


def _lerobot_config(experiment: ExperimentConfig, phase: PhaseConfig, config: Any) -> TrainPipelineConfig:
    """The settings in LeRobot's own form, for `train_config.json`; it has room for one dataset, the first."""
    root = Path(phase.mixture.members[0].root)
    return TrainPipelineConfig(
        dataset=DatasetConfig(repo_id=root.name, root=str(root), video_backend="pyav"),
        policy=config,
        output_dir=Path(experiment.output_dir) / phase.name,
        job_name=f"{experiment.name}_{phase.name}",
        seed=experiment.seed,
        batch_size=phase.batch_size,
        steps=phase.steps,
        log_freq=phase.log_every,
        save_freq=phase.save_every,
        num_workers=experiment.loader.workers,
        optimizer=dataclasses.replace(config.get_optimizer_preset()),
        scheduler=config.get_scheduler_preset(),
    )


@contextmanager
def _stop_requests(stop_after: int | None) -> Iterator[Callable[[int], bool]]:
    """A function that says, asked once after each step, whether to save and end; SIGTERM makes it say so."""
    asked = {"signal": False, "steps": 0}

    def on_signal(*_: object) -> None:
        asked["signal"] = True

    def stop(_: int) -> bool:
        asked["steps"] += 1
        return bool(asked["signal"]) or (stop_after is not None and asked["steps"] >= stop_after)

    try:
        before = signal.signal(signal.SIGTERM, on_signal)
    except ValueError:  # not in the main thread: signals are somebody else's
        yield stop
        return
    try:
        yield stop
    finally:
        signal.signal(signal.SIGTERM, before)
