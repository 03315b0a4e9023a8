"""One shard of a conversion: consecutive demos of one file, written as a small LeRobotDataset of its own."""

from __future__ import annotations

import gzip
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lerobot.configs import RGBEncoderConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.convert.encoder import SamplingVideoEncoder
from robocasa_lerobot.convert.episode import Episode
from robocasa_lerobot.convert.settings import Plan, Shard
from robocasa_lerobot.convert.source import DemoFile, RejectedEpisodeError

# Constant rate factor and preset for each codec. Keyframes every 2 frames, as LeRobot has it: random access decodes
# at most one frame more than asked for. No B-frames: with them the decoding times of short episodes overlap where
# LeRobot joins video files, and it fails.
CODECS: dict[str, dict[str, Any]] = {
    "h264": {"vcodec": "h264", "crf": 18, "preset": "veryfast", "g": 2, "extra_options": {"bf": 0}},
    "hevc": {"vcodec": "hevc", "crf": 20, "preset": "veryfast", "g": 2, "extra_options": {"bf": 0}},
    "av1": {"vcodec": "libsvtav1", "crf": 30, "preset": 12, "g": 2},
}
# Appending an episode rewrites the video file of its camera, so files stay small; also the time to open one.
VIDEO_FILE_MB = 50
_ENCODER_THREADS = 1  # several frames at a time would make the bytes depend on timing and the processes fight for cores
_PROGRESS_SECONDS = 0.5

DATASET, EXTRAS = "dataset", "extras"
EPISODES_FILE, REJECTED_FILE, HISTOGRAMS_FILE = "episodes.jsonl", "rejected.jsonl", "histograms.npz"


class _ConversionDataset(LeRobotDataset):
    """LeRobotDataset whose writer gets this project's encoder, through the method LeRobot makes its own with."""

    @staticmethod
    def _build_streaming_encoder(
        fps: int, rgb_encoder: Any, depth_encoder: Any, encoder_queue_maxsize: int, encoder_threads: int | None
    ) -> Any:
        options = rgb_encoder.get_codec_options(encoder_threads, as_strings=True)
        return SamplingVideoEncoder(fps, rgb_encoder.vcodec, rgb_encoder.pix_fmt, options)


class ShardOutcome(NamedTuple):
    """How many episodes of a shard were written and rejected."""

    num_written: int
    num_rejected: int


@dataclass(frozen=True)
class RejectedEpisode:
    """Line of `rejected.jsonl`."""

    source_file: str
    source_demo: str
    reason: str


def convert_shard(plan: Plan, shard: Shard, folder: Path, progress: Callable[[int], None]) -> ShardOutcome:
    """Write the episodes of a shard into `folder`, which is emptied first (an earlier try may have been killed).

    `progress` is called with the number of frames done, now and then. Without a single good episode no dataset is
    written, only `rejected.jsonl`.

    Raises:
        UserError: something that concerns more than one episode, such as missing meshes.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    writer = _ShardWriter(plan, folder)
    rejected: list[RejectedEpisode] = []
    report = _Throttled(progress)
    try:
        with DemoFile(Path(shard.file)) as file:
            for name in shard.demos:
                try:
                    with Episode(file, name, plan) as episode:
                        writer.write(episode, file, report)
                except RejectedEpisodeError as error:
                    writer.discard()
                    rejected.append(RejectedEpisode(shard.file, name, str(error)))
    finally:
        writer.finalize()
    write_jsonl(folder / EPISODES_FILE, writer.episodes)
    write_jsonl(folder / REJECTED_FILE, [asdict(line) for line in rejected])
    return ShardOutcome(len(writer.episodes), len(rejected))


class _ShardWriter:
    def __init__(self, plan: Plan, folder: Path) -> None:
        self._plan, self._folder = plan, folder
        self._dataset: _ConversionDataset | None = None
        self.episodes: list[dict[str, Any]] = []

    def write(self, episode: Episode, file: DemoFile, report: _Throttled) -> None:
        # Not `or`: a dataset without episodes is false.
        dataset = self._dataset if self._dataset is not None else self._create()
        encoder = dataset.writer._streaming_encoder
        encoder.episode_length = episode.length
        task = episode.instruction.text
        for step, pictures in enumerate(episode.pictures()):
            frame: dict[str, Any] = {contract.image_key(name): picture for name, picture in pictures.items()}
            frame[contract.STATE_KEY] = episode.states[step]
            frame[contract.ACTION_KEY] = episode.actions[step]
            frame[contract.TASK_KEY] = task
            dataset.add_frame(frame)
            report.advance(1)
        dataset.save_episode()
        index = len(self.episodes)
        assert dataset.meta.total_episodes == index + 1
        assert dataset.meta.total_frames == sum(line["length"] for line in self.episodes) + episode.length
        _write_extras(episode, self._folder / EXTRAS / episode_folder(index))
        meta = episode.demo.ep_meta
        self.episodes.append(
            {
                "episode_index": index,
                "task_name": file.env_name,
                "instruction": task,
                "instruction_source": episode.instruction.source,
                "length": episode.length,
                "source_file": str(file.path),
                "source_demo": episode.demo.name,
                "layout_id": meta.get("layout_id"),
                "style_id": meta.get("style_id"),
                "state_source": episode.state_source,
                "rendered_cameras": list(episode.rendered_cameras),
            }
        )

    def discard(self) -> None:
        if self._dataset is not None:
            self._dataset.clear_episode_buffer()

    def finalize(self) -> None:
        """Close the files; without this the parquet files have no footer and the dataset is lost."""
        if self._dataset is None:
            return
        self._dataset.finalize()
        if self.episodes:
            histograms = self._dataset.writer._streaming_encoder.histograms
            np.savez_compressed(self._folder / HISTOGRAMS_FILE, **histograms)
        else:
            shutil.rmtree(self._folder / DATASET)

    def _create(self) -> _ConversionDataset:
        plan = self._plan
        self._dataset = _ConversionDataset.create(
            repo_id="local/shard",
            root=self._folder / DATASET,
            fps=plan.fps,
            robot_type=plan.mapping.robot_type,
            features=plan.features,
            streaming_encoding=True,
            video_backend="pyav",
            rgb_encoder=RGBEncoderConfig(**CODECS[plan.settings.video_codec]),
            encoder_threads=_ENCODER_THREADS,
            video_files_size_in_mb=VIDEO_FILE_MB,
        )
        return self._dataset


def episode_folder(index: int) -> str:
    """Name of an episode's folder under `extras`, as in RoboCasa's datasets."""
    return f"episode_{index:06d}"


def _write_extras(episode: Episode, folder: Path) -> None:
    """What replaying and rendering the episode again needs, under RoboCasa's names."""
    folder.mkdir(parents=True)
    demo = episode.demo
    (folder / "ep_meta.json").write_text(json.dumps(demo.ep_meta), encoding="utf-8")
    if demo.model_xml is not None:
        # No time stamp inside, so that the same input gives the same bytes.
        (folder / "model.xml.gz").write_bytes(gzip.compress(demo.model_xml.encode(), mtime=0))
    if episode.simulator_states is not None:
        np.savez_compressed(folder / "states.npz", states=episode.simulator_states)


def write_jsonl(path: Path, lines: list[dict[str, Any]]) -> None:
    """Write one JSON object on each line."""
    path.write_text("".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines), encoding="utf-8")


def read_jsonl(path: Path) -> list[dict[str, Any]]:
    """The JSON objects of a file with one on each line."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]


class _Throttled:
    """Counts frames and reports the count at most every half second."""

    def __init__(self, report: Callable[[int], None]) -> None:
        self._report, self._count, self._last = report, 0, 0.0

    def advance(self, frames: int) -> None:
        self._count += frames
        now = time.monotonic()
        if now - self._last >= _PROGRESS_SECONDS:
            self._report(self._count)
            self._last = now
