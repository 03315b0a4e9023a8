"""LeRobotDataset v3.0 back to one HDF5 file in the robomimic/RoboCasa layout, for tools that want it.

Values are the dataset's own, bit for bit, with actions in the order of HDF5 files; pictures are the decoded ones. The
file is written beside its place and renamed when complete.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import __version__, contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.lerobot_v3 import EXTRA_PREFIX, INDEX_COLUMNS, ExportedDataset, ExportedEpisode
from robocasa_lerobot.convert.mapping.robots import ABSOLUTE_ACTION_PARTS
from robocasa_lerobot.convert.reading.demo_file import ASSETS_GROUP, IMAGE_SUFFIX, DemoFile
from robocasa_lerobot.convert.reading.extras import read_scene, read_states
from robocasa_lerobot.convert.reading.hdf5 import RejectedEpisodeError
from robocasa_lerobot.convert.reading.layout import ABSOLUTE_ACTIONS, ACTIONS
from robocasa_lerobot.convert.reading.stages import STAGE_DATASET
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.hdf5_files import new_hdf5
from robocasa_lerobot.progress import Bar

COMPRESSIONS = ("gzip", "lzf", "none")
_GZIP_LEVEL = 1  # pictures hardly get smaller with more, only slower
_BLOCK_FRAMES = 32  # decoded frames held at a time
_EXPORTED_BY = "exported_by"  # attribute of `data`
_ROBOSUITE_ENV = 1  # robomimic's number for environments of robosuite
# Names of the state's components of arms with a fixed base, an arm's name before each where there are several, and
# what robosuite calls the observation that they are of.
_ARM_COMPONENT = re.compile(r"(.*?)(?:(?P<position>eef_[xyz])|(?P<rotation>eef_q[xyzw])|(?P<fingers>finger_\d+))")
# Columns that come back in another form: as language, as the environment's name, as stages and their texts.
_SAID_OTHERWISE = ("task_description", "task_name")
_WRITTEN = (*INDEX_COLUMNS, *contract.STAGE_KEYS, contract.STATE_KEY, contract.ACTION_KEY, "next.reward", "next.done")
_ARM_ENDINGS = {"position": "eef_pos", "rotation": "eef_quat", "fingers": "gripper_qpos"}


@dataclass(frozen=True)
class ExportSettings:
    """What to export; None takes all cameras, or the only task."""

    cameras: tuple[str, ...] | None = None
    images: bool = True
    task: str | None = None
    compression: str = "gzip"

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            raise UnknownNameError("compression", self.compression, COMPRESSIONS)
        if self.cameras == ():
            raise UserError(
                "--cameras names no camera: name some (A,B), leave it out for all, or give --no-images for none."
            )
        if self.cameras is not None and len(set(self.cameras)) != len(self.cameras):
            raise UserError(f"--cameras {', '.join(self.cameras)}: name each camera once.")


@dataclass(frozen=True)
class ExportResult:
    """What was written, and what the dataset did not have."""

    path: Path
    num_episodes: int
    num_frames: int
    notes: tuple[str, ...]


def export(root: Path, out: Path, settings: ExportSettings | None = None, overwrite: bool = False) -> ExportResult:
    """Write the episodes of a dataset to the HDF5 file `out`.

    Groups are `demo_0`, `demo_1`, ... in the order of the dataset. `states` and `model_file` are there where the
    dataset keeps them under `extras`, `rewards` where it has `next.reward`, `stage` where it has `stage_index`.

    Raises:
        UserError: no readable dataset, an unknown camera or task, episodes of several tasks, `out` exists, or writing
            fails. Nothing is at `out` then.
    """
    settings = settings or ExportSettings()
    if out.is_dir():
        raise UserError(f"--out {out} is a folder: name an HDF5 file, such as {out / f'{root.absolute().name}.hdf5'}.")
    if out.exists() and not overwrite:
        raise UserError(f"{out} exists already. Choose another --out, or replace it with --overwrite.")
    dataset = ExportedDataset(root)
    episodes = _chosen(dataset, settings.task)
    cameras = _cameras(dataset, settings)
    notes: list[str] = []
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        with new_hdf5(out) as file:
            num_frames = _write(file, dataset, episodes, cameras, settings, notes)
    except OSError as error:
        raise UserError(f"writing {out} failed: {error}. Nothing is there; free disk space and repeat.") from error
    return ExportResult(out, len(episodes), num_frames, tuple(notes))


def _chosen(dataset: ExportedDataset, task: str | None) -> list[ExportedEpisode]:
    names = dict.fromkeys(episode.task_name for episode in dataset.episodes)
    if task is not None and task not in names:
        raise UnknownNameError("task", task, names, f"({dataset.root})")
    if task is None and len(names) > 1:
        raise UserError(
            f"{dataset.root} has episodes of {len(names)} tasks ({', '.join(list(names)[:8])}), but an HDF5 file names "
            "one environment: choose with --task, a file for each."
        )
    return [episode for episode in dataset.episodes if task is None or episode.task_name == task]


def _cameras(dataset: ExportedDataset, settings: ExportSettings) -> tuple[str, ...]:
    if not settings.images:
        return ()
    for name in settings.cameras or ():
        if name not in dataset.cameras:
            raise UnknownNameError("camera", name, dataset.cameras, f"({dataset.root}; choose with --cameras)")
    return settings.cameras if settings.cameras is not None else tuple(dataset.cameras)


def _write(
    file: h5py.File,
    dataset: ExportedDataset,
    episodes: Sequence[ExportedEpisode],
    cameras: Sequence[str],
    settings: ExportSettings,
    notes: list[str],
) -> int:
    data = file.create_group("data")
    compression = _compression(settings.compression)
    lacking: dict[str, int] = {}
    num_frames = 0
    with Bar(total=sum(episode.length for episode in episodes), unit="frame", desc="exporting") as bar:
        for index, episode in enumerate(episodes):
            group = data.create_group(f"demo_{index}")
            try:
                lacks = _write_vectors(group, dataset, episode, compression)
            except RejectedEpisodeError as error:
                raise UserError(
                    f"{dataset.root}, episode {episode.index}: {error} Copy this file again, or take it away to export "
                    "the episode without what it holds."
                ) from None
            for what in lacks:
                lacking[what] = lacking.get(what, 0) + 1
            for camera in cameras:
                _write_pictures(group, dataset, episode, camera, compression)
            num_frames += episode.length
            bar.update(episode.length)
    notes += [f"{what} of {count} episodes are not in the dataset: left out" for what, count in lacking.items()]
    if nowhere := _without_a_place(dataset):
        notes.append(f"columns {', '.join(nowhere)} have no place in HDF5 files of this kind: left out")
    if dataset.placed_cameras:
        placed = ", ".join(dataset.placed_cameras)
        notes.append(
            f"cameras {placed} were placed when the pictures were rendered again: model_file and cam_configs are those "
            "of the recording, without that"
        )
    data.attrs.update(_attributes(dataset, episodes))
    data.attrs["total"] = num_frames
    _copy_assets(file, dataset, episodes, notes)
    return num_frames


def _write_vectors(
    group: h5py.Group, dataset: ExportedDataset, episode: ExportedEpisode, compression: dict[str, Any]
) -> list[str]:
    """Everything but pictures; gives what the dataset lacks."""
    columns = dataset.columns(episode)
    actions = columns.pop(contract.ACTION_KEY)
    absolute = dataset.features[contract.ACTION_KEY].get("names") == contract.component_names(ABSOLUTE_ACTION_PARTS)
    if absolute or _has_parts(dataset, contract.ACTION_KEY, contract.ACTION_PARTS):
        actions = contract.stored_to_hdf5(actions)
    group.create_dataset(ABSOLUTE_ACTIONS if absolute else ACTIONS, data=actions, **compression)
    observations: dict[str, NDArray[Any]] = {}
    if contract.STATE_KEY in columns:
        observations |= _observations(dataset, columns.pop(contract.STATE_KEY))
    for key, values in observations.items():
        group.create_dataset(f"obs/{key}", data=values, **compression)
    # Copies of what the file had, which may be what is written anyway.
    further = {
        k.removeprefix(EXTRA_PREFIX).replace(".", "/"): v for k, v in columns.items() if k.startswith(EXTRA_PREFIX)
    }
    if contract.STAGE_KEY in columns:
        further.setdefault(STAGE_DATASET, columns[contract.STAGE_KEY].astype(np.int32))
    if "next.reward" in columns:
        further.setdefault("rewards", columns["next.reward"].reshape(-1).astype(np.float64))
    dones = np.zeros(episode.length, np.int64)
    dones[-1] = 1  # robomimic's done mode 1: the last step of a demonstration
    dones = columns["next.done"].reshape(-1).astype(np.int64) if "next.done" in columns else dones
    further.setdefault("dones", dones)
    lacking = []
    folder = dataset.extras(episode)
    states = folder / "states.npz"
    if states.is_file():
        group.create_dataset("states", data=read_states(states, episode.length), **compression)
    else:
        lacking.append("simulator states")
    for key, values in further.items():
        if key not in group:
            group.create_dataset(key, data=values, **compression)
    model = folder / "model.xml.gz"
    if model.is_file():
        group.attrs["model_file"] = read_scene(model)
    else:
        lacking.append("scenes (model_file)")
    meta_file = folder / "ep_meta.json"
    meta = json.loads(meta_file.read_text(encoding="utf-8")) if meta_file.is_file() else {}
    # What training has as its language; it is recorded here even where it came from elsewhere.
    group.attrs["ep_meta"] = json.dumps(meta | {"lang": dataset.instruction(episode)})
    if isinstance(meta.get("seed"), int):
        group.attrs["seed"] = meta["seed"]
    group.attrs["num_samples"] = episode.length
    return lacking


def _without_a_place(dataset: ExportedDataset) -> list[str]:
    """Features of a dataset that are in no way in the file that is made of it."""
    pictures = dataset.cameras.values()
    return [
        key
        for key in dataset.features
        if key not in _WRITTEN
        and key not in pictures
        and not key.startswith(EXTRA_PREFIX)
        and not (key.startswith("annotation.") and key.endswith(_SAID_OTHERWISE))
    ]


def _has_parts(dataset: ExportedDataset, key: str, parts: Sequence[Part]) -> bool:
    """Whether a vector is the contract's, by its names; where it has none, as others' datasets, by robot and size."""
    feature, names = dataset.features[key], contract.component_names(parts)
    if feature.get("names") is None:
        return dataset.robot_type == contract.ROBOT_TYPE and list(feature["shape"]) == [len(names)]
    return bool(feature["names"] == names)


def _observations(dataset: ExportedDataset, states: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The state's parts under robosuite's names where they are known, else the whole under `state`."""
    if _has_parts(dataset, contract.STATE_KEY, contract.STATE_PARTS):
        return {contract.STATE_PART_HDF5_KEYS[name]: states[:, where] for name, where in contract.STATE_SLICES.items()}
    observations: dict[str, NDArray[Any]] = {}
    for key, where in _arm_observations(dataset.features[contract.STATE_KEY].get("names") or []).items():
        observations[key] = states[:, where]
    return observations or {"state": states}


def _arm_observations(names: Sequence[str]) -> dict[str, slice]:
    """Observation -> components of the state, where all of these have the names that `convert` gives to arms."""
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        match = _ARM_COMPONENT.fullmatch(str(name))
        if match is None:
            return {}
        arm = match[1] if match[1].startswith("robot") else f"robot0_{match[1]}"
        ending = next(ending for group, ending in _ARM_ENDINGS.items() if match[group])
        found.setdefault(arm + ending, []).append(index)
    if any(places != list(range(places[0], places[-1] + 1)) for places in found.values()):
        return {}
    return {key: slice(places[0], places[-1] + 1) for key, places in found.items()}


def _write_pictures(
    group: h5py.Group, dataset: ExportedDataset, episode: ExportedEpisode, camera: str, compression: dict[str, Any]
) -> None:
    target: h5py.Dataset | None = None
    start = 0
    for block in _blocks(dataset.pictures(episode, camera)):
        if target is None:
            shape = block.shape[1:]
            target = group.create_dataset(
                f"obs/{camera}{IMAGE_SUFFIX}",
                shape=(episode.length, *shape),
                dtype=np.uint8,
                chunks=(1, *shape),
                **compression,
            )
        target[start : start + len(block)] = block
        start += len(block)


def _blocks(pictures: Iterator[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
    block: list[NDArray[np.uint8]] = []
    for picture in pictures:
        block.append(picture)
        if len(block) == _BLOCK_FRAMES:
            yield np.stack(block)
            block = []
    if block:
        yield np.stack(block)


def _attributes(dataset: ExportedDataset, episodes: Sequence[ExportedEpisode]) -> dict[str, Any]:
    """Attributes of the first episode's source file, and always an `env_args` with the rate and the robot."""
    recorded = dict(dataset.source_attributes(episodes[0]))
    env_args = _json_object(recorded.get("env_args"))
    info = _json_object(recorded.get("env_info"))
    kwargs = env_args.get("env_kwargs") if isinstance(env_args.get("env_kwargs"), dict) else {}
    assert isinstance(kwargs, dict)
    defaults = {"control_freq": dataset.fps, "robots": [dataset.robot_type]}
    name = env_args.get("env_name") or recorded.get("env") or episodes[0].task_name
    recorded["env_args"] = json.dumps(
        {"env_name": name, "type": _ROBOSUITE_ENV} | env_args | {"env_kwargs": defaults | info | kwargs}
    )
    recorded.setdefault("env", name)
    recorded[_EXPORTED_BY] = f"robocasa_lerobot {__version__}"
    return {key: value for key, value in recorded.items() if isinstance(value, str | int | float | bool)}


def _copy_assets(
    file: h5py.File, dataset: ExportedDataset, episodes: Sequence[ExportedEpisode], notes: list[str]
) -> None:
    """Files that the scenes name and that the source files held: the dataset keeps them; of an older one, they do."""
    folders = dataset.assets(episodes)
    for name, content in _kept(folders) if folders else _stored(dataset, episodes, notes):
        place = f"{ASSETS_GROUP}/{name}"
        if place not in file:
            file.create_dataset(place, data=np.frombuffer(content, np.uint8))
        elif file[place][()].tobytes() != content:
            notes.append(f"sources differ in {name}: the first one's is taken; export the files' episodes apart")


def _kept(folders: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                yield path.relative_to(folder).as_posix(), path.read_bytes()


def _stored(
    dataset: ExportedDataset, episodes: Sequence[ExportedEpisode], notes: list[str]
) -> Iterator[tuple[str, bytes]]:
    for path in dataset.source_files(episodes):
        try:
            with DemoFile(path) as source:
                yield from source.assets()
        except (OSError, UserError) as error:
            notes.append(f"textures stored in {path} could not be taken over ({error})")


def _compression(name: str) -> dict[str, Any]:
    if name == "none":
        return {}
    level: dict[str, Any] = {"compression_opts": _GZIP_LEVEL} if name == "gzip" else {}
    return {"compression": name} | level


def _json_object(value: Any) -> dict[str, Any]:
    if isinstance(value, str):
        try:
            value = json.loads(value)
        except json.JSONDecodeError:
            return {}
    return value if isinstance(value, dict) else {}
