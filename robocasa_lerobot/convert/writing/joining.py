"""Datasets that were written in parts, joined into one LeRobotDataset v3.0 in a single pass.

The parts' rows, episode entries and video packets are copied as they are; only indices, places and times are given
anew. LeRobot's own `aggregate_datasets` (0.6.1) opens every part through its loader, which takes a third of a second
each, and rewrites the whole present video file for every part it appends; joining 64 parts took longer than
converting them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.datasets.io_utils import write_tasks
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.inputs import INFO_FILE
from robocasa_lerobot.convert.writing.files import VIDEO_FILE_MB
from robocasa_lerobot.convert.writing.stages import SubtaskTable, read_subtasks
from robocasa_lerobot.convert.writing.statistics import column_of, vector_statistics
from robocasa_lerobot.convert.writing.video import VideoFiles, probe

DATA_FILE_MB = 100  # LeRobot's default
_SHIFTED = ("min", "max", "mean", "q01", "q10", "q50", "q90", "q99")  # statistics that move with their values


def join_datasets(parts: Sequence[Path], target: Path) -> None:
    """Write the episodes of `parts`, in order, as one dataset into the folder `target`, which must not exist.

    The parts have equal features, rates and robots. `meta/stats.json` is left to the caller.
    """
    infos = [json.loads((part / INFO_FILE).read_text(encoding="utf-8")) for part in parts]
    first = infos[0]
    for info in infos[1:]:
        for key in ("fps", "robot_type"):
            assert info[key] == first[key], f"parts of one conversion have equal {key}"
        assert _plain(info["features"]) == _plain(first["features"]), "parts of one conversion have equal features"
    target.mkdir(parents=True)
    features = {key: _described(key, infos) for key in first["features"]}
    video_keys = [key for key, feature in features.items() if feature["dtype"] == "video"]
    videos = {key: VideoFiles(target, key, first["fps"], VIDEO_FILE_MB * 2**20) for key in video_keys}
    data = _Files(target, "data", first["chunks_size"], DATA_FILE_MB)
    entries = _Files(target, "meta/episodes", first["chunks_size"], DATA_FILE_MB)
    tasks: dict[str, int] = {}
    subtasks = SubtaskTable()
    num_episodes = num_frames = 0
    for part, info in zip(parts, infos, strict=True):
        rows = _task_rows(part)
        renumbered = np.zeros(max(rows.values()) + 1, np.int64)
        for task, row in rows.items():
            renumbered[row] = tasks.setdefault(task, len(tasks))
        table = pq.ParquetFile(_only(part, "data")).read()
        table = _set(table, "episode_index", column_of(table, "episode_index") + num_episodes)
        table = _set(table, "index", column_of(table, "index") + num_frames)
        rows_of = {"task_index": renumbered[column_of(table, "task_index")]}
        if contract.SUBTASK_KEY in first["features"] and (texts := read_subtasks(part)):
            subtask_rows = subtasks.rows(texts)
            rows_of[contract.SUBTASK_KEY] = subtask_rows[column_of(table, contract.SUBTASK_KEY)]
        for name, values in rows_of.items():
            table = _set(table, name, values)
        chunk, file = data.write(table)
        episodes = pq.ParquetFile(_only(part, "meta/episodes")).read()
        starts = column_of(episodes, "dataset_from_index")
        ends = column_of(episodes, "dataset_to_index")
        episodes = _shift(episodes, "episode_index", num_episodes)
        episodes = _shift(episodes, "index", num_frames)
        for feature, numbers in rows_of.items():
            each = [vector_statistics(numbers[start:end]) for start, end in zip(starts, ends, strict=True)]
            episodes = _set_statistics(episodes, feature, each)
        for name, values in (
            ("episode_index", column_of(episodes, "episode_index") + num_episodes),
            ("dataset_from_index", starts + num_frames),
            ("dataset_to_index", ends + num_frames),
            ("data/chunk_index", np.full(len(starts), chunk)),
            ("data/file_index", np.full(len(starts), file)),
        ):
            episodes = _set(episodes, name, values)
        for key in video_keys:
            episodes = _append_videos(episodes, part, key, videos[key])
        entries.write(episodes, own_place=True)
        num_episodes += info["total_episodes"]
        num_frames += info["total_frames"]
    data.close()
    entries.close()
    for files in videos.values():
        files.close()
    write_tasks(pd.DataFrame({"task_index": list(tasks.values())}, index=pd.Index(list(tasks), name="task")), target)
    subtasks.write(target)
    info = first | {
        "features": features,
        "total_episodes": num_episodes,
        "total_frames": num_frames,
        "total_tasks": len(tasks),
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "data_files_size_in_mb": DATA_FILE_MB,
        "splits": {"train": f"0:{num_episodes}"},
    }
    (target / INFO_FILE).write_text(json.dumps(info, indent=4, ensure_ascii=False), encoding="utf-8")


def copy_tree(source: Path, target: Path) -> None:
    """Copy a folder without copying bytes where the file system allows it; the source stays as it is."""
    shutil.copytree(source, target, copy_function=copy_file)


def copy_file(source: str | Path, target: str | Path) -> str:
    """Copy a file without copying its bytes where the file system allows it."""
    try:
        Path(target).hardlink_to(source)
    except OSError:
        shutil.copy2(source, target)
    return str(target)


class _Files:
    """Tables in LeRobot's layout `<folder>/chunk-000/file-000.parquet`, a new file when the present one is full."""

    def __init__(self, root: Path, folder: str, chunks_size: int, max_mb: int) -> None:
        self._folder, self._chunks_size, self._max_bytes = root / folder, chunks_size, max_mb * 2**20
        self._prefix = folder
        self._number, self._bytes = -1, 0
        self._writer: pq.ParquetWriter | None = None

    def write(self, table: pa.Table, own_place: bool = False) -> tuple[int, int]:
        """Append rows; gives chunk and file. With `own_place` the rows have these as columns, too."""
        if self._writer is None or self._bytes + table.nbytes > self._max_bytes:
            self.close()
            self._number, self._bytes = self._number + 1, 0
        chunk, file = divmod(self._number, self._chunks_size)
        if own_place:
            for name, value in (("chunk_index", chunk), ("file_index", file)):
                table = _set(table, f"{self._prefix}/{name}", np.full(len(table), value))
        if self._writer is None:
            path = self._folder / f"chunk-{chunk:03d}" / f"file-{file:03d}.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema, compression="snappy")
        self._writer.write_table(table.cast(self._writer.schema))
        self._bytes += table.nbytes
        return chunk, file

    def close(self) -> None:
        """Complete the present file."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def _append_videos(episodes: pa.Table, part: Path, key: str, files: VideoFiles) -> pa.Table:
    """Copy a part's videos of one camera, and give its episodes their new places and times."""
    prefix = f"videos/{key}"
    names = [f"{prefix}/{name}" for name in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")]
    chunks, numbers, starts, ends = (column_of(episodes, name).copy() for name in names)
    place = {
        (chunk, number): part / prefix / f"chunk-{chunk:03d}" / f"file-{number:03d}.mp4"
        for chunk, number in dict.fromkeys(zip(chunks.tolist(), numbers.tolist(), strict=True))
    }
    old_chunks, old_numbers = chunks.copy(), numbers.copy()
    for (chunk, number), path in place.items():
        where = (old_chunks == chunk) & (old_numbers == number)
        entry = files.append(path, probe(path))
        chunks[where], numbers[where] = entry[names[0]], entry[names[1]]
        starts[where] += entry[names[2]]
        ends[where] += entry[names[2]]
        assert np.isclose(ends[where].max(), entry[names[3]]), f"{path}: its frames are not those of its episodes"
    for name, values in zip(names, (chunks, numbers, starts, ends), strict=True):
        episodes = _set(episodes, name, values)
    return episodes


def _shift(episodes: pa.Table, feature: str, offset: int) -> pa.Table:
    for name in _SHIFTED:
        column = f"stats/{feature}/{name}"
        values = column_of(episodes, column) + offset
        array = pa.array(values.tolist(), episodes.schema.field(column).type)
        episodes = episodes.set_column(episodes.schema.get_field_index(column), column, array)
    return episodes


def _set_statistics(episodes: pa.Table, feature: str, each: Sequence[Mapping[str, NDArray[Any]]]) -> pa.Table:
    """The entries of episodes with other statistics of a feature, those of each episode."""
    for name in each[0]:
        column = f"stats/{feature}/{name}"
        values = pa.array([stats[name].tolist() for stats in each], episodes.schema.field(column).type)
        episodes = episodes.set_column(episodes.schema.get_field_index(column), column, values)
    return episodes


def _set(table: pa.Table, name: str, values: NDArray[Any]) -> pa.Table:
    index = table.schema.get_field_index(name)
    return table.set_column(index, table.schema.field(index), pa.array(values, table.schema.field(index).type))


def _task_rows(part: Path) -> dict[str, int]:
    table = pd.read_parquet(part / "meta" / "tasks.parquet")
    return {str(task): int(row) for task, row in table["task_index"].items()}


def _only(part: Path, folder: str) -> Path:
    (file,) = (part / folder).glob("*/*.parquet")
    return file


def _plain(features: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {key: {k: v for k, v in feature.items() if k != "info"} for key, feature in features.items()}


def _described(key: str, infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """A feature, with what holds for the videos of all parts."""
    described = [info["features"][key] for info in infos]
    feature = dict(described[0])
    if "info" in feature:
        others = [other.get("info", {}) for other in described[1:]]
        feature["info"] = {k: v for k, v in feature["info"].items() if all(other.get(k) == v for other in others)}
    return feature
