"""A LeRobotDataset v3.0 read episode by episode, in order, without LeRobot's loader (which copies all tables first)."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.mapping.robot_mapping import EXTRA_PREFIX
from robocasa_lerobot.convert.reading.inputs import INFO_FILE, check_dataset
from robocasa_lerobot.convert.record_files import EPISODES_FILE, EXTRAS, episode_folder, kept_assets
from robocasa_lerobot.convert.writing.statistics import column_of
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

__all__ = ["EXTRA_PREFIX", "INDEX_COLUMNS", "ExportedDataset", "ExportedEpisode"]

_VERSION = "v3."
_OURS = "meta/robocasa"
_TIME_TOLERANCE = 0.1  # of a frame
INDEX_COLUMNS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@dataclass(frozen=True)
class ExportedEpisode:
    """An episode's entry: its length, where its rows and videos are, and its task's name (or "unknown")."""

    index: int
    length: int
    task_name: str
    source_file: str | None
    entry: dict[str, Any]


class ExportedDataset:
    """A dataset of this project or of others.

    Raises:
        UserError: the folder is no LeRobotDataset v3.0, or a file of it is missing or damaged.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        check_dataset(root)
        file = root / INFO_FILE
        try:
            self.info: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
            version = str(self.info["codebase_version"])
            self.features: dict[str, dict[str, Any]] = self.info["features"]
            self.fps = int(self.info["fps"])
        except (ValueError, KeyError, TypeError) as error:
            raise UserError(f"{file} is damaged ({type(error).__name__}: {error}).") from None
        if not version.startswith(_VERSION):
            raise UserError(
                f"{root} is a LeRobot dataset of version {version}; v3.0 is needed: "
                f"`robocasa-lerobot convert {root} --out ...` brings v2.0 and v2.1 there."
            )
        if contract.ACTION_KEY not in self.features:
            raise UserError(f"{root} has no column {contract.ACTION_KEY!r}: there is nothing to export.")
        try:
            self.episodes = self._episodes()
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            raise UserError(f"{root} cannot be read ({type(error).__name__}: {error}).") from None
        if not self.episodes:
            raise UserError(f"{root} has no episodes.")
        self._table: tuple[Path, pa.Table] | None = None

    @property
    def robot_type(self) -> str:
        """Name of the robot, or "unknown"."""
        return str(self.info.get("robot_type") or "unknown")

    @cached_property
    def cameras(self) -> dict[str, str]:
        """Camera name -> feature, depth left out."""
        return {
            key.removeprefix(contract.IMAGE_PREFIX): key
            for key, feature in self.features.items()
            if contract.is_picture(feature) and not contract.is_depth(feature)
        }

    def columns(self, episode: ExportedEpisode) -> dict[str, NDArray[Any]]:
        """All numeric columns of an episode but the indices, (T,) or (T, k), with their stored dtypes."""
        table = self._rows(episode)
        numeric = [
            key
            for key, feature in self.features.items()
            if feature["dtype"] not in ("video", "image", "string", "language")
            and key not in INDEX_COLUMNS
            and len(feature["shape"]) == 1
        ]
        return {key: column_of(table, key) for key in numeric}

    def instruction(self, episode: ExportedEpisode) -> str:
        """The language of an episode (of its first step, where it changes)."""
        row = int(column_of(self._rows(episode), "task_index")[0])
        return self._tasks[row]

    def extras(self, episode: ExportedEpisode) -> Path:
        """The folder with what the episode is replayed from, which may be missing."""
        return self.root / EXTRAS / episode_folder(episode.index)

    def pictures(self, episode: ExportedEpisode, camera: str) -> Iterator[NDArray[np.uint8]]:
        """Every picture (H, W, 3) of a camera in order.

        Raises:
            UserError: the video is damaged or does not hold the episode's frames at their times.
        """
        key = self.cameras[camera]
        if self.features[key]["dtype"] == "image":
            yield from self._stored_pictures(episode, key)
            return
        place = {name: episode.entry[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
        path = self.root / str(self.info["video_path"]).format(video_key=key, **place)
        start = float(episode.entry[f"videos/{key}/from_timestamp"])
        step = 0
        try:
            with av.open(str(path)) as container:
                stream = container.streams.video[0]
                assert stream.time_base is not None
                container.seek(round(start / stream.time_base), stream=stream)
                for frame in container.decode(stream):
                    place_in_episode = (float(frame.pts * stream.time_base) - start) * self.fps
                    if place_in_episode < -_TIME_TOLERANCE:
                        continue
                    if step == episode.length:
                        break
                    if abs(place_in_episode - step) > _TIME_TOLERANCE:
                        break
                    yield frame.to_ndarray(format="rgb24")
                    step += 1
        except (av.FFmpegError, OSError, IndexError) as error:
            raise UserError(f"{path} cannot be read ({error}): `robocasa-lerobot verify` the dataset.") from None
        if step != episode.length:
            raise UserError(
                f"{path} lacks frame {step} of episode {episode.index}, which has {episode.length}: "
                "`robocasa-lerobot verify` the dataset."
            )

    def source_attributes(self, episode: ExportedEpisode) -> dict[str, Any]:
        """Attributes of the HDF5 file that an episode came from, where this project converted it."""
        for source in self._sources:
            if source["file"] == episode.source_file:
                return dict(source["attributes"])
        return {}

    def assets(self, episodes: Sequence[ExportedEpisode]) -> list[Path]:
        """Folders with the meshes and textures that the HDF5 files of episodes held, where the dataset keeps them."""
        folders = [self.root / EXTRAS / kept_assets(str(source.get("sha256"))) for source in self._sources_of(episodes)]
        return [folder for folder in folders if folder.is_dir()]

    def source_files(self, episodes: Sequence[ExportedEpisode]) -> list[Path]:
        """HDF5 files that episodes came from, those that are still there."""
        sources = self._sources_of(episodes)
        places = [[Path(source["file"]), self.root / source["relative_to_dataset"]] for source in sources]
        return [next(path for path in paths if path.is_file()) for paths in places if any(p.is_file() for p in paths)]

    def _sources_of(self, episodes: Sequence[ExportedEpisode]) -> list[dict[str, Any]]:
        files = {episode.source_file for episode in episodes}
        return [source for source in self._sources if source["file"] in files]

    @property
    def placed_cameras(self) -> tuple[str, ...]:
        """Cameras that were moved or added when the pictures were rendered again."""
        return tuple(self._record.get("settings", {}).get("cam_configs", {}))

    @property
    def _sources(self) -> list[dict[str, Any]]:
        return list(self._record.get("sources", []))

    @cached_property
    def _record(self) -> dict[str, Any]:
        file = self.root / _OURS / "conversion.json"
        return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else {}

    @cached_property
    def _tasks(self) -> dict[int, str]:
        table = pq.ParquetFile(self.root / "meta" / "tasks.parquet").read()
        texts = next(name for name in ("task", "__index_level_0__") if name in table.column_names)
        return dict(zip(table["task_index"].to_pylist(), table[texts].to_pylist(), strict=True))

    def _episodes(self) -> list[ExportedEpisode]:
        file = self.root / _OURS / EPISODES_FILE
        lines = {line["episode_index"]: line for line in read_jsonl(file)} if file.is_file() else {}
        episodes = []
        for path in sorted((self.root / "meta" / "episodes").glob("*/*.parquet")):
            entries = pq.ParquetFile(path)
            names = [name for name in entries.schema_arrow.names if not name.startswith("stats/") and name != "tasks"]
            for entry in entries.read(columns=names).to_pylist():
                line = lines.get(entry["episode_index"], {})
                episodes.append(
                    ExportedEpisode(
                        int(entry["episode_index"]),
                        int(entry["length"]),
                        str(line.get("task_name", "unknown")),
                        line.get("source_file"),
                        entry,
                    )
                )
        return sorted(episodes, key=lambda episode: episode.index)

    def _rows(self, episode: ExportedEpisode) -> pa.Table:
        place = {name: episode.entry[f"data/{name}"] for name in ("chunk_index", "file_index")}
        path = self.root / str(self.info["data_path"]).format(**place)
        if self._table is None or self._table[0] != path:
            try:
                self._table = (path, pq.ParquetFile(path).read())
            except (OSError, pa.ArrowException) as error:
                raise UserError(f"{path} cannot be read ({error}): `robocasa-lerobot verify` the dataset.") from None
        table = self._table[1]
        rows = np.flatnonzero(column_of(table, "episode_index") == episode.index)
        if len(rows) != episode.length:
            raise UserError(f"{path} has {len(rows)} rows of episode {episode.index}, expected {episode.length}.")
        return table.slice(int(rows[0]), episode.length)

    def _stored_pictures(self, episode: ExportedEpisode, key: str) -> Iterator[NDArray[np.uint8]]:
        from PIL import Image

        for value in self._rows(episode)[key]:
            yield np.asarray(Image.open(io.BytesIO(value.as_py()["bytes"])).convert("RGB"))
