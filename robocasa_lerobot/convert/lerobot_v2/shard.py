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

from robocasa_lerobot import contract
from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.episode import EP_META, V2Episode
from robocasa_lerobot.convert.lerobot_v2.plan import V2Plan
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.record_files import (
    DATASET,
    EPISODES_FILE,
    EXTRAS,
    HISTOGRAMS_FILE,
    REJECTED_FILE,
    episode_folder,
)
from robocasa_lerobot.convert.settings import Camera, Shard
from robocasa_lerobot.convert.shard import RejectedEpisode, ShardOutcome
from robocasa_lerobot.convert.writing.encoder import (
    EncodedVideo,
    VideoSettings,
    channel_histogram,
    sampled_frames,
)
from robocasa_lerobot.convert.writing.encoding_process import shared_encoder
from robocasa_lerobot.convert.writing.files import DatasetFiles
from robocasa_lerobot.convert.writing.video import VideoForm, frames, probe, rgb
from robocasa_lerobot.jsonl import write_jsonl


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
        self._files: DatasetFiles | None = None
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
        if self._files is None:
            return
        codecs: dict[str, str | None] = {}
        for camera in self._plan.cameras:  # LeRobot's description of the encoder holds where all went through it
            ours = all(camera.name in line["reencoded"] for line in self.episodes)
            codecs[contract.image_key(camera.name)] = self._plan.settings.video_codec if ours else None
        self._files.finalize(codecs)
        arrays: dict[str, Any] = self._files.histograms
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
        plan, index, length = self._plan, len(self.episodes), episode.length
        if self._files is None:
            # All tasks in every shard, so that joining keeps their numbers, which annotation columns refer to.
            root = self._folder / DATASET
            self._files = DatasetFiles(root, plan.fps, plan.mapping.robot_type, plan.features, plan.tasks)
        texts = [plan.tasks[row] for row in dict.fromkeys(episode.task_index.tolist())]
        keys = {camera: contract.image_key(camera) for camera in videos}
        self._files.append(
            {**episode.columns, "task_index": episode.task_index},
            texts,
            length,
            {keys[camera]: video.encoded for camera, video in videos.items()},
            {keys[camera]: video.form for camera, video in videos.items()},
        )
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
