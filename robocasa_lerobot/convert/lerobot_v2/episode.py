"""One episode of a LeRobot v2 dataset: checked columns, instruction for each step, videos and extras."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.lerobot_v2.dataset import EpisodeLine, V2Dataset
from robocasa_lerobot.convert.mapping.instruction import OPTION, template_fields
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.reading.extras import read_scene, read_states
from robocasa_lerobot.convert.settings import Camera, ConversionSettings
from robocasa_lerobot.convert.writing.statistics import column_of
from robocasa_lerobot.convert.writing.video import VideoForm, frames, probe, rgb
from robocasa_lerobot.errors import UserError

# How far the recorded times may be from even steps, in steps, before they say that frames were lost.
MAX_TIME_DEVIATION = 0.1
EP_META, MODEL, STATES = "ep_meta.json", "model.xml.gz", "states.npz"  # RoboCasa's names under `extras`


@dataclass(frozen=True)
class Column:
    """A column that is taken over: its feature in the new dataset, and the order of components if that changes."""

    name: str
    dtype: str
    size: int
    names: tuple[str, ...]
    order: tuple[int, ...] | None = None

    def feature(self) -> dict[str, Any]:
        """LeRobot's description of it."""
        return {"dtype": self.dtype, "shape": (self.size,), "names": list(self.names) or None}


@dataclass(frozen=True)
class Extras:
    """RoboCasa's files for replaying an episode, as they are."""

    ep_meta: dict[str, Any]
    files: tuple[Path, ...]


class V2Episode:
    """An episode with everything but its pictures read and checked.

    Attributes: `columns` gives each taken column as (T,) or (T, k), bit for bit but for the order of components and
    task rows renumbered; `task_index` (T,) is the row of the instruction at each step in the united table.

    Raises:
        RejectedEpisodeError: anything that keeps this episode from being converted.
    """

    def __init__(
        self,
        dataset: V2Dataset,
        line: EpisodeLine,
        columns: tuple[Column, ...],
        tasks: tuple[str, ...],
        settings: ConversionSettings,
    ) -> None:
        self.dataset, self.index, self.name = dataset, line.index, line.name
        self._columns, self._tasks, self._fps = columns, tasks, dataset.fps
        self._file = dataset.data_file(line.index)
        table = self._table()
        self.length: int = table.num_rows
        if self.length == 0:
            raise RejectedEpisodeError("it has no steps.")
        if self.length != line.length:
            raise RejectedEpisodeError(
                f"unequal lengths: {line.length} in episodes.jsonl but {self.length} rows in {self._file.name}."
            )
        self._check_counting(table)
        self._rows = {text: row for row, text in enumerate(tasks)}
        self._renumbered = {old: self._rows[text] for old, text in dataset.tasks.items()}
        annotations = frozenset(dataset.annotation_columns)
        self.columns = {
            column.name: self._annotation(table, column) if column.name in annotations else self._values(table, column)
            for column in columns
        }
        self.instruction_source = f"tasks.jsonl by {dataset.instruction_column}"
        self.task_index = self._instructions(table, settings)
        self.instruction = tasks[int(self.task_index[0])]
        self.extras = self._extras()

    @property
    def actions(self) -> NDArray[Any]:
        """Actions (T, A) as they are written."""
        return self.columns[contract.ACTION_KEY]

    @property
    def states(self) -> NDArray[Any]:
        """States (T, S) as they are written."""
        return self.columns[contract.STATE_KEY]

    @property
    def task_name(self) -> str:
        """Name of the task from its own annotation column, else from RoboCasa's extras, else "unknown"."""
        for name, values in self.columns.items():
            if name.startswith("annotation.") and name.endswith("task_name") and 0 <= values[0] < len(self._tasks):
                return self._tasks[int(values[0])]
        return self.dataset.env_name

    def video(self, key: str) -> tuple[Path, VideoForm]:
        """An episode's video and its form.

        Raises:
            RejectedEpisodeError: it is missing or unreadable, or has not as many frames as there are rows.
        """
        path = self.dataset.video_file(self.index, key)
        if not path.is_file():
            raise RejectedEpisodeError(f"its video of {key} is missing ({path}).")
        form = probe(path)
        if form.num_packets < self.length:
            raise RejectedEpisodeError(
                f"unequal lengths: {self.length} rows but {form.num_packets} frames in the video of {key}."
            )
        return path, form

    def pictures(self, key: str, camera: Camera) -> Iterator[NDArray[np.uint8]]:
        """Pictures (H, W, 3) of a camera in order and in the size of the dataset, decoded."""
        path, _ = self.video(key)
        count = 0
        for count, frame in enumerate(frames(path), start=1):
            if count <= self.length:
                yield rgb(frame, (camera.height, camera.width))
        self.check_frames(key, count)

    def check_frames(self, key: str, count: int) -> None:
        """Compare the number of decoded frames with the number of rows."""
        if count != self.length:
            raise RejectedEpisodeError(
                f"unequal lengths: {self.length} rows but {count} decodable frames in the video of {key}."
            )

    def digest(self, videos: Mapping[str, Path]) -> str:
        """SHA-256 over the parquet file, the given videos and the extras, with their names."""
        total = hashlib.sha256()
        for label, path in (("data", self._file), *sorted(videos.items()), *((p.name, p) for p in self.extras.files)):
            with path.open("rb") as stream:
                total.update(f"{label}:{hashlib.file_digest(stream, 'sha256').hexdigest()}\n".encode())
        return total.hexdigest()

    @cached_property
    def time_offset(self) -> float:
        """The first recorded time in seconds; 0 in most datasets, one step in some. It is not kept."""
        return self._first_time

    def _table(self) -> pa.Table:
        if not self._file.is_file():
            raise RejectedEpisodeError(f"its table is missing ({self._file}).")
        try:
            present = set(pq.read_schema(self._file).names)
            wanted = {column.name for column in self._columns} | {
                "timestamp", "frame_index", "episode_index", "task_index", self.dataset.instruction_column,
            }  # fmt: skip
            return pq.read_table(self._file, columns=sorted(wanted & present))
        except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise RejectedEpisodeError(f"{self._file.name} cannot be read as parquet ({reason}).") from None

    def _raw(self, table: pa.Table, name: str, size: int) -> NDArray[Any]:
        if name not in table.column_names:
            raise RejectedEpisodeError(f"{self._file.name} has no column {name!r}.")
        column = table[name]
        if column.null_count or any(_inner_nulls(chunk) for chunk in column.chunks):
            raise RejectedEpisodeError(f"{name} has empty values.")
        try:
            if pa.types.is_nested(column.type):
                lengths = {int(n) for chunk in column.chunks for n in _row_lengths(chunk)}
                if lengths - {size}:
                    raise RejectedEpisodeError(f"{name} has rows of {sorted(lengths)} numbers, expected {size}.")
            return column_of(table, name)
        except (pa.ArrowException, ValueError, TypeError) as error:
            if isinstance(error, RejectedEpisodeError):
                raise
            raise RejectedEpisodeError(f"{name} is {column.type}, expected numbers ({error}).") from None

    def _values(self, table: pa.Table, column: Column) -> NDArray[Any]:
        values = self._raw(table, column.name, column.size)
        if column.dtype == "string":
            return values
        if str(values.dtype) != column.dtype or values.size != self.length * column.size:
            found = f"{values.dtype} {values.shape}"
            raise RejectedEpisodeError(f"{column.name} is {found}, expected {column.dtype} (T, {column.size}).")
        bad = np.flatnonzero(~np.isfinite(values)) if values.dtype.kind == "f" else np.empty(0, np.int64)
        if len(bad):
            step = int(bad[0]) // column.size
            raise RejectedEpisodeError(
                f"{column.name} has {len(bad)} values that are NaN or infinite, the first at step {step}."
            )
        if column.order is not None:
            values = np.ascontiguousarray(values[:, column.order])
        return values.reshape(self.length) if column.size == 1 else values

    def _annotation(self, table: pa.Table, column: Column) -> NDArray[np.int64]:
        """Task rows in the united table; a number that is no row stays what it is."""
        values = self._values(table, column)
        return np.array([self._renumbered.get(int(value), int(value)) for value in values], np.int64)

    def _instructions(self, table: pa.Table, settings: ConversionSettings) -> NDArray[np.int64]:
        given = given_instruction(settings)
        if given is not None and settings.replace_instruction:
            self.instruction_source = OPTION
            return np.full(self.length, self._rows[given])
        rows = self._raw(table, self.dataset.instruction_column, 1).reshape(-1)
        out = np.empty(self.length, np.int64)
        for row in np.unique(rows):
            text = self.dataset.tasks.get(int(row), "")
            if not text.strip():
                if given is None:
                    what = "is empty" if int(row) in self.dataset.tasks else "is not in tasks.jsonl"
                    raise RejectedEpisodeError(
                        f"its instruction, row {int(row)} of tasks.jsonl by {self.dataset.instruction_column}, {what} "
                        "(--instruction gives one)."
                    )
                text, self.instruction_source = given, OPTION
            out[rows == row] = self._rows[text]
        return out

    def _check_counting(self, table: pa.Table) -> None:
        """Rows are in order, of this episode, and one step apart."""
        if "frame_index" in table.column_names:
            steps = self._raw(table, "frame_index", 1).reshape(-1)
            if not np.array_equal(steps, np.arange(self.length)):
                raise RejectedEpisodeError("frame_index does not count 0, 1, 2, ...: rows are missing or out of order.")
        if "episode_index" in table.column_names:
            episodes = np.unique(self._raw(table, "episode_index", 1))
            if episodes.tolist() != [self.index]:
                raise RejectedEpisodeError(f"its rows say they are of episode {episodes.tolist()[:3]}.")
        self._first_time = 0.0
        if "timestamp" in table.column_names:
            times = self._raw(table, "timestamp", 1).reshape(-1).astype(np.float64)
            self._first_time = float(times[0])
            uneven = np.abs((times - times[0]) * self._fps - np.arange(self.length))
            worst = int(np.argmax(uneven)) if np.isfinite(uneven).all() else int(np.argmax(~np.isfinite(uneven)))
            if not uneven[worst] <= MAX_TIME_DEVIATION:
                raise RejectedEpisodeError(
                    f"its times are not {self._fps} steps a second: step {worst} is at {times[worst]:.4f} s."
                )

    def _extras(self) -> Extras:
        folder = self.dataset.extras_folder(self.index)
        present = tuple(path for name in (EP_META, MODEL, STATES) if (path := folder / name).is_file())
        meta: dict[str, Any] = {}
        for path in present:
            if path.name == MODEL:
                read_scene(path)
            elif path.name == STATES:
                read_states(path, self.length)
            else:
                try:
                    meta = json.loads(path.read_text(encoding="utf-8"))
                except (OSError, ValueError, RecursionError) as error:
                    raise RejectedEpisodeError(f"its extras/{path.name} cannot be used ({error}).") from None
        if not isinstance(meta, dict):
            raise RejectedEpisodeError(f"its {EP_META} is a JSON {type(meta).__name__}, expected an object.")
        return Extras(meta, present)


def given_instruction(settings: ConversionSettings) -> str | None:
    """The user's instruction as text.

    Raises:
        UserError: it is a template with fields; what fills them is read too late to number the tasks.
    """
    if settings.instruction is None:
        return None
    names = template_fields(settings.instruction)
    if names:
        raise UserError(
            f"--instruction has the field {{{names[0]}}}, which LeRobot v2 datasets do not fill: give plain text."
        )
    return settings.instruction.format()


def _row_lengths(array: Any) -> list[int]:
    if pa.types.is_fixed_size_list(array.type):
        return [array.type.list_size]
    return array.value_lengths().unique().to_pylist()


def _inner_nulls(array: Any) -> int:
    return int(array.flatten().null_count) if pa.types.is_nested(array.type) else 0
