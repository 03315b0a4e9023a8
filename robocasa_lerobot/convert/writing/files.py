"""The files of a LeRobotDataset v3.0, to which finished episodes are appended: tables, videos, LeRobot's metadata."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.configs import RGBEncoderConfig
from lerobot.datasets.dataset_metadata import LeRobotDatasetMetadata
from lerobot.datasets.feature_utils import get_hf_features_from_features
from lerobot.datasets.io_utils import write_info
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.stages import StageTrack
from robocasa_lerobot.convert.writing.encoder import CODECS, EncodedVideo, Histogram
from robocasa_lerobot.convert.writing.stages import SubtaskTable, language_column
from robocasa_lerobot.convert.writing.statistics import vector_statistics
from robocasa_lerobot.convert.writing.video import VideoFiles, VideoForm, probe

# Also the time to open one file, and the frames that are lost with it.
VIDEO_FILE_MB = 100
_DATA_FILE = "data/chunk-000/file-000.parquet"


class DatasetFiles:
    """A dataset of one data file; `finalize` completes it.

    Args:
        root: folder of the dataset, which must not exist.
        fps: frames per second.
        robot_type: name of the robot.
        features: LeRobot's, without those that every dataset has (time, indices).
        tasks: instructions that have the first rows of the table of tasks, used or not.

    Attributes: `num_episodes`, `num_frames`, `video_keys`, and `histograms` (sampled pixels of all episodes so far, by
    video feature).
    """

    def __init__(
        self, root: Path, fps: int, robot_type: str, features: Mapping[str, Any], tasks: Sequence[str] = ()
    ) -> None:
        self.num_episodes = self.num_frames = 0
        self.histograms: dict[str, Histogram] = {}
        self._subtasks = SubtaskTable()
        self._root, self._fps = root, fps
        self._meta = LeRobotDatasetMetadata.create(
            repo_id="local/shard",
            fps=fps,
            features=dict(features),
            robot_type=robot_type,
            root=root,
            video_files_size_in_mb=VIDEO_FILE_MB,
        )
        if tasks:
            self._meta.save_episode_tasks(list(tasks))
        self.video_keys: list[str] = self._meta.video_keys
        self._schema = get_hf_features_from_features(self._meta.features).arrow_schema
        (root / _DATA_FILE).parent.mkdir(parents=True)
        self._tables = pq.ParquetWriter(root / _DATA_FILE, self._schema, compression="snappy")
        self._videos = {key: VideoFiles(root, key, fps, VIDEO_FILE_MB * 2**20) for key in self.video_keys}

    def append(
        self,
        columns: Mapping[str, NDArray[Any]],
        tasks: Sequence[str],
        length: int,
        videos: Mapping[str, EncodedVideo],
        forms: Mapping[str, VideoForm] | None = None,
        stages: StageTrack | None = None,
    ) -> None:
        """Append an episode of `length` steps.

        Args:
            columns: each feature but videos, time and indices, (T,) or (T, k), with the feature's dtype; `task_index`
                where the steps have several tasks.
            tasks: the instructions of the episode.
            length: number of steps T.
            videos: with T frames each, by video feature.
            forms: of the videos, where they are known already.
            stages: which stage each step belongs to, where the features have them.
        """
        index, first = self.num_episodes, self.num_frames
        self._meta.save_episode_tasks(list(tasks))
        everything: dict[str, NDArray[Any]] = {
            "task_index": np.full(length, self._meta.get_task_index(tasks[0])),
            **columns,
            "timestamp": (np.arange(length) / self._fps).astype(np.float32),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, index),
            "index": np.arange(first, first + length),
        }
        language: dict[str, pa.Array] = {}
        if stages is not None:
            everything |= {
                contract.STAGE_KEY: stages.index,
                contract.SUBTASK_KEY: self._subtasks.rows(stages.texts)[stages.index],
            }
            kind = self._schema.field(contract.LANGUAGE_KEY).type
            language[contract.LANGUAGE_KEY] = language_column(stages, everything["timestamp"], kind)
        self._tables.write_table(arrow_table(everything, self._schema, language))
        entries: dict[str, Any] = {
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": first,
            "dataset_to_index": first + length,
        }
        statistics = {
            key: vector_statistics(values) for key, values in everything.items() if values.dtype.kind in "fiub"
        }
        for key, video in videos.items():
            form = video.form if forms is None else forms[key]
            entries |= self._videos[key].append(video.path, form or probe(video.path))
            statistics[key] = video.statistics()
            self.histograms[key] = self.histograms.get(key, 0) + video.histogram
        self._meta.save_episode(index, length, list(tasks), statistics, entries)
        self.num_episodes, self.num_frames = index + 1, first + length

    def finalize(self, codecs: Mapping[str, str | None]) -> None:
        """Complete the files; without this they have no footers and the dataset is lost.

        Args:
            codecs: key of `CODECS` for each video feature, None where some videos were encoded by others.
        """
        self._tables.close()
        for videos in self._videos.values():
            videos.close()
        self._meta.finalize()
        self._subtasks.write(self._root)
        if self.num_episodes:
            for key in self._videos:
                codec = codecs[key]
                encoder = None if codec is None else RGBEncoderConfig(**CODECS[codec])
                self._meta.update_video_info(key, video_encoder=encoder)
            write_info(self._meta.info, self._root)


def arrow_table(
    columns: Mapping[str, NDArray[Any]], schema: pa.Schema, made: Mapping[str, pa.Array] | None = None
) -> pa.Table:
    """Columns (T,) or (T, k) as an Arrow table with the fields of `schema`, bit for bit; `made` are Arrow already."""
    arrays = []
    for field in schema:
        if made and field.name in made:
            arrays.append(made[field.name])
            continue
        values = columns[field.name]
        if not pa.types.is_nested(field.type):
            arrays.append(pa.array(values.reshape(-1), type=field.type))
            continue
        flat = pa.array(values.reshape(-1), type=field.type.value_type)
        if pa.types.is_fixed_size_list(field.type):
            arrays.append(pa.FixedSizeListArray.from_arrays(flat, field.type.list_size))
        else:
            edges = np.arange(0, len(flat) + 1, values.shape[1], dtype=np.int32)
            arrays.append(pa.ListArray.from_arrays(edges, flat))
    return pa.Table.from_arrays(arrays, schema=schema)
