"""The plan of a conversion from LeRobot v2 datasets: columns with the contract's names, cameras, tasks, shards."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from robocasa_lerobot import contract
from robocasa_lerobot.convert.lerobot_v2.dataset import (
    INDEX_COLUMNS,
    EpisodeLine,
    V2Dataset,
    camera_of,
)
from robocasa_lerobot.convert.lerobot_v2.episode import Column, V2Episode, given_instruction
from robocasa_lerobot.convert.lerobot_v2.vectors import flat_names, named_vector
from robocasa_lerobot.convert.mapping.robot_mapping import RobotMapping
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError, SourceError
from robocasa_lerobot.convert.reading.inputs import is_dataset
from robocasa_lerobot.convert.reading.selection import select
from robocasa_lerobot.convert.settings import (
    MAX_SHARDS,
    Camera,
    ConversionSettings,
    Plan,
    Shard,
    SourceRecord,
    check_request,
)
from robocasa_lerobot.convert.writing.video import probe
from robocasa_lerobot.errors import UnknownNameError, UserError

SOURCE_FORMAT = "lerobot_v2"
_FORMAT_VERSION = 2  # as that of `convert.settings`, for these sources alone
# Copying is so fast that a shard can be longer than one of HDF5; each shard has video files of its own.
SHARD_FRAMES = 2000
_DTYPES = {pa.float32(): "float32", pa.float64(): "float64", pa.bool_(): "bool", pa.string(): "string"} | {
    getattr(pa, name)(): name for name in ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32")
}


@dataclass(frozen=True)
class V2Plan(Plan):
    """A plan whose sources are dataset folders.

    Attributes: `columns` that are taken over, `camera_keys` with the source's feature of each camera, `tasks` united
    over all sources, and `stamp`, which changes when any source file is touched.
    """

    columns: tuple[Column, ...]
    camera_keys: tuple[tuple[str, str], ...]
    tasks: tuple[str, ...]
    stamp: str

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """LeRobotDataset features."""
        pictures = {
            contract.image_key(c.name): {
                "dtype": "video", "shape": (c.height, c.width, 3), "names": ["height", "width", "channel"],
            }
            for c in self.cameras
        }  # fmt: skip
        return pictures | {column.name: column.feature() for column in self.columns}

    @property
    def fingerprint(self) -> str:
        """The same for the same settings and the same untouched source files."""
        return hashlib.sha256(f"{super().fingerprint}{_FORMAT_VERSION}{self.stamp}".encode()).hexdigest()[:12]


def takes(files: Sequence[Path]) -> bool:
    """Whether these are dataset folders and not HDF5 files.

    Raises:
        UserError: some are and some are not.
    """
    folders = [file for file in files if is_dataset(file)]
    if folders and len(folders) != len(files):
        other = next(file for file in files if file not in folders)
        raise UserError(
            f"{folders[0]} is a LeRobot dataset and {other} is not: convert them into datasets of their own."
        )
    return bool(folders)


def make_v2_plan(folders: Sequence[Path], settings: ConversionSettings) -> V2Plan:
    """Look into every dataset and decide columns, cameras, tasks and shards.

    Raises:
        UserError: a dataset is damaged or has no usable episode, datasets do not fit together, or a camera is unknown
            or declared without files. Nothing has been written then.
    """
    _check_settings(settings)
    check_request(folders, settings)
    looks = [look_into(V2Dataset(folder), settings) for folder in folders]
    first = looks[0]
    for look in looks[1:]:
        for what, ours, theirs in (
            ("robot", first.mapping.robot_type, look.mapping.robot_type),
            ("rate in Hz", first.dataset.fps, look.dataset.fps),
            ("columns", first.target_columns, look.target_columns),
            ("cameras", first.cameras, look.cameras),
        ):
            if ours != theirs:
                raise UserError(
                    f"{look.dataset.root} and {first.dataset.root} do not fit into one dataset: {what} {theirs} "
                    f"against {ours}. Convert them into datasets of their own."
                )
        if look.columns != first.columns or look.camera_keys != first.camera_keys:
            raise UserError(
                f"{look.dataset.root} and {first.dataset.root} order or name the same columns differently. Convert "
                "them into datasets of their own and join those with LeRobot."
            )
    num_frames = sum(max(0, line.length) for look in looks for line in look.episodes)
    target = max(SHARD_FRAMES, -(-num_frames // MAX_SHARDS))
    return V2Plan(
        settings=settings,
        sources=tuple(
            replace(source_record(look.dataset), demos=tuple(line.name for line in look.episodes))
            if len(look.episodes) < len(look.dataset.episodes)
            else source_record(look.dataset)
            for look in looks
        ),
        mapping=first.mapping,
        cameras=first.cameras,
        fps=first.dataset.fps,
        shards=tuple(shard for look in looks for shard in _cut(look, target)),
        num_frames=num_frames,
        columns=first.columns,
        camera_keys=first.camera_keys,
        tasks=_tasks([look.dataset for look in looks], settings),
        notes=tuple(note for look in looks for note in look.notes),
        stamp=_stamp([look.dataset.root for look in looks]),
    )


def source_record(dataset: V2Dataset) -> SourceRecord:
    """A dataset as a source: the SHA-256 is over its `meta` files and the names and sizes of all its files."""
    total, size = hashlib.sha256(), 0
    for relative, path in _files(dataset.root):
        size += path.stat().st_size
        total.update(f"{relative}:{path.stat().st_size}\n".encode())
        if relative.startswith("meta/"):
            total.update(path.read_bytes())
    return SourceRecord(str(dataset.root), total.hexdigest(), size)


@dataclass(frozen=True)
class Look:
    """What was decided about one dataset."""

    dataset: V2Dataset
    mapping: RobotMapping
    columns: tuple[Column, ...]
    cameras: tuple[Camera, ...]
    camera_keys: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    episodes: tuple[EpisodeLine, ...]  # those that were selected

    @property
    def target_columns(self) -> list[tuple[str, str, tuple[str, ...]]]:
        """What has to be equal in datasets that are joined."""
        return [(column.name, column.dtype, column.names) for column in self.columns]


def look_into(dataset: V2Dataset, settings: ConversionSettings) -> Look:
    """Decide columns and cameras of a dataset, and find its first usable episode.

    Raises:
        UserError: the dataset has none, is damaged, or has not the cameras that were asked for.
    """
    notes: list[str] = []
    if not dataset.tasks and settings.instruction is None:
        raise SourceError(f"{dataset.root}: meta/tasks.jsonl is empty. Give the instruction with --instruction.")
    columns, mapping = _columns(dataset, notes)
    cameras, keys = _cameras(dataset, settings, notes)
    reasons = []
    tasks = _tasks([dataset], settings)
    chosen = frozenset(select(dataset, settings.filter_key, settings.demos, settings.demos_seed))
    episodes = tuple(line for line in dataset.episodes if line.name in chosen)
    for line in episodes:
        try:
            episode = V2Episode(dataset, line, columns, tasks, settings)
            for _, key in keys:
                episode.video(key)
        except RejectedEpisodeError as error:
            reasons.append(f"{line.name}: {error}")
            continue
        if episode.time_offset:
            notes.append(f"recorded times start at {episode.time_offset:.4f} s; they are counted from 0 anew")
        return Look(dataset, mapping, columns, cameras, keys, tuple(notes), episodes)
    raise SourceError(f"{dataset.root} has no usable episode; {reasons[0]} Download it again.")


def _check_settings(settings: ConversionSettings) -> None:
    for option, given in (
        ("--mapping", settings.mapping is not None),
        ("--action-key", settings.action_key != ConversionSettings.action_key),
        ("--extra-columns", bool(settings.extra_columns)),
    ):
        if given:
            raise UserError(f"{option} is for HDF5 files; of a LeRobot dataset, all columns are taken as they are.")


def _tasks(datasets: Sequence[V2Dataset], settings: ConversionSettings) -> tuple[str, ...]:
    given = given_instruction(settings)
    texts = [text for dataset in datasets for text in dataset.tasks.values()]
    return tuple(dict.fromkeys([*texts, *([given] if given is not None else [])]))


def _columns(dataset: V2Dataset, notes: list[str]) -> tuple[tuple[Column, ...], RobotMapping]:
    schema = _sample_schema(dataset)
    columns = []
    for name, feature in dataset.features.items():
        if contract.is_picture(feature) or name in INDEX_COLUMNS:
            continue
        if name not in schema.names:
            notes.append(f"column {name} is declared but not in the tables: left out")
            continue
        kind = schema.field(name).type
        dtype = _DTYPES.get(kind.value_type if pa.types.is_nested(kind) and hasattr(kind, "value_type") else kind)
        if dtype is None or len(feature["shape"]) != 1 or "/" in name or feature["shape"][0] < 1:
            notes.append(f"column {name} is {kind} of shape {feature['shape']}, which is not converted: left out")
            continue
        if dtype != feature["dtype"]:
            notes.append(f"column {name} is declared {feature['dtype']} but stored as {dtype}: kept as stored")
        size = feature["shape"][0]
        columns.append(Column(name, dtype, size, tuple(flat_names(feature.get("names"), size) or ())))
    undeclared = sorted(set(schema.names) - set(dataset.features) - set(INDEX_COLUMNS))
    if undeclared:
        notes.append(f"columns {', '.join(undeclared)} are in the tables but not declared: left out")
    by_name = {column.name: column for column in columns}
    for key in (contract.STATE_KEY, contract.ACTION_KEY):
        if key not in by_name:
            raise SourceError(f"{dataset.root} has no column {key!r} (it has {', '.join(by_name) or 'none'}).")
    state, state_parts = named_vector(dataset, by_name[contract.STATE_KEY], "state", contract.STATE_PARTS)
    action, action_parts = named_vector(dataset, by_name[contract.ACTION_KEY], "action", contract.ACTION_PARTS)
    by_name |= {state.name: state, action.name: action}
    for column in (state, action):
        if column.order is not None:
            notes.append(f"components of {column.name} are put into the contract's order")
    mapping = RobotMapping(
        robot_type=dataset.robot_type,
        state_parts=state_parts,
        action_parts=action_parts,
        state_columns=(),
        action_columns=(),
        default_cameras=(),
        unit_commands=action_parts == contract.ACTION_PARTS,
    )
    return tuple(by_name.values()), mapping


def _cameras(
    dataset: V2Dataset, settings: ConversionSettings, notes: list[str]
) -> tuple[tuple[Camera, ...], tuple[tuple[str, str], ...]]:
    keys = {camera_of(key): key for key in dataset.pictures}
    samples: dict[str, Path] = {}
    for camera, key in keys.items():
        feature = dataset.pictures[key]
        if feature["dtype"] == "image" or contract.is_depth(feature) or "/" in key:
            what = "depth" if contract.is_depth(feature) else "a path" if "/" in key else "pictures inside the tables"
            lack = f"camera {camera} is declared as {what}, which is not converted"
        else:
            paths = (dataset.video_file(line.index, key) for line in dataset.episodes)
            sample = next((path for path in paths if path.is_file()), None)
            if sample is not None:
                samples[camera] = sample
                continue
            lack = f"camera {camera} is declared but has no video files"
        if settings.cameras is not None and camera in settings.cameras:
            raise SourceError(f"{dataset.root}: {lack}. Leave it out of --cameras.")
        notes.append(f"{lack}: left out")
    chosen = settings.cameras if settings.cameras is not None else tuple(samples)
    cameras = []
    for name in chosen:
        if name not in samples:
            raise UnknownNameError("camera", name, samples, f"({dataset.root}; choose with --cameras)")
        size = settings.image_size
        height, width = (size, size) if size is not None else _size(dataset, keys[name], samples[name])
        if height % 2 or width % 2:
            raise SourceError(f"{dataset.root}: {name} is {height}x{width}; video needs even sizes: give --image-size.")
        cameras.append(Camera(name, height, width))
    if not cameras:
        raise SourceError(f"{dataset.root} has no camera with videos: {'; '.join(notes) or 'none is declared'}.")
    return tuple(cameras), tuple((name, keys[name]) for name in chosen)


def _size(dataset: V2Dataset, key: str, sample: Path) -> tuple[int, int]:
    """The declared size where it can be that of the video, else the size of the first readable video."""
    for path in (sample, *(dataset.video_file(line.index, key) for line in dataset.episodes)):
        try:
            form = probe(path)
        except (RejectedEpisodeError, OSError):
            continue
        return form.height, form.width
    raise SourceError(f"{dataset.root}: no video of {key} can be read. Download the dataset again.")


def _sample_schema(dataset: V2Dataset) -> pa.Schema:
    reason = ""
    for line in dataset.episodes:
        path = dataset.data_file(line.index)
        try:
            return pq.read_schema(path)
        except (pa.ArrowException, OSError, ValueError) as error:
            reason = reason or f"{path}: {str(error).splitlines()[0]}"
    raise SourceError(f"{dataset.root} has no readable table ({reason}). Download it again.")


def _cut(look: Look, target: int) -> Iterator[Shard]:
    names: list[str] = []
    num_frames = 0
    for line in look.episodes:
        names.append(line.name)
        num_frames += max(0, line.length)
        if num_frames >= target:
            yield Shard(str(look.dataset.root), tuple(names))
            names, num_frames = [], 0
    if names:
        yield Shard(str(look.dataset.root), tuple(names))


def _files(root: Path) -> Iterator[tuple[str, Path]]:
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if not name.startswith("."))  # not .git, .cache
        for name in sorted(names):
            path = Path(folder) / name
            if not name.startswith(".") and path.is_file():
                yield path.relative_to(root).as_posix(), path


def _stamp(roots: Sequence[Path]) -> str:
    times = [[relative, path.stat().st_mtime_ns] for root in roots for relative, path in _files(root)]
    return hashlib.sha256(json.dumps(times).encode()).hexdigest()
