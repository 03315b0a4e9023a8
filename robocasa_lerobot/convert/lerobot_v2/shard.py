"""One shard of a conversion from LeRobot v2: consecutive episodes, written as a small LeRobotDataset of its own.

Videos that have the target's form already are copied packet by packet, after every frame was decoded once: that shows
damage and gives the statistics. Others go through the project's encoder. Nothing of an episode is appended before all
of it was found good.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
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
from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.episode import EP_META, V2Episode
from robocasa_lerobot.convert.lerobot_v2.plan import V2Plan
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.settings import Camera, Shard
from robocasa_lerobot.convert.shard import (
    DATASET,
    EPISODES_FILE,
    EXTRAS,
    HISTOGRAMS_FILE,
    REJECTED_FILE,
    RejectedEpisode,
    ShardOutcome,
    episode_folder,
    write_jsonl,
)
from robocasa_lerobot.convert.writing.dataset import VIDEO_FILE_MB, arrow_table
from robocasa_lerobot.convert.writing.encoder import (
    CODECS,
    EncodedVideo,
    Histogram,
    VideoSettings,
    channel_histogram,
    sampled_frames,
)
from robocasa_lerobot.convert.writing.encoding_process import shared_encoder
from robocasa_lerobot.convert.writing.statistics import vector_statistics
from robocasa_lerobot.convert.writing.video import VideoFiles, VideoForm, frames, probe, rgb

_DATA_FILE = "data/chunk-000/file-000.parquet"


@dataclass(frozen=True)
class _Video:
    """A video that is ready to be appended."""

    encoded: EncodedVideo
    form: VideoForm
    reencoded: str | None  # why


def convert_v2_shard(plan: V2Plan, shard: Shard, folder: Path, progress: Callable[[int], None]) -> ShardOutcome:
    """Write the episodes of a shard into `folder`, which is emptied first (an earlier try may have been killed).

    Without a single good episode no dataset is written, only `rejected.jsonl`.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    dataset = V2Dataset(Path(shard.file))
    lines = {line.name: line for line in dataset.episodes}
    writer = _Writer(plan, folder)
    rejected: list[RejectedEpisode] = []
    done = 0
    try:
        for name in shard.demos:
            try:
                episode = V2Episode(dataset, lines[name], plan.columns, plan.tasks, plan.settings)
                writer.write(episode)
                done += episode.length
                progress(done)
            except RejectedEpisodeError as error:
                rejected.append(RejectedEpisode(shard.file, name, str(error)))
    finally:
        writer.finalize()
    write_jsonl(folder / EPISODES_FILE, writer.episodes)
    write_jsonl(folder / REJECTED_FILE, [asdict(line) for line in rejected])
    return ShardOutcome(len(writer.episodes), len(rejected))


class _Writer:
    def __init__(self, plan: V2Plan, folder: Path) -> None:
        self._plan, self._folder = plan, folder
        self._cameras = dict(plan.camera_keys)
        self._codec = RGBEncoderConfig(**CODECS[plan.settings.video_codec])
        self._meta: LeRobotDatasetMetadata | None = None
        self._tables: pq.ParquetWriter | None = None
        self._schema: pa.Schema | None = None
        self._videos: dict[str, VideoFiles] = {}
        self._histograms: dict[str, Histogram] = {}
        self.episodes: list[dict[str, Any]] = []

    def write(self, episode: V2Episode) -> None:
        """Append an episode; all or nothing of it."""
        scratch = self._folder / "scratch"
        try:
            videos = {c.name: self._video(episode, c, scratch) for c in self._plan.cameras}
            sources = {key: episode.video(key)[0] for key in self._cameras.values()}
            digest = episode.digest(sources)
            self._append(episode, videos, digest)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def finalize(self) -> None:
        """Close the files; without this the parquet files have no footer and the dataset is lost."""
        for files in self._videos.values():
            files.close()
        if self._tables is not None:
            self._tables.close()
        if self._meta is None:
            return
        for key in self._videos if self.episodes else ():
            self._describe(key)
        self._meta.finalize()
        arrays: dict[str, Any] = self._histograms
        np.savez_compressed(self._folder / HISTOGRAMS_FILE, **arrays)

    def _video(self, episode: V2Episode, camera: Camera, scratch: Path) -> _Video:
        key = self._cameras[camera.name]
        path, form = episode.video(key)
        size = (camera.height, camera.width)
        settings = self._plan.settings
        reason = "--reencode" if settings.reencode else None
        reason = reason or form.mismatch(settings.video_codec, size, self._plan.fps, settings.max_gop)
        if reason is None and form.num_packets != episode.length:
            reason = "frames outside of its playing time"
        if reason is None:
            histogram, sampled = np.zeros((3, 256), np.int64), sampled_frames(episode.length)
            count = 0
            for count, frame in enumerate(frames(path), start=1):
                if count - 1 in sampled:
                    histogram += channel_histogram(rgb(frame, size))
            episode.check_frames(key, count)
            return _Video(EncodedVideo(path, histogram, len(sampled)), form, None)
        scratch.mkdir(exist_ok=True)
        encoder = shared_encoder.started()
        settings_of_video = VideoSettings.of_codec(settings.video_codec, self._plan.fps)
        encoder.start_episode(settings_of_video, [camera.name], scratch, episode.length)
        try:
            for picture in episode.pictures(key, camera):
                encoder.feed(camera.name, picture)
        except BaseException:
            encoder.cancel_episode()
            raise
        encoder.end_episode()
        (video,) = encoder.finished().values()
        return _Video(video, probe(video.path), reason)

    def _append(self, episode: V2Episode, videos: Mapping[str, _Video], digest: str) -> None:
        meta = self._meta if self._meta is not None else self._create()
        index, length, first = len(self.episodes), episode.length, meta.total_frames
        columns: dict[str, NDArray[Any]] = {
            **episode.columns,
            "timestamp": (np.arange(length) / self._plan.fps).astype(np.float32),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, index),
            "index": np.arange(first, first + length),
            "task_index": episode.task_index,
        }
        assert self._tables is not None
        assert self._schema is not None
        self._tables.write_table(arrow_table(columns, self._schema))
        entries: dict[str, Any] = {
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": first,
            "dataset_to_index": first + length,
        }
        stats = {key: vector_statistics(values) for key, values in columns.items() if values.dtype.kind in "fiub"}
        for camera, video in videos.items():
            key = contract.image_key(camera)
            entries |= self._videos[key].append(video.encoded.path, video.form)
            stats[key] = video.encoded.statistics()
            self._histograms[key] = self._histograms.get(key, 0) + video.encoded.histogram
        texts = [self._plan.tasks[row] for row in dict.fromkeys(episode.task_index.tolist())]
        meta.save_episode(index, length, texts, stats, entries)
        self._extras(episode, self._folder / EXTRAS / episode_folder(index))
        ep_meta = episode.extras.ep_meta
        self.episodes.append(
            {
                "episode_index": index,
                "task_name": episode.task_name,
                "instruction": episode.instruction,
                "instruction_source": episode.instruction_source,
                "length": length,
                "source_file": str(episode.dataset.root),
                "source_demo": episode.name,
                "layout_id": ep_meta.get("layout_id"),
                "style_id": ep_meta.get("style_id"),
                "state_source": contract.STATE_KEY,
                "rendered_cameras": [],
                "source_sha256": digest,
                "reencoded": {camera: video.reencoded for camera, video in videos.items() if video.reencoded},
            }
        )

    def _extras(self, episode: V2Episode, folder: Path) -> None:
        folder.mkdir(parents=True)
        (folder / EP_META).write_text(json.dumps({"lang": episode.instruction}), encoding="utf-8")
        for path in episode.extras.files:
            shutil.copyfile(path, folder / path.name)

    def _create(self) -> LeRobotDatasetMetadata:
        plan = self._plan
        root = self._folder / DATASET
        features = plan.features
        self._meta = LeRobotDatasetMetadata.create(
            repo_id="local/shard",
            fps=plan.fps,
            features=features,
            robot_type=plan.mapping.robot_type,
            root=root,
            video_files_size_in_mb=VIDEO_FILE_MB,
        )
        # All rows in every shard, so that joining keeps their numbers, which annotation columns refer to.
        self._meta.save_episode_tasks(list(plan.tasks))
        self._schema = get_hf_features_from_features(self._meta.features).arrow_schema
        (root / _DATA_FILE).parent.mkdir(parents=True)
        self._tables = pq.ParquetWriter(root / _DATA_FILE, self._schema, compression="snappy")
        keys = [contract.image_key(camera.name) for camera in plan.cameras]
        self._videos = {key: VideoFiles(root, key, plan.fps, VIDEO_FILE_MB * 2**20) for key in keys}
        return self._meta

    def _describe(self, key: str) -> None:
        """LeRobot's description of a camera's videos; of the encoder only where all of them went through it."""
        assert self._meta is not None
        camera = key.removeprefix(contract.IMAGE_PREFIX)
        ours = all(camera in line["reencoded"] for line in self.episodes)
        self._meta.update_video_info(key, video_encoder=self._codec if ours else None)
        write_info(self._meta.info, self._meta.root)
