"""From configuration to objects: LeRobot policy configs, policies, processors, optimisers and schedules."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import draccus
import lerobot.policies  # noqa: F401  registers LeRobot's own policy types
import torch
from huggingface_hub import hf_hub_download, snapshot_download, try_to_load_from_cache
from lerobot.configs.policies import PreTrainedConfig
from lerobot.datasets.factory import resolve_delta_timestamps
from lerobot.optim.optimizers import OptimizerConfig
from lerobot.optim.schedulers import CosineDecayWithWarmupSchedulerConfig, DiffuserSchedulerConfig, LRSchedulerConfig
from lerobot.policies.factory import get_policy_class, make_policy, make_pre_post_processors
from lerobot.policies.pretrained import PreTrainedPolicy
from lerobot.utils.constants import ACTION, IMAGENET_STATS, OBS_STATE
from lerobot.utils.feature_utils import dataset_to_policy_features

from robocasa_lerobot.data.mixture import MixtureDataset, MixtureMeta
from robocasa_lerobot.data.statistics import Statistics
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.policies.common.statistics import CONSTANT_RANGE, widen_constant_components
from robocasa_lerobot.policies.needs import explained
from robocasa_lerobot.policies.registry import register_policies
from robocasa_lerobot.training.config.phase import PhaseConfig
from robocasa_lerobot.training.setup.features import LEAVE_OUT, RENAME, fit_features, new_names, renamed_inputs
from robocasa_lerobot.training.setup.features import check_features as _check_features
from robocasa_lerobot.training.setup.kept import rename_kept
from robocasa_lerobot.training.weights.master_weights import MasterWeights

_NO_FIELDS = ("type", "path", RENAME, LEAVE_OUT)  # settings of a policy that are no fields of its configuration
_LOAD_TOKENIZERS = ("pi0", "pi05", "smolvla", "xvla")  # by name, in their processors
_NOT_LOADED = "Could not load state dict"
_BY_NAME = "xvla-adamw"  # LeRobot's optimiser whose rates go by the names of parameters


def best_device(wanted: str | None) -> str:
    """The device asked for, or the best one of this machine.

    Raises:
        UserError: the device asked for is not there, or is one of several by its number.
    """
    available = {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    if wanted is None:
        return next(name for name in ("cuda", "mps", "cpu") if available[name])
    kind, _, number = wanted.partition(":")
    if kind not in available:
        raise UnknownNameError("device", wanted, available)
    if number:  # Accelerate takes the first one of those that the process sees, whatever stands here
        remedy = f", and choose the GPU before the command: `CUDA_VISIBLE_DEVICES={number}`" if kind == "cuda" else ""
        raise UserError(f"device {wanted!r}: found a number, expected a kind of device; set `device: {kind}`{remedy}.")
    if not available[kind]:
        raise UserError(f"device {wanted!r} is not there; set `device: null` for the best one, or `cpu`.")
    return kind


def device_name(device: str) -> str:
    """What a device that PyTorch knows as `cuda`, `cuda:1`, `cpu` or `mps` is called: a GPU by its own name."""
    return torch.cuda.get_device_name(device) if device.startswith("cuda") else device


def policy_config(settings: Mapping[str, Any], checkpoint: Path | None, device: str) -> PreTrainedConfig:
    """A LeRobot policy configuration from `type` and fields, or from a checkpoint's and the fields to change.

    `rename` and `leave_out` among the settings say which inputs of the checkpoint are which of the data
    (`features.py`); a start from scratch takes the data's own.

    Raises:
        UserError: an unknown policy type or field (with the closest match), a wrong value, or no checkpoint there.
    """
    register_policies()
    known = PreTrainedConfig.get_known_choices()
    fields = {key: value for key, value in settings.items() if key not in _NO_FIELDS}
    kind = settings.get("type")
    if checkpoint is not None:
        base = read_config(checkpoint)
        if kind is not None and kind != base["type"]:
            raise UserError(f"{checkpoint} holds a {base['type']!r} policy, the experiment asks for {kind!r}.")
        kind = base.pop("type")
        rename, left_out = settings.get(RENAME) or {}, settings.get(LEAVE_OUT) or []
        base["input_features"] = renamed_inputs(base.get("input_features") or {}, rename, left_out, str(checkpoint))
    else:
        base = {}
    if kind not in known:
        raise UnknownNameError("policy type", str(kind), known)
    names = {f.name for f in dataclasses.fields(PreTrainedConfig.get_choice_class(kind)) if f.init}
    for key in fields:
        if key not in names:
            raise UnknownNameError("key", key, names, f"(in the settings of the policy {kind!r})")
    data = {"push_to_hub": False, **base, **fields, "device": device, "pretrained_path": None, "type": kind}
    try:
        config: PreTrainedConfig = draccus.decode(PreTrainedConfig, data)
    except Exception as error:  # draccus raises several kinds; each says which field and why
        cause = error.__cause__ if isinstance(error.__cause__, UserError) else error
        raise UserError(f"settings of the policy {kind!r}: {cause}") from error
    return config


def frame_size(config: PreTrainedConfig) -> tuple[int, int] | None:
    """(height, width) that the policy itself brings pictures to, so that smaller ones can be cached; else None."""
    names = {"diffusion_transformer": "image_size", "flow_vla": "image_size", "diffusion": "resize_shape"}
    name = names.get(config.type)
    size = getattr(config, name, None) if name else None
    return (int(size[0]), int(size[1])) if size is not None else None


def set_windows(dataset: MixtureDataset, config: PreTrainedConfig) -> None:
    """Give the dataset the policy's windows of observations and actions."""
    dataset.set_windows(resolve_delta_timestamps(config, dataset.meta))


def make_phase_policy(config: PreTrainedConfig, meta: MixtureMeta, checkpoint: Path | None) -> PreTrainedPolicy:
    """A fresh policy for the data, or the checkpoint's with every one of its weights.

    Raises:
        UserError: the data lack a feature of the policy or have another shape, weights do not fit, or something that
            the policy needs is not there.
    """
    with explained(config.type):
        if checkpoint is None:
            policy = make_policy(config, ds_meta=meta)
        else:
            _check_features(config, meta)
            fit_features(config, meta)
            policy = _load(config, meta, checkpoint)
    policy.to(config.device)
    return policy


def _load(config: PreTrainedConfig, meta: MixtureMeta, checkpoint: Path) -> PreTrainedPolicy:
    kwargs = {"dataset_stats": meta.stats, "dataset_meta": meta}
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            policy = get_policy_class(config.type).from_pretrained(checkpoint, config=config, strict=True, **kwargs)
    except RuntimeError as error:
        raise UserError(f"the weights of {checkpoint} do not fit the policy's settings: {error}") from error
    finally:
        print(said.getvalue(), end="")
    # LeRobot's pi0 and pi0.5 go on with random weights where theirs cannot be read or do not fit, and only print it.
    _, failed, reason = said.getvalue().partition(_NOT_LOADED)
    if failed:
        raise UserError(
            f"the weights of {checkpoint} do not fit the policy's settings: {' '.join(reason.split())[:500]}"
        )
    return policy


def make_processors(
    config: PreTrainedConfig,
    meta: MixtureMeta,
    checkpoint: Path | None,
    keep_statistics: bool,
    rename: Mapping[str, str] | None = None,
) -> tuple[Any, Any]:
    """Pre- and postprocessor: the checkpoint's with its statistics, or new ones for the data.

    `rename` is that of the policy's settings, for what the checkpoint's have of other names.

    Raises:
        UserError: something that they need is not there, such as a tokenizer.
    """
    with explained(config.type):
        if checkpoint is None or not keep_statistics:
            stats = meta.stats
            if stats is not None:  # our own policies do so wherever they are trained, and nothing the second time
                narrow = getattr(config, "constant_range", CONSTANT_RANGE)
                stats = widen_constant_components(stats, (OBS_STATE, ACTION), narrow)
            return make_pre_post_processors(config, dataset_stats=stats, dataset_meta=meta)
        overrides = {"device_processor": {"device": str(config.device)}}
        # With the dataset's metadata, some policies' processors (GR00T's) go on as those of a training: random crops,
        # dropout of the state. Without, LeRobot takes them for an evaluation's.
        processors: tuple[Any, Any] = make_pre_post_processors(
            config, pretrained_path=str(checkpoint), preprocessor_overrides=overrides, dataset_meta=meta
        )
        if rename:
            names = new_names(read_config(checkpoint).get("input_features") or {}, rename)
            for processor in processors:
                rename_kept(processor, names)
        return processors


def check_processors(config: PreTrainedConfig, meta: MixtureMeta) -> None:
    """Check that what a policy's processors load by name is there, such as a tokenizer: they are made and forgotten.

    Raises:
        UserError: it is not; how to get it is said.
    """
    if config.type in _LOAD_TOKENIZERS:
        config = copy.deepcopy(config)
        config.input_features = config.input_features or dataset_to_policy_features(meta.features)
        make_processors(config, dataclasses.replace(meta, stats=None), None, keep_statistics=False)


def make_optimizer(
    policy: PreTrainedPolicy, phase: PhaseConfig, masters: MasterWeights | None = None
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.LRScheduler | None, float]:
    """The policy's own optimiser and schedule with the phase's changes, and the largest gradient norm (0: any).

    It updates the float32 copies in `masters` of weights in half precision; None makes them.

    Raises:
        UserError: a setting that the optimiser or schedule does not have, or nothing to train.
    """
    preset = _changed(OptimizerConfig, policy.config.get_optimizer_preset(), phase.optimizer, "optimizer")
    masters = MasterWeights(policy) if masters is None else masters
    optimizer = preset.build(masters.groups(_trained_groups(policy, phase, by_name=preset.type == _BY_NAME)))
    if not isinstance(optimizer, torch.optim.Optimizer):
        raise UserError(f"policy {policy.config.type!r} wants several optimisers, which training does not support.")
    for group in optimizer.param_groups:
        # One kernel for all elements instead of a dozen: on a CPU the update is several times faster.
        if "fused" in group and policy.config.device == "cpu":
            group["fused"] = True
    masters.follow(optimizer)
    if phase.learning_rate is not None:
        for group in optimizer.param_groups:
            group["lr"] *= phase.learning_rate / preset.lr
    schedule = policy.config.get_scheduler_preset()
    if phase.scheduler.get("type") == "none":
        schedule = None
    elif phase.scheduler:
        schedule = _changed(LRSchedulerConfig, schedule, phase.scheduler, "scheduler")
    if schedule is None and phase.warmup_steps:
        schedule = DiffuserSchedulerConfig(name="constant_with_warmup", num_warmup_steps=phase.warmup_steps)
    elif schedule is not None and phase.warmup_steps is not None:
        schedule = dataclasses.replace(schedule, num_warmup_steps=phase.warmup_steps)
    total = phase.schedule_steps or phase.steps
    if isinstance(schedule, CosineDecayWithWarmupSchedulerConfig) and _warmup_is_given(phase):
        # For a training shorter than its decay, LeRobot shortens the warm-up, too: not one that was asked for.
        schedule = dataclasses.replace(schedule, num_decay_steps=min(schedule.num_decay_steps, total))
    scheduler = schedule.build(optimizer, total) if schedule is not None else None
    clip = preset.grad_clip_norm if phase.grad_clip_norm is None else phase.grad_clip_norm
    return optimizer, scheduler, float(clip or 0.0)


def _changed(registry: Any, preset: Any, changes: Mapping[str, Any], what: str) -> Any:
    """The policy's own settings with changes, or another type's with the given fields."""
    kind = changes.get("type", preset.type if preset is not None else None)
    fields = {key: value for key, value in changes.items() if key != "type"}
    if kind not in registry.get_known_choices():
        raise UnknownNameError(f"type of {what}", str(kind), [*registry.get_known_choices(), "none"])
    chosen = registry.get_choice_class(kind)
    names = [f.name for f in dataclasses.fields(chosen)]
    for key in fields:
        if key not in names:
            raise UnknownNameError("key", key, names, f"(in `{what}`)")
    fields = {key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}
    if preset is not None and kind == preset.type:
        return dataclasses.replace(preset, **fields)
    try:
        return chosen(**fields)
    except TypeError as error:
        raise UserError(f"`{what}` of type {kind!r}: {error}.") from error


def _warmup_is_given(phase: PhaseConfig) -> bool:
    return phase.warmup_steps is not None or "num_warmup_steps" in phase.scheduler


def _trained_groups(policy: PreTrainedPolicy, phase: PhaseConfig, by_name: bool) -> Any:
    """The policy's parameter groups without frozen parameters; one group where low-rank changes are trained.

    For an optimiser that goes `by_name`, the parameters by their names.
    """
    trained = {name: p for name, p in policy.named_parameters() if p.requires_grad}
    if not trained:
        raise UserError(f"phase {phase.name!r}: `freeze` leaves nothing of the policy to train.")
    if by_name:
        return trained
    if phase.lora is not None:
        return [{"params": list(trained.values())}]
    params = policy.get_optim_params()
    params = list(params.values() if isinstance(params, dict) else params)
    groups = params if params and isinstance(params[0], dict) else [{"params": params}]
    kept = [{**group, "params": [p for p in group["params"] if p.requires_grad]} for group in groups]
    return [group for group in kept if group["params"]]


def hub_checkpoint(name: str) -> Path:
    """Folder of a policy on the hub, downloaded or from the local cache.

    Raises:
        UserError: there is none of that name, or it cannot be downloaded.
    """
    with _from_hub(name):
        return Path(snapshot_download(name))


def hub_config(name: str) -> Path:
    """Folder with the config.json of a policy on the hub, and perhaps nothing else: to check without its weights.

    Raises:
        UserError: there is none of that name, or it cannot be downloaded.
    """
    with _from_hub(name):
        return Path(hf_hub_download(name, "config.json")).parent


def cached_hub_config(name: str) -> Path | None:
    """As `hub_config`, if it was downloaded before; else None."""
    found = try_to_load_from_cache(name, "config.json")
    return Path(found).parent if isinstance(found, str) else None


@contextlib.contextmanager
def _from_hub(name: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # the hub's client raises many kinds
        raise UserError(
            f"cannot get the policy {name!r} from the hub: {error} Where there is no network, download it elsewhere "
            "with `hf download`, and give its folder as the start."
        ) from error


def with_imagenet_statistics(stats: Statistics, camera_keys: list[str]) -> Statistics:
    """Statistics in which the cameras have ImageNet's mean and standard deviation, as LeRobot's training does."""
    cameras = {key: {name: torch.tensor(v).numpy() for name, v in IMAGENET_STATS.items()} for key in camera_keys}
    return {**stats, **{key: {**stats.get(key, {}), **values} for key, values in cameras.items()}}


def read_config(checkpoint: Path) -> dict[str, Any]:
    """The config.json of a checkpoint.

    Raises:
        UserError: there is none, or it is of something else.
    """
    path = checkpoint / "config.json"
    if not path.is_file():
        raise UserError(
            f"no policy at {checkpoint} (no config.json); give the `pretrained_model` folder of a checkpoint."
        )
    data: dict[str, Any] = json.loads(path.read_text())
    if "type" not in data:
        raise UserError(f"{path} is not of a LeRobot policy: it has no `type`.")
    return data
