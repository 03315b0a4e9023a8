"""What a policy says about itself: a checkpoint, read without importing LeRobot, or a reference."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UnknownNameError, UserError, closest
from robocasa_lerobot.evaluation.records.results import REFERENCE_POLICIES, REFERENCE_TYPES, REPLAY, PolicyInfo
from robocasa_lerobot.evaluation.remote.address import is_address, parse_address
from robocasa_lerobot.evaluation.remote.introduction import RemotePolicy
from robocasa_lerobot.policies.origin import ORIGIN_FILE, Origin, read_origin
from robocasa_lerobot.policies.weight_files import WEIGHTS, adapter_alone

# They say where a checkpoint comes from, and change nothing of what the policy does.
_ABOUT_TRAINING = ("train_config.json", ORIGIN_FILE)
_PREPROCESSOR, _RENAMES = "policy_preprocessor.json", "rename_observations_processor"  # LeRobot's names
_PICTURE_PREFIX = "observation.image"


class CheckpointError(UserError):
    """A folder that is not a LeRobot `pretrained_model`."""


@dataclass(frozen=True)
class PolicySource:
    """A policy to evaluate: a checkpoint folder, a policy behind a socket, or a reference policy.

    `fingerprint` is a SHA-256 over weights, config and processors; `experiment`, `phase` and `step` are what the
    checkpoint says about its training. `image_size` is (height, width) of its camera inputs. `queues`: by its settings
    it remembers earlier steps. `remote` is a policy behind a socket, whose weights nobody can see.
    """

    label: str
    path: str
    type: str
    fingerprint: str
    phase: str | None = None
    step: int | None = None
    image_size: tuple[int, int] | None = None
    experiment: str | None = None
    queues: bool = False
    remote: RemotePolicy | None = None

    @property
    def is_reference(self) -> bool:
        """Whether this is `demonstrator`, `random`, `zero` or `replay`, and not a checkpoint."""
        return self.type in REFERENCE_TYPES

    @property
    def is_checkpoint(self) -> bool:
        """Whether this needs torch and LeRobot here."""
        return not self.is_reference and self.remote is None

    @property
    def repeats(self) -> bool:
        """Whether the same trial takes the same course again."""
        return self.remote is None or self.remote.key_map.repeats

    def describe(self) -> PolicyInfo:
        """What the header of a run says about it."""
        return PolicyInfo(
            self.label,
            self.path,
            self.type,
            self.fingerprint,
            self.phase,
            self.step,
            experiment=self.experiment,
            remote=None if self.remote is None else self.remote.describe(),
        )


def _as_given(path: Path, folder: Path) -> Path:
    """A resolved folder from the working folder on, where it was given so: results then hold no machine's paths."""
    here = Path.cwd().resolve()
    return folder.relative_to(here) if not path.is_absolute() and folder.is_relative_to(here) else folder


def read_source(path: str, label: str | None = None, own_pictures: bool = False) -> PolicySource:
    """The policy at `path`, which is no address; `own_pictures` are another simulator's, whose names are not ours.

    Raises:
        CheckpointError: not a `pretrained_model` folder; the message says where one was expected.
    """
    if path in REFERENCE_POLICIES:
        return PolicySource(label or path, path, path, fingerprint=path)
    kind, colon, file = path.partition(":")
    if kind == REPLAY and colon:
        return PolicySource(label or REPLAY, path, REPLAY, fingerprint=stored_fingerprint(Path(file)))
    # `checkpoints/last` is another folder after the next save: what is loaded later is what is described here.
    check_name(path)
    folder = find_pretrained(Path(path)).resolve()
    try:
        config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
        kind = config["type"]
    except (OSError, json.JSONDecodeError, KeyError, TypeError) as error:
        raise CheckpointError(f"{folder / 'config.json'}: not the config of a LeRobot policy ({error!r}).") from error
    origin = read_origin(folder)
    return PolicySource(
        label or default_label(origin, folder),
        str(_as_given(Path(path), folder)),
        kind,
        fingerprint(folder),
        origin.phase,
        origin.step,
        camera_size(config, folder, own_pictures),
        origin.experiment,
        has_queues(config),
    )


def check_name(path: str) -> None:
    """Check what can be told of `path` before anything is there: a checkpoint may be made in the meantime.

    Raises:
        UnknownNameError: a misspelt reference policy, or an address of a protocol that is not spoken.
        UserError: an address without a host, or with a port that is none.
    """
    if is_address(path):
        parse_address(path)
        return
    kind, colon, _ = path.partition(":")
    known = (REPLAY,) if colon else REFERENCE_POLICIES
    # More alike than names that are suggested: a folder to come may be called anything.
    if kind not in known and closest(kind, known, cutoff=0.6) and "/" not in path and not Path(path).exists():
        raise UnknownNameError("policy", path, [f"{name}:FILE" if colon else name for name in known])


def what_lacks(path: str) -> str | None:
    """Why no run of the policy at `path`, which is no address, would begin yet; None where all of it is there."""
    kind, colon, file = path.partition(":")
    if path in REFERENCE_POLICIES:
        return None
    if kind == REPLAY and colon:
        return None if Path(file).exists() else _nothing_to_replay(Path(file))
    try:
        find_pretrained(Path(path))
    except CheckpointError as error:
        return str(error)
    return None


def label_of(path: str) -> str | None:
    """What the policy at `path`, no address, is called unless the user says; None where it is not there yet."""
    if path in REFERENCE_POLICIES:
        return path
    if path.startswith(f"{REPLAY}:"):
        return REPLAY
    try:
        folder = find_pretrained(Path(path)).resolve()
    except CheckpointError:
        return None
    return default_label(read_origin(folder), folder)


def default_label(origin: Origin, folder: Path) -> str:
    """`<experiment>/<phase>-<step>`, as far as it is known: phases of different experiments have the same names."""
    if origin.phase is None:
        return folder.name
    own = origin.phase if origin.step is None else f"{origin.phase}-{origin.step:06d}"
    return own if origin.experiment is None else f"{origin.experiment}/{own}"


def find_pretrained(path: Path) -> Path:
    """The `pretrained_model` folder at `path`, at a checkpoint, or under the last checkpoint of a phase."""
    for candidate in (path, path / "pretrained_model", path / "checkpoints" / "last" / "pretrained_model"):
        if (candidate / "config.json").is_file():
            if not (candidate / WEIGHTS).is_file():
                reason = adapter_alone(candidate) or "the checkpoint is incomplete."
                raise CheckpointError(f"{candidate}: config.json without {WEIGHTS}: {reason}")
            return candidate
    what = "has no config.json" if path.is_dir() else "is a file" if path.is_file() else "no such folder"
    found = sorted(str(p.parent) for p in path.glob("**/pretrained_model/config.json"))[:3] if path.is_dir() else []
    hint = f" Did you mean {' or '.join(found)}?" if found else ""
    known = ", ".join((*REFERENCE_POLICIES, "replay:FILE", "openpi://HOST:PORT", "gr00t://...", "vla_eval://..."))
    raise CheckpointError(f"policy.path {path}: {what}; expected a pretrained_model folder, or one of {known}.{hint}")


def fingerprint(folder: Path) -> str:
    """SHA-256 over the files of a checkpoint that decide what the policy does, by name and content."""
    digest = hashlib.sha256()
    files = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.name not in _ABOUT_TRAINING]
    for file in files:
        if file.suffix not in (".json", ".safetensors", ".txt", ".model"):
            continue
        with file.open("rb") as stream:
            content = hashlib.file_digest(stream, "sha256").hexdigest()
        digest.update(f"{file.relative_to(folder).as_posix()} {content}\n".encode())
    return digest.hexdigest()


def stored_fingerprint(path: Path) -> str:
    """SHA-256 over a file of demonstrations, or over the parts of a dataset that decide what `replay` does.

    Raises:
        CheckpointError: no such file or folder.
    """
    files = [path] if path.is_file() else sorted([*path.glob("meta/**/*.json*"), *path.glob("data/**/*.parquet")])
    if not files:
        raise CheckpointError(_nothing_to_replay(path))
    digest = hashlib.sha256()
    for file in files:
        with file.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


def _nothing_to_replay(path: Path) -> str:
    what = "has no episodes" if path.exists() else "no such file or folder"
    return f"policy.path {REPLAY}:{path}: {what}; expected an HDF5 file of demonstrations or a LeRobotDataset."


def has_queues(config: Mapping[str, Any]) -> bool:
    """Whether a policy with this config.json keeps observations or actions of earlier steps, whatever its type does."""
    return config.get("n_obs_steps", 1) != 1 or config.get("temporal_ensemble_coeff") is not None


def camera_size(config: dict[str, Any], folder: Path, any_picture: bool = False) -> tuple[int, int] | None:
    """(height, width) of those camera inputs of a policy that the env fills; None for a policy without cameras.

    Inputs have the env's names, or the saved preprocessor gives the env's cameras the policy's names. With
    `any_picture` all inputs count.

    Raises:
        CheckpointError: the policy has cameras, and none of them is the env's; or they have several sizes.
    """
    inputs = _pictures(config)
    filled = inputs if any_picture else filled_cameras(config, folder).values()
    sizes = {tuple(map(int, inputs[name]["shape"][-2:])) for name in filled}
    if inputs and not sizes:
        raise CheckpointError(
            f"{folder}: the policy takes the pictures {', '.join(inputs)}, and the env has "
            f"{', '.join(contract.IMAGE_KEYS)}: its saved preprocessor renames none of these to those. Train it with "
            "`rename` in the policy's settings, or add a `rename_observations_processor` to its preprocessor."
        )
    if len(sizes) > 1:
        raise CheckpointError(f"{folder}: cameras of several sizes {sorted(sizes)}; one size is expected.")
    height, width = sizes.pop() if sizes else (None, None)
    return None if height is None or width is None else (height, width)


def filled_cameras(config: Mapping[str, Any], folder: Path) -> dict[str, str]:
    """The env's cameras that a policy looks at, each with the name of the input that it fills."""
    inputs, renamed = _pictures(config), _renamed(folder)
    names = {camera: renamed.get(key, key) for camera, key in zip(contract.CAMERAS, contract.IMAGE_KEYS, strict=True)}
    return {camera: name for camera, name in names.items() if name in inputs}


def env_names(folder: Path) -> dict[str, str]:
    """The env's names of a policy's inputs, of those that its saved preprocessor renames."""
    return {new: old for old, new in _renamed(folder).items()}


def _pictures(config: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The camera inputs of a policy by name."""
    return {
        name: feature
        for name, feature in (config.get("input_features") or {}).items()
        if feature.get("type", "VISUAL") == "VISUAL" and name.startswith(_PICTURE_PREFIX)
    }


def _renamed(folder: Path) -> dict[str, str]:
    """The names that a checkpoint's saved preprocessor gives to observations, by the env's."""
    try:
        saved = json.loads((folder / _PREPROCESSOR).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    out: dict[str, str] = {}
    for step in saved.get("steps", []):
        if step.get("registry_name") == _RENAMES:
            out |= step.get("config", {}).get("rename_map") or {}
    return out


def common_image_size(sources: list[PolicySource], asked: int | None) -> int:
    """Pixels of the env's square pictures: what was asked for, else what all the checkpoints were trained at.

    Raises:
        UserError: checkpoints of different sizes in one evaluation, or pictures that are not square.
    """
    if asked is not None:
        return asked
    sizes = {source.image_size: source.label for source in sources if source.image_size is not None}
    if len(sizes) > 1:
        listed = ", ".join(f"{label} {h}x{w}" for (h, w), label in sizes.items())
        raise UserError(f"policies trained at different picture sizes ({listed}): evaluate them in separate runs.")
    if not sizes:
        return contract.IMAGE_SIZE
    height, width = next(iter(sizes))
    if height != width:
        raise UserError(f"the policy was trained at {height}x{width} pictures; the env renders square ones.")
    return height
