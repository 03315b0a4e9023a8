"""What an experiment would do: its graph with steps and samples, missing data, disk, and hours on this device."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from accelerate import Accelerator
from huggingface_hub.constants import SAFETENSORS_SINGLE_FILE
from lerobot.configs.policies import PreTrainedConfig

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset, MixtureMeta
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.registry.registry import missing_datasets
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.cut_instructions import cut_instructions
from robocasa_lerobot.training.config.experiment import FROM_SCRATCH, ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.loop import PhaseRun, train_phase
from robocasa_lerobot.training.metrics import METRICS, read_lines
from robocasa_lerobot.training.planning.evaluations import phase_evaluations
from robocasa_lerobot.training.planning.skipped import PHASE
from robocasa_lerobot.training.planning.unavailable import runnable
from robocasa_lerobot.training.setup import builders
from robocasa_lerobot.training.setup import phase_data as joining
from robocasa_lerobot.training.setup.build_phase import planned_policy, prepare_phase
from robocasa_lerobot.training.weights.adapters import apply_training_scope
from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint
from robocasa_lerobot.training.weights.master_weights import half_parameters

MEASURED_STEPS = 20
_FEWEST_STEPS, _MEASURED_SECONDS = 6, 20.0  # a slow machine measures no more steps than it takes seconds for
_LARGEST_ON_CPU = 2e8  # parameters; 20 steps of more take hours without an accelerator
_IMAGE_SIZE = 256  # pixels of the published datasets and ours


@dataclass
class PhasePlan:
    """A phase to come.

    Attributes:
        depth: phases that it builds on.
        start: where its weights come from.
        done: optimiser steps that are done already.
        frames: of its data, or None where some are missing.
        missing: its datasets that are not there, each with how to get it.
        parameters: of its policy, and those of them that are trained; None where it cannot be built here.
        checkpoint_bytes: size of a checkpoint; `kept` of them stay, and for a moment there are `aside` more: a new
            one is whole before an old one is removed.
        cached: bytes of decoded frames on disk, by dataset: phases share them.
        seconds: per optimiser step on this device, without waiting for data; None where not measured.
        notes: what keeps it from running, or was left out.
        left_out: why the phase will not run at all, or "".
    """

    phase: PhaseConfig
    depth: int
    start: str
    done: int = 0
    frames: int | None = None
    missing: list[str] = field(default_factory=list)
    parameters: tuple[int, int] | None = None
    checkpoint_bytes: int | None = None
    kept: int = 1
    aside: int = 0
    cached: dict[Path, int] = field(default_factory=dict)
    seconds: float | None = None
    notes: list[str] = field(default_factory=list)
    left_out: str = ""

    @property
    def cache_bytes(self) -> int:
        """Decoded frames on disk."""
        return sum(self.cached.values())

    @property
    def samples(self) -> int:
        """Samples that the whole phase sees."""
        return 0 if self.left_out else self.phase.steps * self.phase.batch_size

    @property
    def hours(self) -> float | None:
        """Hours of the steps that are still to do."""
        return None if self.seconds is None else self.seconds * (self.phase.steps - self.done) / 3600


def plan_experiment(
    experiment: ExperimentConfig,
    only: str | None = None,
    measured_steps: int = MEASURED_STEPS,
    measured: dict[str, float | str] | None = None,
) -> list[PhasePlan]:
    """The plan of each phase, or of one; nothing is trained or written in `output_dir`.

    Args:
        experiment: what to plan.
        only: the one phase to plan; None is all.
        measured_steps: optimiser steps with made-up data that are timed for each kind of step that differs, fewer where
            they are slow; 0: none.
        measured: times of kinds of steps that are known already, and to which new ones are added.

    Raises:
        UserError: a mistake in the settings. Missing data or weights are not one: the plan tells of them.
    """
    device = builders.best_device(experiment.device)
    plans, measured = [], {} if measured is None else measured
    whole, (experiment, said) = experiment, runnable(experiment)
    for asked in [whole.phase(only)] if only is not None else whole.phases:
        about = [item for item in said if item.phase == asked.name]
        if any(item.kind == PHASE for item in about):
            depth, start = len(whole.ancestors(asked)), whole.init_of(asked)
            plans.append(PhasePlan(asked, depth, start, left_out=" ".join(item.reason for item in about)))
            continue
        phase = experiment.phase(asked.name)
        plan = _plan_phase(experiment, phase, device)
        plan.notes += [item.reason for item in about]
        if measured_steps and plan.parameters is not None and plan.done < phase.steps:
            if device == "cpu" and plan.parameters[0] > _LARGEST_ON_CPU:
                plan.notes.append("not measured: too large for a CPU; plan on the machine that will train")
            else:
                key = _what_a_step_is(experiment, phase)
                if key not in measured:
                    measured[key] = _measure(experiment, phase, device, measured_steps)
                found = measured[key]
                plan.seconds = found if isinstance(found, float) else None
                plan.notes += [found] if isinstance(found, str) else []
        plans.append(plan)
    return plans


def _plan_phase(experiment: ExperimentConfig, phase: PhaseConfig, device: str) -> PhasePlan:
    last = last_checkpoint(Path(experiment.output_dir) / phase.name)
    done = min(checkpoint_step(last), phase.steps) if last is not None else 0
    plan = PhasePlan(phase, len(experiment.ancestors(phase)), experiment.init_of(phase), done)
    phase_evaluations(phase)
    missing = [e for mixture in joining.needed_mixtures(experiment, phase) for e in missing_datasets(mixture)]
    plan.missing = list(dict.fromkeys(f"{e.task} ({e.split}, {e.source}): {e.missing}" for e in missing))
    dataset = joining.open_phase_data(experiment, phase) if not missing else None
    config: PreTrainedConfig | None = None
    try:
        settings, checkpoint = planned_policy(experiment, phase)
        config = builders.policy_config(settings, checkpoint, device)
    except UserError as error:
        if not experiment.init_of(phase).startswith("hub:") and "hub" not in str(error):
            raise
        plan.notes.append(str(error))
    if dataset is not None:
        _plan_data(experiment.loader, dataset, builders.frame_size(config) if config is not None else None, plan)
    if config is not None:
        _plan_policy(config, dataset.meta if dataset is not None else _made_up_meta(experiment.loader), phase, plan)
    return plan


def _plan_data(loader: LoaderConfig, dataset: MixtureDataset, size: tuple[int, int] | None, plan: PhasePlan) -> None:
    """Frames, and the disk that their pictures take as the policy brings them to `size`."""
    plan.frames = dataset.meta.total_frames
    dataset.set_picture_size(size)
    cached = {root.absolute(): count for root, count in dataset.cached_bytes().items()}
    fits = sum(cached.values()) <= loader.cache_budget_gb * 1e9
    plan.cached = cached if loader.cache_frames or (loader.cache_frames is None and fits) else {}


def _plan_policy(config: PreTrainedConfig, meta: MixtureMeta, phase: PhaseConfig, plan: PhasePlan) -> None:
    """Sizes of the policy, which is built without memory for its weights, and what it does not read."""
    if cut := cut_instructions(config, meta.tasks):
        plan.notes.append(cut)
    try:
        policy = builders.policy_without_weights(config, meta)
    except Exception as error:  # where weights or packages are missing
        plan.notes.append(f"the policy {config.type!r} cannot be built here: {_first_line(error)}")
        return
    total = sum(p.numel() for p in policy.parameters())
    apply_training_scope(policy, phase, seed=0)
    plan.parameters = (total, sum(p.numel() for p in policy.parameters() if p.requires_grad))
    plan.checkpoint_bytes = _checkpoint_bytes(policy, phase)
    plan.kept, plan.aside = _checkpoints_kept(phase)


def _checkpoint_bytes(policy: torch.nn.Module, phase: PhaseConfig) -> int:
    """What `save_checkpoint` writes, without what is small beside it."""
    trained = sum(p.numel() for p in policy.parameters() if p.requires_grad)
    half = sum(p.numel() for p in half_parameters(policy))
    weights = sum(p.numel() * p.element_size() for p in policy.parameters())
    low_rank = phase.lora is not None
    twice = phase.ema.enabled or low_rank  # averaged or merged ones beside those that are trained
    average = phase.ema.enabled and (low_rank or half > 0)
    return weights * (1 + twice) + 4 * half + 4 * trained * average + 8 * trained  # float32; two are Adam's


def _checkpoints_kept(phase: PhaseConfig) -> tuple[int, int]:
    """How many stay, and how many more there are while one is written."""
    steps = {phase.steps, *(range(phase.save_every, phase.steps, phase.save_every) if phase.save_every else ())}
    kept = steps
    if phase.keep_last:
        always = {s for s in steps if phase.keep_every and s % phase.keep_every == 0}
        kept = always | set(sorted(steps)[-phase.keep_last :])
    return len(kept) + phase.save_initial, int(len(kept) < len(steps))


def _what_a_step_is(experiment: ExperimentConfig, phase: PhaseConfig) -> str:
    settings, checkpoint = planned_policy(experiment, phase)
    names = ("batch_size", "gradient_accumulation", "freeze", "lora", "augment", "compile", "ema")
    asked = dataclasses.asdict(phase)
    return json.dumps([settings, str(checkpoint), {name: asked[name] for name in names}], sort_keys=True, default=str)


def _measure(experiment: ExperimentConfig, phase: PhaseConfig, device: str, steps: int) -> float | str:
    """Seconds per step, the median after the first quarter; or why there are none."""
    settings, checkpoint = planned_policy(experiment, phase)
    if checkpoint is not None and not (checkpoint / SAFETENSORS_SINGLE_FILE).is_file():
        return f"not measured: no weights in {checkpoint} yet, which a training downloads from the hub"
    with tempfile.TemporaryDirectory(prefix="plan_") as folder:
        size = experiment.loader.image_size or _IMAGE_SIZE
        data = write_fake_dataset(Path(folder) / "fake", episodes=2, length=64, image_size=size)
        alone = dataclasses.replace(
            phase,
            mixture=MixtureConfig(members=[MemberConfig(str(data))]),
            steps=steps,
            init=str(checkpoint) if checkpoint else FROM_SCRATCH,
            statistics="replace",
            policy=settings,
            replay=None,
            held_out=None,
            save_every=0,
            save_initial=False,
            log_every=1,
        )
        loader = dataclasses.replace(experiment.loader, cache_dir=None, cache_frames=None, workers=0)
        trial = dataclasses.replace(experiment, output_dir=folder, phases=[alone], loader=loader, trackers=[])
        accelerator = Accelerator(cpu=device == "cpu", mixed_precision=experiment.mixed_precision)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # what a training tells of itself is not about the plan
                run = prepare_phase(trial, alone, device, accelerator)
                run.save = False
                run.stop = _measured_enough(run, time.perf_counter() + _MEASURED_SECONDS)
                train_phase(run, accelerator)
        except (UserError, RuntimeError) as error:  # too little memory is a RuntimeError
            return f"could not be measured: {_first_line(error)}"
        finally:
            accelerator.free_memory()
        lines = read_lines(Path(folder) / phase.name / METRICS)
    times = [line["seconds_per_step"] - line["data_seconds_per_step"] for line in lines]
    return statistics.median(times[len(times) // 4 :])


def _measured_enough(run: PhaseRun, deadline: float) -> Callable[[], bool]:
    """Whether a training has been measured for long enough."""
    return lambda: run.state.step >= _FEWEST_STEPS and time.perf_counter() > deadline


def _made_up_meta(loader: LoaderConfig) -> MixtureMeta:
    """Of data that are not there, as if they were recorded in our kitchen."""
    size = loader.image_size or _IMAGE_SIZE
    features: dict[str, Any] = dict(contract.dataset_features((size, size)))
    pictures = {key: features.pop(key) for key in contract.IMAGE_KEYS}
    if loader.cameras is not None:
        pictures = {contract.image_key(name): pictures[contract.IMAGE_KEYS[0]] for name in loader.cameras}
    return MixtureMeta({**pictures, **features}, contract.VIDEO_FPS, contract.ROBOT_TYPE, ["-"], 1, 1)


def _first_line(error: BaseException) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[0] if lines else type(error).__name__)[:300]
