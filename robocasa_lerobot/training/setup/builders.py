"""From configuration to objects: LeRobot policy configs, policies and processors."""

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
from lerobot.configs.types import FeatureType, NormalizationMode
from lerobot.datasets.factory import resolve_delta_timestamps
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
from robocasa_lerobot.policies.weight_files import adapter_alone
from robocasa_lerobot.training.setup.features import LEAVE_OUT, RENAME, fit_features, new_names, renamed_inputs
from robocasa_lerobot.training.setup.features import check_features as _check_features
from robocasa_lerobot.training.setup.kept import rename_kept

_NO_FIELDS = ("type", "path", RENAME, LEAVE_OUT)  # settings of a policy that are no fields of its configuration
_LOAD_TOKENIZERS = ("pi0", "pi05", "smolvla", "xvla")  # by name, in their processors
_NOT_LOADED = "Could not load state dict"
MAPPING = "normalization_mapping"


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
    if MAPPING in fields:  # LeRobot takes what a mapping does not name for left as it is
        fields[MAPPING] = {**(base.get(MAPPING) or _own_mapping(str(kind))), **_mapping(fields[MAPPING])}
    data = {"push_to_hub": False, **base, **fields, "device": device, "pretrained_path": None, "type": kind}
    try:
        config: PreTrainedConfig = draccus.decode(PreTrainedConfig, data)
    except Exception as error:  # draccus raises several kinds; each says which field and why
        cause = error.__cause__ if isinstance(error.__cause__, UserError) else error
        raise UserError(f"settings of the policy {kind!r}: {cause}") from error
    return config


def _mapping(given: Any) -> dict[str, Any]:
    """How kinds of features are asked to be normalised, with kinds and ways that LeRobot has.

    Raises:
        UserError: other ones.
    """
    kinds, ways = [kind.value for kind in FeatureType], [way.value for way in NormalizationMode]
    if not isinstance(given or {}, Mapping):
        raise UserError(f"{MAPPING} is {given!r}, expected a mapping, such as {{ACTION: {ways[0]}}}.")
    for kind, way in (given or {}).items():
        if kind not in kinds:
            raise UnknownNameError("kind of feature", str(kind), kinds, f"(in `{MAPPING}`)")
        if way not in ways:
            raise UnknownNameError(
                "way to normalise", str(getattr(way, "value", way)), ways, f"({kind} in `{MAPPING}`)"
            )
    return dict(given or {})


def laid_over(own: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a policy with others laid over them; of a mapping of normalisation, those that are named."""
    both = {**own, **changes}
    if isinstance(own.get(MAPPING), Mapping) and isinstance(changes.get(MAPPING), Mapping):
        both[MAPPING] = {**own[MAPPING], **changes[MAPPING]}
    return both


def _own_mapping(kind: str) -> dict[str, Any]:
    """How a type of policies normalises where nothing is said."""
    for entry in dataclasses.fields(PreTrainedConfig.get_choice_class(kind)):
        if entry.name == MAPPING and callable(entry.default_factory):
            return {name: getattr(mode, "value", mode) for name, mode in entry.default_factory().items()}
    return {}


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
    if reason := adapter_alone(checkpoint):
        raise UserError(f"{checkpoint}: {reason}")
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


def policy_without_weights(config: PreTrainedConfig, meta: MixtureMeta) -> PreTrainedPolicy:
    """A policy whose weights take no memory, to look at its parts; policies of LeRobot's raise all kinds of errors."""
    config = copy.deepcopy(config)
    config.device = "meta"
    with torch.device("meta"):
        return make_phase_policy(config, meta, None)


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
