"""From a phase's settings to everything that it trains with, fresh or continued from its last checkpoint."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from accelerate import Accelerator
from lerobot.configs.default import DatasetConfig
from lerobot.configs.policies import PreTrainedConfig
from lerobot.configs.train import TrainPipelineConfig

from robocasa_lerobot.data.mixture import MixtureDataset, MixtureMeta, StepBatches
from robocasa_lerobot.data.statistics import Statistics
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.cut_instructions import cut_instructions
from robocasa_lerobot.training import records
from robocasa_lerobot.training.config.experiment import FROM_SCRATCH, HUB, ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.held_out import HeldOut, held_out_frames, without_held_out
from robocasa_lerobot.training.loop import PhaseRun
from robocasa_lerobot.training.metrics import truncate_metrics
from robocasa_lerobot.training.mirror import mirror_statistics
from robocasa_lerobot.training.setup import builders, clipping
from robocasa_lerobot.training.setup import phase_data as joining
from robocasa_lerobot.training.setup.features import LEAVE_OUT, RENAME
from robocasa_lerobot.training.setup.kept import check_kept_settings
from robocasa_lerobot.training.setup.optimizers import in_lerobots_words, make_optimizer, trained_parameters
from robocasa_lerobot.training.weights.adapters import apply_training_scope
from robocasa_lerobot.training.weights.checkpoint import TrainingState, last_checkpoint, pretrained_model, restore, tidy
from robocasa_lerobot.training.weights.ema import Ema
from robocasa_lerobot.training.weights.master_weights import MasterWeights

MOST_HELD_OUT = 32  # frames that are measured at once, however many processes there are: the noise goes by the batch


def prepare_phase(
    experiment: ExperimentConfig,
    phase: PhaseConfig,
    device: str,
    accelerator: Accelerator,
    stop: Callable[[], bool] = lambda: False,
    force: bool = False,
) -> PhaseRun:
    """Data, policy, processors and optimiser of a phase, continued from its last checkpoint if it has one.

    With `force` it is continued with the policy's settings as they are now, and not as they were when it began.

    Raises:
        UserError: data, start and settings do not fit each other, or the phase was begun with other data.
    """
    folder = Path(experiment.output_dir) / phase.name
    last, starts = last_checkpoint(folder), experiment.init_of(phase) != FROM_SCRATCH
    init = start_of(experiment, phase) if last is None else None  # what a begun phase came from may be gone
    settings = _settings_of_start(experiment, phase, last, force)
    start = pretrained_model(last) if last is not None else init
    config = builders.policy_config(settings, start, device)
    keep, rename = starts and phase.statistics == "keep", settings.get(RENAME)
    if start is not None and (keep or last is not None):
        check_kept_settings(config, builders.policy_config({}, start, device), phase.name, begun=last is not None)
    begins = last is None and experiment.parent(phase) is not None
    if begins and not keep and clipping.clips(config) and clipping.RANGE not in settings:
        # What an earlier phase reached for, in statistics that this one does not keep, means nothing in its own.
        planned = builders.policy_config(*planned_policy(experiment, phase), device)
        setattr(config, clipping.RANGE, getattr(planned, clipping.RANGE))
    seed = phase_seed(experiment.seed, phase.name)
    dataset, apart = joining.open_phase_data(experiment, phase), None
    if phase.held_out is not None:
        dataset, apart = without_held_out(dataset, phase.held_out, experiment.data_loader, experiment.seed)
        if apart is None:
            accelerator.print(f"phase {phase.name}: tasks have too few episodes for one to be held out")
    for part in (dataset, apart) if apart is not None else (dataset,):
        builders.set_windows(part, config)
        part.set_picture_size(builders.frame_size(config))
    where = init or (FROM_SCRATCH if last is None else last)
    accelerator.print(f"phase {phase.name}: {phase.steps} steps from {where} on")
    accelerator.print("  " + dataset.describe().replace("\n", "\n  "))
    if cut := cut_instructions(config, dataset.meta.tasks):
        accelerator.print(f"  note: {cut}")
    if starts:
        accelerator.print(f"  statistics of normalisation: {phase.statistics}")
    for part in (dataset, apart) if apart is not None else (dataset,):
        _cache_frames(experiment, part)
    if last is None and not keep:
        pool = init is not None and phase.statistics == "pool"
        imagenet = phase.image_statistics == "imagenet"
        images = not imagenet
        stats = joining.pooled(experiment, phase, dataset, images) if pool else dataset.statistics(images)
        stats = _as_trained(stats, phase)
        cameras = dataset.meta.camera_keys
        dataset.meta.stats = builders.with_imagenet_statistics(stats, cameras) if imagenet else stats

    torch.manual_seed(seed)
    processors: tuple[Any, Any] | None = None
    if keep and last is None and clipping.clips(config) and clipping.RANGE not in phase.policy:
        processors = builders.make_processors(config, dataset.meta, start, keep_statistics=True, rename=rename)
        reach = clipping.widen_clip_range(config, processors[0], _as_trained(dataset.statistics(images=False), phase))
        if reach is not None:
            accelerator.print(f"  actions reach {reach:.1f} times as far as the statistics know: so does sampling now")
    policy = builders.make_phase_policy(config, dataset.meta, start)
    pre, post = processors or builders.make_processors(
        config, dataset.meta, start, keep_statistics=keep or last is not None, rename=rename
    )
    always_eval = apply_training_scope(policy, phase, seed)
    masters = MasterWeights(policy)
    if len(masters) and experiment.mixed_precision == "fp16":
        raise UserError(
            f"the policy {config.type!r} has weights in half precision, whose gradients fp16 cannot scale; set "
            "`mixed_precision: bf16`, or the policy's own type of weights to float32."
        )
    optimizer, scheduler, clip = make_optimizer(policy, phase, masters)
    ema = Ema(policy, phase.ema, masters=masters) if phase.ema.enabled else None
    state = TrainingState(
        policy,
        pre,
        post,
        optimizer,
        scheduler,
        ema,
        masters,
        low_rank=phase.lora is not None,
        scaler=accelerator.scaler,
    )
    about = records.describe_phase(
        experiment, phase, dataset, policy, init, builders.device_name(device), begun=last is not None
    )
    if last is not None:
        records.check_same_data(folder, dataset, force)
        restore(last, state)
        accelerator.print(f"phase {phase.name}: going on from step {state.step}")
    accelerator.wait_for_everyone()  # all have read the files that are replaced now
    if accelerator.is_main_process:
        records.write_records(folder, about, experiment, phase)
        tidy(folder)
        truncate_metrics(folder, state.step)
    share = phase.batch_size // phase.gradient_accumulation
    dropped = phase.drop_last_frames
    if dropped is None:
        # LeRobot's policies compute it from lengths with which it may come to less than none.
        dropped = max(0, getattr(config, "drop_n_last_frames", None) or 0)
    sampler = dataset.sampler(seed, drop_last_frames=dropped)
    held_out = None
    if apart is not None and phase.held_out is not None:
        frames = held_out_frames(apart, phase.held_out.samples, experiment.seed)
        held_out = HeldOut(phase.held_out, apart, frames, min(share, MOST_HELD_OUT))
    return PhaseRun(
        config=phase,
        folder=folder,
        state=state,
        batches=StepBatches(dataset, sampler, share, accelerator.process_index, accelerator.num_processes),
        camera_keys=dataset.meta.camera_keys,
        grad_clip_norm=clip,
        seed=seed,
        workers=experiment.loader.workers,
        train_config=_lerobot_config(experiment, phase, config, dataset),
        stop=stop,
        held_out=held_out,
        always_eval=always_eval,
        earlier_steps=sum(other.steps for other in experiment.phases[: experiment.phases.index(phase)]),
    )


def check_begun(
    experiment: ExperimentConfig, phase: PhaseConfig, device: str, data: MixtureDataset, force: bool
) -> None:
    """Check that a phase that has begun can go on with these settings and data; see `prepare_phase`.

    Raises:
        UserError: it cannot.
    """
    folder = Path(experiment.output_dir) / phase.name
    last = last_checkpoint(folder)
    if last is None:
        return
    start = pretrained_model(last)
    config = builders.policy_config(_settings_of_start(experiment, phase, last, force), start, device)
    check_kept_settings(config, builders.policy_config({}, start, device), phase.name, begun=True)
    if phase.held_out is not None:
        data, _ = without_held_out(data, phase.held_out, experiment.data_loader, experiment.seed)
    records.check_same_data(folder, data, force)


def check_policy(
    config: PreTrainedConfig, before: PreTrainedConfig | None, meta: MixtureMeta, phase: PhaseConfig
) -> None:
    """Check a phase's policy, built without weights: their sizes, and what it freezes or changes by low ranks.

    A policy that cannot be built so is not looked at: its phase will say. `before` is that which the phase starts from.

    Raises:
        UserError: the phase changes settings that its weights go by, a pattern fits nothing, or nothing is trained.
    """
    changed = [key for key in phase.policy if key not in (RENAME, LEAVE_OUT, "type")] if before is not None else []
    scope = bool(phase.freeze) or phase.lora is not None
    if not changed and not scope:
        return
    try:
        policy = builders.policy_without_weights(config, meta)
        theirs = _sizes(builders.policy_without_weights(before, meta)) if before is not None and changed else {}
    except Exception:  # as where packages are missing
        return
    ours = _sizes(policy) if changed else {}
    differ = [name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name)]
    if differ:
        name, settings = min(differ), ", ".join(f"policy.{key}" for key in changed)
        raise UserError(
            f"phase {phase.name!r} sets {settings}, with which {len(differ)} of the weights that it starts from do not "
            f"fit: {name} has {_size(theirs.get(name))} there, and "
            f"{_size(ours.get(name))} here. Leave settings that change sizes to the policy it starts from, or set "
            f"`init: {FROM_SCRATCH}`."
        )
    if scope:
        apply_training_scope(policy, phase, seed=0)
        trained_parameters(policy, phase)


def _sizes(policy: torch.nn.Module) -> dict[str, tuple[int, ...]]:
    return {name: tuple(weight.shape) for name, weight in policy.named_parameters()}


def _size(size: tuple[int, ...] | None) -> str:
    return " x ".join(map(str, size)) or "one number" if size is not None else "none"


def phase_seed(seed: int, name: str) -> int:
    """The seed of a phase: no two phases of an experiment see the same noise or sample order."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:4], "big")


def policy_settings(experiment: ExperimentConfig, phase: PhaseConfig) -> dict[str, Any]:
    """What the policy's configuration is made of, or what changes in the checkpoint's it starts from.

    Raises:
        UserError: the phase starts from scratch, and no type of policy is given, or it names inputs of weights.
    """
    init = experiment.init_of(phase)
    own = experiment.policy if experiment.parent(phase) is None else {}  # a phase before has them already
    if phase.policy.get("type", own.get("type")) != own.get("type"):
        own = {}  # another policy than the experiment's, whose fields are none of its
    settings = builders.laid_over(own, phase.policy)
    kind = settings.get("type", experiment.policy.get("type"))
    if kind == "groot":  # its warm-up is `warmup_ratio` of these, which LeRobot leaves at 10,000 for any training
        settings.setdefault("max_steps", phase.schedule_steps or phase.steps)
    if init == FROM_SCRATCH:
        settings.pop("path", None)
        if "type" not in settings:
            raise UserError(f"phase {phase.name!r} starts {FROM_SCRATCH}, so `policy` needs a `type`.")
        for key in (RENAME, LEAVE_OUT):  # the experiment's are for those of its phases that have weights
            if phase.policy.get(key):
                raise UserError(
                    f"phase {phase.name!r} sets policy.{key}, which says what inputs of weights are in the data, and "
                    f"starts {FROM_SCRATCH}, with the inputs of the data: leave it away, or give weights in `init`. "
                    "Cameras of the data are left out by `loader.cameras`."
                )
    return settings


def _settings_of_start(
    experiment: ExperimentConfig, phase: PhaseConfig, last: Path | None, force: bool
) -> dict[str, Any]:
    """What changes in the policy's configuration of the checkpoint that a phase goes on from, or begins with.

    A begun phase keeps its own unless with `force`. One that begins from an earlier phase has what the experiment says
    now, which may have changed since that one was trained; but not less reach than it was given then.
    """
    parent = experiment.parent(phase)
    if last is not None:
        return _laid_over(experiment, phase) if force else {}
    own = policy_settings(experiment, phase)
    if parent is None:
        return own
    before = _laid_over(experiment, parent)
    if phase.statistics == "keep":
        before.pop(clipping.RANGE, None)
    return {**before, **own}


def _laid_over(experiment: ExperimentConfig, phase: PhaseConfig) -> dict[str, Any]:
    """What a phase's policy has now, to be laid over its checkpoint, whose inputs are the data's already."""
    settings, _ = planned_policy(experiment, phase)
    return {key: value for key, value in settings.items() if key not in (RENAME, LEAVE_OUT)}


def planned_policy(
    experiment: ExperimentConfig, phase: PhaseConfig, offline: bool = False
) -> tuple[dict[str, Any], Path | None]:
    """Settings of a phase's policy, with those of the phases it builds on, and the checkpoint at their beginning.

    Of a checkpoint on the hub, the folder has its config.json alone; with `offline` it is None unless it was
    downloaded before.
    """
    parent = experiment.parent(phase)
    if parent is None:
        init = experiment.init_of(phase)
        return policy_settings(experiment, phase), None if init == FROM_SCRATCH else _config_folder(init, offline)
    settings, checkpoint = planned_policy(experiment, parent, offline)
    kind, asked = settings.get("type", experiment.policy.get("type")), phase.policy.get("type")
    if None not in (kind, asked) and kind != asked:
        raise UserError(
            f"phase {phase.name!r} starts from phase {parent.name!r}, which trains a policy of type {kind!r}, and asks "
            f"for {asked!r}. Leave `policy.type` out, or set `init: {FROM_SCRATCH}`."
        )
    return builders.laid_over(settings, policy_settings(experiment, phase)), checkpoint


def _config_folder(init: str, offline: bool) -> Path | None:
    name = init.removeprefix(HUB)
    if name == init:
        return Path(init)
    return builders.cached_hub_config(name) if offline else builders.hub_config(name)


def start_of(experiment: ExperimentConfig, phase: PhaseConfig) -> Path | None:
    """The `pretrained_model` folder that a phase starts from, or None.

    Raises:
        UserError: the phase that it starts from has no checkpoint yet.
    """
    init, parent = experiment.init_of(phase), experiment.parent(phase)
    if init == FROM_SCRATCH:
        return None
    if parent is None:
        return _folder(init)
    last = last_checkpoint(Path(experiment.output_dir) / parent.name)
    if last is None or int(last.name) < parent.steps:
        raise UserError(
            f"phase {phase.name!r} starts from {init!r}, which is not finished in {experiment.output_dir}: run it "
            f"first, with `--phase {init}` or all phases."
        )
    return pretrained_model(last)


def _folder(init: str) -> Path:
    return builders.hub_checkpoint(init.removeprefix(HUB)) if init.startswith(HUB) else Path(init)


def _as_trained(stats: Statistics, phase: PhaseConfig) -> Statistics:
    """Statistics of what the phase trains on: of the data, or of them and their mirror image."""
    share = phase.augment.mirror if phase.augment is not None else 0.0
    return mirror_statistics(stats, share) if share else stats


def _cache_frames(experiment: ExperimentConfig, dataset: MixtureDataset) -> None:
    loader = experiment.data_loader
    if loader.cache_frames is False or loader.cache_dir is None:
        return
    budget = None if loader.cache_frames else loader.cache_budget_gb * 1e9
    dataset.cache_frames(Path(loader.cache_dir), budget)


def _lerobot_config(
    experiment: ExperimentConfig, phase: PhaseConfig, config: Any, dataset: MixtureDataset
) -> TrainPipelineConfig:
    """The settings in LeRobot's own form, for `train_config.json`; it has room for one dataset, the first."""
    root = Path(dataset.config.members[0].root)
    optimizer, scheduler = in_lerobots_words(config, phase)
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
        optimizer=optimizer,
        scheduler=scheduler,
    )
