"""One LeRobotDataset v3.0 on disk: its metadata, which episodes are wanted, and its numbers as arrays."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.datasets.io_utils import load_info, load_tasks
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.data.mixture_config import MemberConfig, demo_count
from robocasa_lerobot.data.reading.column_file import column_types, map_columns, read_columns
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.jsonl import read_jsonl

EPISODE_TABLE = "meta/robocasa/episodes.jsonl"
# What a member can choose episodes by: columns of that table, and the member's fields.
_CHOSEN_BY = {"task_name": "tasks", "layout_id": "layouts", "style_id": "styles"}
COLOURS = 3  # channels of a picture
_EPISODE_COLUMNS = ("episode_index", "dataset_from_index", "dataset_to_index")


class DatasetSource:
    """A dataset folder; the tables in `meta/` are read at once (milliseconds), columns on first use.

    Raises:
        UserError: no LeRobotDataset v3.0 at `root`, or an empty one.
    """

    def __init__(self, root: Path) -> None:
        self.root = Path(root)
        _check_is_dataset(self.root)
        self._info = load_info(self.root)
        if not self._info.total_episodes:
            raise UserError(f"{self.root}: the dataset has no episodes; convert some demonstrations first.")
        # LeRobot's own metadata object takes seconds for this table and has columns that are not needed here.
        self._episodes = _read_episodes(self.root, self._info.total_episodes)
        self.starts: NDArray[np.int64] = self._episodes.column("dataset_from_index").to_numpy().astype(np.int64)
        self.ends: NDArray[np.int64] = self._episodes.column("dataset_to_index").to_numpy().astype(np.int64)
        self.column_cache: Path | None = None
        self.fps = int(self._info.fps)
        self.robot_type: str | None = self._info.robot_type
        # Not the stages of episodes: datasets without them go together with those that have them, and a row of one
        # dataset's table of subtasks means nothing in another. Nor who decided a step, for the first reason.
        apart = {contract.decision_key(name) for name in contract.DECISIONS}
        # Depth maps: no policy here takes pictures of distances.
        self.depth = [
            key for key, ft in self._info.features.items() if contract.is_picture(ft) and contract.is_depth(ft)
        ]
        self.features: dict[str, dict[str, Any]] = {
            key: _channels_last(feature)
            for key, feature in self._info.features.items()
            if key not in apart and key not in contract.STAGE_KEYS and key not in self.depth
        }
        self.decisions = {key: feature for key, feature in self._info.features.items() if key in apart}
        tasks = load_tasks(self.root).sort_values("task_index")
        self.instructions = [str(text) for text in tasks.index]  # text of each `task_index`

    @property
    def total_frames(self) -> int:
        """Number of frames."""
        return int(self._info.total_frames)

    def video(self, episode: int, key: str) -> tuple[Path, float]:
        """File with the pictures of a camera feature of an episode, and the second in it where they begin."""
        chunk, file, start = (
            self._episodes.column(f"videos/{key}/{name}")[episode].as_py()
            for name in ("chunk_index", "file_index", "from_timestamp")
        )
        name = str(self._info.video_path).format(video_key=key, chunk_index=chunk, file_index=file)
        return self.root / name, float(start)

    def select(self, member: MemberConfig) -> NDArray[np.int64]:
        """Indices (ascending) of the episodes that a member of a mixture keeps.

        Those of its `episodes`, `tasks`, `layouts` and `styles`; `demos` (`50`, `10%`) then keeps so many of each
        task, by the benchmark's rule. A dataset that does not know its tasks counts as one.

        Raises:
            UserError: an unknown task, an index out of range, or nothing left.
        """
        kept: NDArray[np.int64] = np.arange(len(self.starts), dtype=np.int64)
        if member.episodes is not None:
            wrong = [index for index in member.episodes if not 0 <= index < len(kept)]
            if wrong:
                raise UserError(f"{self.root}: no episode {wrong[0]}; it has episodes 0 to {len(kept) - 1}.")
            kept = np.asarray(sorted(member.episodes), dtype=np.int64)
        rules = {name: getattr(member, field) for name, field in _CHOSEN_BY.items() if getattr(member, field)}
        for name, wanted in rules.items():
            values = self._episode_values(name, _CHOSEN_BY[name])
            for task in wanted if name == "task_name" else ():  # of the kitchens, not every task has all
                if task not in values:
                    raise UnknownNameError("task", task, values, f"(in the dataset {self.root})")
            kept = np.array([index for index in kept if values[index] in wanted], dtype=np.int64)
        if not len(kept):
            asked = ", ".join(f"{_CHOSEN_BY[name]}={wanted}" for name, wanted in rules.items())
            raise UserError(f"{self.root}: no episode is left with {asked} and episodes={member.episodes}.")
        return kept if member.demos is None else self._sample(kept, member.demos)

    def _sample(self, kept: NDArray[np.int64], demos: str) -> NDArray[np.int64]:
        known = (self.root / EPISODE_TABLE).is_file()
        names = np.array(self._episode_values("task_name", "tasks"))[kept] if known else np.zeros(len(kept))
        parts = []
        for name in np.unique(names):
            of_task = kept[names == name]
            parts.append(of_task[list(contract.demo_subset(len(of_task), demo_count(demos, len(of_task))))])
        return np.sort(np.concatenate(parts))

    def _episode_values(self, name: str, field: str) -> list[Any]:
        """What the table of episodes says under `name` of each; `field` is what asks for it."""
        path = self.root / EPISODE_TABLE
        if not path.is_file():
            raise UserError(
                f"{self.root}: `{field}` needs {EPISODE_TABLE}, which `robocasa-lerobot convert` writes and this "
                f"dataset lacks. Leave `{field}` out, or choose by `episodes`."
            )
        by_episode = {int(row["episode_index"]): row.get(name) for row in read_jsonl(path)}
        missing = set(range(len(self.starts))) - {index for index, value in by_episode.items() if value is not None}
        if missing:
            raise UserError(
                f"{path}: no {name} of episode {min(missing)}, which `{field}` needs; convert the dataset again, or "
                f"leave `{field}` out."
            )
        return [by_episode[index] for index in range(len(self.starts))]

    @property
    def column_bytes(self) -> int:
        """Bytes that `columns` take."""
        return self.total_frames * column_types(self.features).itemsize

    @functools.cached_property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Every numeric column over all frames: floats as float32 (frames, ...), integers as int64 (frames,).

        float32 is what LeRobot hands to policies too. In memory, or with `column_cache` memory-mapped from that folder.
        """
        row = column_types(self.features)
        if self.column_cache is None:
            return read_columns(self.root, row, self.total_frames)
        return map_columns(self.root, row, self.total_frames, self.fingerprint, self.column_cache)

    def close(self) -> None:
        """Let go of the columns; they are read again when they are asked for."""
        self.__dict__.pop("columns", None)

    @functools.cached_property
    def fingerprint(self) -> str:
        """Hash of what the dataset holds: metadata by content, data and video files by name and size."""
        digest = hashlib.sha256()
        for path in sorted(p for p in (self.root / "meta").rglob("*") if p.is_file()):
            digest.update(path.relative_to(self.root).as_posix().encode() + path.read_bytes())
        for folder in ("data", "videos", "images"):
            for path in sorted(p for p in (self.root / folder).rglob("*") if p.is_file()):
                digest.update(f"{path.relative_to(self.root).as_posix()} {path.stat().st_size}".encode())
        return digest.hexdigest()

    def __getstate__(self) -> dict[str, Any]:
        """Columns are read again in a worker process instead of being sent to it."""
        return {key: value for key, value in self.__dict__.items() if key != "columns"}


def _channels_last(feature: dict[str, Any]) -> dict[str, Any]:
    """A feature whose pictures have the shape (height, width, channels), as LeRobot writes them by default.

    Some datasets say (channels, height, width), and all pictures are handed out so, whatever is said.
    """
    if not contract.is_picture(feature):
        return feature
    names, shape = [str(name).rstrip("s") for name in feature.get("names") or ()], list(feature["shape"])
    first = names[0] == "channel" if names else shape[0] == COLOURS and shape[2] != COLOURS
    shape = [*shape[1:], shape[0]] if first else shape
    return {**feature, "shape": tuple(shape), "names": ["height", "width", "channel"]}


def _check_is_dataset(root: Path) -> None:
    info = root / "meta" / "info.json"
    if not info.is_file():
        inside = sorted(p.name for p in root.iterdir())[:5] if root.is_dir() else None
        hint = "" if inside is None else f" The folder has {', '.join(inside)}." if inside else " The folder is empty."
        raise UserError(
            f"no dataset at {root} (no meta/info.json).{hint} Record with `robocasa-lerobot demos` and convert with "
            "`robocasa-lerobot convert` (the demo's: `make demo` does both), or correct the mixture's `root`."
        )
    try:
        version = json.loads(info.read_text(encoding="utf-8")).get("codebase_version")
    except ValueError as error:
        raise UserError(f"{info}: not valid JSON: {error}; get or convert the dataset again.") from error
    if version != "v3.0":
        raise UserError(
            f"{root}: LeRobotDataset {version}, expected v3.0. `robocasa-lerobot convert` reads older ones."
        )


def _read_episodes(root: Path, count: int) -> pa.Table:
    """Where the frames and the videos of each episode are: numbers only, by episode."""
    files = sorted((root / "meta" / "episodes").glob("*/*.parquet"))
    names = pq.read_schema(files[0]).names if files else []
    wanted = [name for name in names if name in _EPISODE_COLUMNS or name.startswith("videos/")]
    try:
        table = pa.concat_tables([pq.read_table(path, columns=wanted) for path in files]).combine_chunks()
        if not np.array_equal(table.column("episode_index").to_numpy(), np.arange(count)):
            table = table.sort_by("episode_index")
        found = table.column("episode_index").to_numpy()
    except (pa.ArrowInvalid, ValueError, KeyError) as error:
        raise UserError(f"{root}: meta/episodes cannot be read ({error}); convert the dataset again.") from error
    if not np.array_equal(found, np.arange(count)):
        raise UserError(f"{root}: meta/episodes does not list the episodes 0 to {count - 1}; convert it again.")
    return table
