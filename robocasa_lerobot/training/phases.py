"""Runs the phases of an experiment: finished ones are skipped, begun ones go on."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from pathlib import Path

from accelerate import Accelerator, DistributedDataParallelKwargs, InitProcessGroupKwargs

from robocasa_lerobot.data.mixture import check_share
from robocasa_lerobot.data.registry.hub import fetch_missing
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.locks import LockHeldError, locked
from robocasa_lerobot.training import metrics, records
from robocasa_lerobot.training.augment import check_cameras
from robocasa_lerobot.training.config.experiment import FROM_SCRATCH, HUB, ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.interrupts import Interrupts
from robocasa_lerobot.training.loop import any_process, train_phase
from robocasa_lerobot.training.planning import skipped
from robocasa_lerobot.training.planning.evaluations import Evaluations, phase_evaluations
from robocasa_lerobot.training.planning.unavailable import runnable
from robocasa_lerobot.training.setup import builders, features
from robocasa_lerobot.training.setup import phase_data as joining
from robocasa_lerobot.training.setup.build_phase import (
    check_begun,
    check_policy,
    planned_policy,
    prepare_phase,
    start_of,
)
from robocasa_lerobot.training.setup.kept import check_kept_settings
from robocasa_lerobot.training.setup.optimizers import check_optimizer
from robocasa_lerobot.training.waiting import BARRIER, first_process_works
from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint, tidy


def run_experiment(
    experiment: ExperimentConfig,
    stop_after: int | None = None,
    force: bool = False,
    only: str | None = None,
    evaluate: bool = False,
    interrupts: Interrupts | None = None,
) -> bool:
    """Run the phases that are not finished yet; returns whether all that were asked for are.

    Args:
        experiment: what to run; the same experiment again continues where it was.
        stop_after: save and end after this many optimiser steps, for time slices.
        force: continue although settings of a begun phase have changed.
        only: the one phase to run; the one that it starts from must be finished.
        evaluate: run the phases' evaluations when they are finished.
        interrupts: tells afterwards why it ended; None makes one.

    Raises:
        UserError: settings or data of a begun phase have changed, something in the configuration does not fit, or the
            same training is running; at the end, evaluations that failed.
    """
    interrupts = interrupts or Interrupts(stop_after)
    output = Path(experiment.output_dir)
    device = builders.best_device(experiment.device)
    if experiment.mixed_precision == "fp16" and device == "cpu":  # which Accelerate would leave out without a word
        raise UserError("mixed_precision: fp16 needs a GPU; on a CPU set bf16, or no.")
    metrics.check_trackers(experiment.trackers)
    accelerator = Accelerator(
        cpu=device == "cpu",
        mixed_precision=experiment.mixed_precision,
        # As in LeRobot's training: some policies leave parameters unused.
        kwargs_handlers=[
            DistributedDataParallelKwargs(find_unused_parameters=True),
            InitProcessGroupKwargs(timeout=BARRIER),
        ],
        log_with=list(experiment.trackers) or None,
        project_dir=str(output),
    )
    asked = experiment.phases if only is None else [experiment.phase(only)]
    records.check_unchanged(experiment, output, force)
    records.check_descent(experiment, output)
    if only is None:
        records.check_parents(experiment, output)
    whole, (experiment, left_out) = experiment, runnable(experiment)
    phases = [phase for phase in experiment.phases if phase.name in {other.name for other in asked}]
    # A mistake in the last phase should not wait for the first to finish. The first process makes fake datasets.
    with accelerator.main_process_first():
        if accelerator.is_local_main_process:
            todo = [phase for phase in phases if not is_finished(output, phase)]
            fetch_missing(mixture for phase in todo for mixture in joining.needed_mixtures(experiment, phase))
        for phase in phases:
            if not is_finished(output, phase):
                check_phase(experiment, phase, device, only is not None, force, accelerator.num_processes)
        evaluations = Evaluations(experiment, phases, accelerator.is_main_process) if evaluate else None
        for phase in phases:  # weights on the hub, once all is well: a later phase should not wait for them either
            begun = last_checkpoint(output / phase.name) is not None
            if not begun and experiment.init_of(phase).startswith(HUB):
                start_of(experiment, phase)
    left_out += evaluations.left_out if evaluations is not None else []
    for item in left_out:
        accelerator.print(item)
    if accelerator.is_main_process:
        output.mkdir(parents=True, exist_ok=True)
        if all(is_finished(output, phase) for phase in phases):
            records.write_experiment(output, whole)
        skipped.decide(output, left_out, {phase.name for phase in phases}, evaluate)
    accelerator.wait_for_everyone()
    metrics.start_trackers(accelerator, experiment.name, {"seed": experiment.seed, "policy": experiment.policy})
    try:
        with interrupts.listening():
            finished = _run(experiment, whole, phases, device, accelerator, interrupts, evaluations, force)
    finally:
        accelerator.end_training()
    if finished and evaluations is not None:  # else the same command goes on, and runs those that failed again
        evaluations.check_none_failed()
    return finished


def is_finished(output: Path, phase: PhaseConfig) -> bool:
    """Whether a phase has the checkpoint of its last step."""
    last = last_checkpoint(output / phase.name)
    return last is not None and checkpoint_step(last) >= phase.steps


def check_phase(
    experiment: ExperimentConfig,
    phase: PhaseConfig,
    device: str,
    alone: bool = False,
    force: bool = False,
    processes: int = 1,
) -> None:
    """Check what can be checked before training: policy, data, evaluation files, and with `alone` the start.

    No weights are read for it. With `force`, as what has begun is to go on with the settings of now.

    Raises:
        UserError: something is missing, or does not fit.
    """
    settings, checkpoint = planned_policy(experiment, phase)
    config = builders.policy_config(settings, checkpoint, device)
    data, parent = joining.open_phase_data(experiment, phase), experiment.parent(phase)
    meta, begun = data.meta, last_checkpoint(Path(experiment.output_dir) / phase.name) is not None
    check_cameras(phase, meta)
    check_optimizer(config, phase)
    check_share(phase.batch_size // phase.gradient_accumulation, processes)
    check_begun(experiment, phase, device, data, force)
    if checkpoint is not None:
        features.check_features(config, meta)
        if phase.statistics == "keep" and parent is None:
            features.check_kept_statistics(builders.read_config(checkpoint), meta)
    elif parent is not None:
        first = experiment.ancestors(phase)[0]
        # Of one that has begun the data may be gone; the phase after it is held against its checkpoint soon.
        if last_checkpoint(Path(experiment.output_dir) / first.name) is None:
            features.take_features(config, joining.open_phase_data(experiment, first).meta, settings)
            features.check_features(config, meta, f"what phase {first.name!r} trains")
    if not begun:
        if parent is None:
            builders.check_processors(config, meta)
        start = None
        if experiment.init_of(phase) != FROM_SCRATCH:
            before = planned_policy(experiment, parent) if parent is not None else ({}, checkpoint)
            start = builders.policy_config(*before, device)
            if phase.statistics == "keep":
                check_kept_settings(config, start, phase.name)
        check_policy(config, start, meta, phase)
    phase_evaluations(phase)
    if alone and not begun:
        start_of(experiment, phase)


def _run(
    experiment: ExperimentConfig,
    whole: ExperimentConfig,
    phases: list[PhaseConfig],
    device: str,
    accelerator: Accelerator,
    interrupts: Interrupts,
    evaluations: Evaluations | None,
    force: bool,
) -> bool:
    output = Path(experiment.output_dir)
    for phase in phases:
        with contextlib.ExitStack() as held:
            if evaluations is not None or not is_finished(output, phase):
                held.enter_context(_alone_in(phase, output, accelerator))
            if is_finished(output, phase):
                accelerator.print(f"phase {phase.name}: finished before")
                if accelerator.is_main_process:
                    tidy(output / phase.name)
            else:
                if any_process(interrupts.due, accelerator):  # a phase's last step was the last one for now
                    accelerator.print(f"stopped before phase {phase.name}; the same command goes on")
                    return False
                run = prepare_phase(experiment, phase, device, accelerator, interrupts.stop, force)
                if accelerator.is_main_process:  # what a phase has refused is not what the folder holds
                    records.write_experiment(output, whole)
                finished = train_phase(run, accelerator)
                step = run.state.step
                del run  # its policy and optimiser need not stay in memory beside the next phase's
                accelerator.free_memory()
                if not finished:
                    accelerator.print(f"stopped in phase {phase.name} at step {step}; the same command goes on")
                    return False
            if evaluations is not None:
                planned = functools.partial(evaluations.run, phase.name, lambda: interrupts.signalled)
                if first_process_works(accelerator, planned):
                    accelerator.print(f"stopped in the evaluations of phase {phase.name}; the same command goes on")
                    return False
    return True


@contextlib.contextmanager
def _alone_in(phase: PhaseConfig, output: Path, accelerator: Accelerator) -> Iterator[None]:
    """Keep other runs out of a phase, by a lock that the first process holds and the system frees when it ends.

    Raises:
        UserError: another run is at it.
    """
    path = output / f".{phase.name}.lock"  # beside the phase's folder, which people remove to begin it anew

    def hold() -> None:
        try:
            held.enter_context(locked(path, wait=False))
        except LockHeldError:
            raise UserError(
                f"the same training is running: another process trains or evaluates phase {phase.name!r} of {output}. "
                f"Wait until it ends, end it, or give another `--output_dir`. If none is, since its machine is gone, "
                f"remove {path}."
            ) from None

    with contextlib.ExitStack() as held:
        first_process_works(accelerator, hold)
        yield
