"""A LeRobotDataset v3.0 written episode by episode: columns into parquet, pictures straight into the video encoder.

LeRobot's own writer spends as long on an episode's table as the encoder does on its pictures, and rewrites the whole
video file for every episode it appends (measured with LeRobot 0.6.1); its metadata writer is used as it is.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
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

from robocasa_lerobot.convert.writing.encoder import CODECS, EncodedVideo, EncodingError, Histogram, VideoSettings
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess
from robocasa_lerobot.convert.writing.statistics import vector_statistics
from robocasa_lerobot.convert.writing.video import VideoFiles, probe

# Also the time to open one file, and what is lost with it.
VIDEO_FILE_MB = 100
_DATA_FILE = "data/chunk-000/file-000.parquet"


@dataclass(frozen=True)
class _Pending:
    """An episode whose pictures are on their way through the encoder."""

    columns: Mapping[str, NDArray[Any]]
    task: str
    length: int
    scratch: Path


class DatasetWriter:
    """A dataset of one data file; `finalize` completes it.

    Args:
        encoder: the process that encodes the pictures, to be used by nobody else meanwhile.
        root: folder of the dataset, which must not exist.
        fps: frames per second.
        robot_type: name of the robot.
        features: LeRobot's, without those that every dataset has (time, indices).
        codec: key of `CODECS`.
    """

    def __init__(
        self, encoder: EncodingProcess, root: Path, fps: int, robot_type: str, features: Mapping[str, Any], codec: str
    ) -> None:
        self.root, self.num_episodes, self.num_frames = root, 0, 0
        self._fps = fps
        self._video = RGBEncoderConfig(**CODECS[codec])
        self._meta = LeRobotDatasetMetadata.create(
            repo_id="local/shard",
            fps=fps,
            features=dict(features),
            robot_type=robot_type,
            root=root,
            video_files_size_in_mb=VIDEO_FILE_MB,
        )
        self._encoder, self._settings = encoder, VideoSettings.of_codec(codec, fps)
        self._pending: _Pending | None = None
        self._number = 0  # of episodes begun
        self.histograms: dict[str, Histogram] = {}  # sampled pixels of all episodes so far for each video feature
        self._schema = get_hf_features_from_features(self._meta.features).arrow_schema
        (root / _DATA_FILE).parent.mkdir(parents=True)
        self._tables = pq.ParquetWriter(root / _DATA_FILE, self._schema, compression="snappy")
        self._videos = {key: VideoFiles(root, key, fps, VIDEO_FILE_MB * 2**20) for key in self._meta.video_keys}

    def add(
        self,
        columns: Mapping[str, NDArray[Any]],
        task: str,
        length: int,
        pictures: Iterable[Mapping[str, NDArray[np.uint8]]],
        progress: Callable[[int], None] = lambda _: None,
        rendered: bool = False,
    ) -> None:
        """Append an episode of `length` steps.

        Args:
            columns: each feature but videos and indices, (T,) or (T, k), with the feature's dtype.
            task: the instruction.
            length: number of steps T.
            pictures: for each step, the picture (H, W, 3) of each video feature.
            progress: called with 1 after each step.
            rendered: pictures are being rendered, which takes longer than encoding them.

        Raises:
            EncodingError: there are not T pictures; or the videos of the episode before could not be encoded, which
                nothing more can be added after.
            Exception: whatever `pictures` raises. Nothing of the episode is in the dataset then.
        """
        self._number += 1
        scratch = self.root / "encoding" / str(self._number)
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True)
        self._encoder.start_episode(self._settings, self._meta.video_keys, scratch, length, yielding=rendered)
        given = 0
        try:
            for step in pictures:
                for key, picture in step.items():
                    self._encoder.feed(key, picture)
                given += 1
                progress(1)
            if given != length:
                raise EncodingError(f"{length} frames expected, {given} given.")
        except BaseException:
            self._encoder.cancel_episode()
            raise
        self._encoder.end_episode()
        # While this episode's last pictures are encoded, the one before is written.
        before, self._pending = self._pending, _Pending(columns, task, length, scratch)
        self._complete(before)

    def finalize(self) -> None:
        """Complete the files; without this they have no footers and the dataset is lost."""
        last, self._pending = self._pending, None
        self._complete(last)
        shutil.rmtree(self.root / "encoding", ignore_errors=True)
        self._tables.close()
        for videos in self._videos.values():
            videos.close()
        self._meta.finalize()
        if self.num_episodes:
            for key in self._videos:
                self._meta.update_video_info(key, video_encoder=self._video)
            write_info(self._meta.info, self.root)

    def _complete(self, pending: _Pending | None) -> None:
        if pending is not None:
            self._append(pending.columns, pending.task, pending.length, self._encoder.finished())
            shutil.rmtree(pending.scratch)

    def _append(
        self, columns: Mapping[str, NDArray[Any]], task: str, length: int, encoded: Mapping[str, EncodedVideo]
    ) -> None:
        index, first = self.num_episodes, self.num_frames
        self._meta.save_episode_tasks([task])
        everything: dict[str, NDArray[Any]] = {
            **columns,
            "timestamp": (np.arange(length) / self._fps).astype(np.float32),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, index),
            "index": np.arange(first, first + length),
            "task_index": np.full(length, self._meta.get_task_index(task)),
        }
        self._tables.write_table(arrow_table(everything, self._schema))
        entries: dict[str, Any] = {
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": first,
            "dataset_to_index": first + length,
        }
        statistics = {
            key: vector_statistics(values) for key, values in everything.items() if values.dtype.kind in "fiub"
        }
        for key, video in encoded.items():
            entries |= self._videos[key].append(video.path, probe(video.path))
            statistics[key] = video.statistics()
            self.histograms[key] = self.histograms.get(key, 0) + video.histogram
        self._meta.save_episode(index, length, [task], statistics, entries)
        self.num_episodes, self.num_frames = index + 1, first + length


def arrow_table(columns: Mapping[str, NDArray[Any]], schema: pa.Schema) -> pa.Table:
    """Columns (T,) or (T, k) as an Arrow table with the fields of `schema`, bit for bit."""
    arrays = []
    for field in schema:
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
