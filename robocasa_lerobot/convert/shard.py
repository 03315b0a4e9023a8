"""One shard of a conversion: consecutive demos of one file, written as a small LeRobotDataset of its own."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from isal import igzip

from robocasa_lerobot import contract
from robocasa_lerobot.convert.episode import Episode
from robocasa_lerobot.convert.reading.demo_file import DemoFile, RejectedEpisodeError
from robocasa_lerobot.convert.reading.mjcf import MissingAssetsError
from robocasa_lerobot.convert.record_files import (
    DATASET,
    EPISODES_FILE,
    EXTRAS,
    HISTOGRAMS_FILE,
    REJECTED_FILE,
    episode_folder,
)
from robocasa_lerobot.convert.scenes.demo_scene import DemoScene
from robocasa_lerobot.convert.scenes.prefetch import scenes_ahead
from robocasa_lerobot.convert.settings import Plan, Shard
from robocasa_lerobot.convert.writing.dataset import DatasetWriter
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess, shared_encoder
from robocasa_lerobot.jsonl import write_jsonl

_PROGRESS_SECONDS = 0.5


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


def convert_shard(
    plan: Plan, shard: Shard, folder: Path, progress: Callable[[int], None], then: Shard | None = None
) -> ShardOutcome:
    """Write the episodes of a shard into `folder`, which is emptied first (an earlier try may have been killed).

    `progress` is called with the number of frames done, now and then. Without a single good episode no dataset is
    written, only `rejected.jsonl`. While the last episode is written, the first scene of the shard `then` is compiled.

    Raises:
        UserError: something that concerns more than one episode, such as missing meshes.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    plan = replace(plan, mapping=shard.mapping or plan.mapping)
    rejected: list[RejectedEpisode] = []
    report = _Throttled(progress)
    with shared_encoder.borrowed() as encoder, DemoFile(Path(shard.file), plan.settings.layout) as file:
        writer = _ShardWriter(plan, folder, encoder)
        known = dict(shard.rejected)
        scenes = [*_scenes(plan, shard), *(_scenes(plan, then)[:1] if then is not None else ())]
        following = dict(pairwise(scenes))
        for name in shard.demos:
            try:
                if name in known:
                    raise RejectedEpisodeError(known[name])
                with Episode(file, name, plan, scenes_ahead) as episode:
                    coming = following.get(DemoScene.of(plan, file.path, name))
                    if coming is not None and episode.has_scene:  # what one needs its neighbour will need
                        pictures = bool(episode.rendered_cameras)
                        scenes_ahead.request(coming, plan.settings.render_preset, pictures=pictures)
                    writer.write(episode, file, report)
            except (RejectedEpisodeError, MissingAssetsError) as error:
                rejected.append(RejectedEpisode(shard.file, name, str(error)))
        writer.finalize()
    write_jsonl(folder / EPISODES_FILE, writer.episodes)
    write_jsonl(folder / REJECTED_FILE, [asdict(line) for line in rejected])
    return ShardOutcome(len(writer.episodes), len(rejected))


def _scenes(plan: Plan, shard: Shard) -> list[DemoScene]:
    """The scenes of the demos that will be opened."""
    known = dict(shard.rejected)
    return [DemoScene.of(plan, Path(shard.file), name) for name in shard.demos if name not in known]


class _ShardWriter:
    def __init__(self, plan: Plan, folder: Path, encoder: EncodingProcess) -> None:
        self._plan, self._folder, self._encoder = plan, folder, encoder
        self._dataset: DatasetWriter | None = None
        self.episodes: list[dict[str, Any]] = []

    def write(self, episode: Episode, file: DemoFile, report: _Throttled) -> None:
        if self._dataset is None:
            plan = self._plan
            self._dataset = DatasetWriter(
                self._encoder,
                self._folder / DATASET,
                plan.fps,
                plan.mapping.robot_type,
                plan.features,
                plan.settings.video_codec,
            )
        # Read the columns written last now: an episode that has been added cannot be rejected any more.
        meta, _ = episode.demo.ep_meta, episode.demo.model_xml
        task = episode.instruction.text
        columns = {contract.STATE_KEY: episode.states, contract.ACTION_KEY: episode.actions, **episode.extras}
        pictures = (
            {contract.image_key(name): picture for name, picture in step.items()} for step in episode.pictures()
        )
        rendered = bool(episode.rendered_cameras)
        self._dataset.add(columns, task, episode.length, pictures, report.advance, rendered, episode.stages)
        index = len(self.episodes)
        _write_extras(episode, self._folder / EXTRAS / episode_folder(index))
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
                **({"mimicgen": episode.provenance} if episode.provenance else {}),
            }
        )

    def finalize(self) -> None:
        """Close the files; without this the parquet files have no footer and the dataset is lost."""
        if self._dataset is None:
            return
        self._dataset.finalize()
        if self.episodes:
            histograms: dict[str, Any] = self._dataset.histograms
            np.savez_compressed(self._folder / HISTOGRAMS_FILE, **histograms)
        else:
            shutil.rmtree(self._folder / DATASET)


def _write_extras(episode: Episode, folder: Path) -> None:
    """What replaying and rendering the episode again needs, under RoboCasa's names."""
    folder.mkdir(parents=True)
    demo = episode.demo
    (folder / "ep_meta.json").write_text(json.dumps(demo.ep_meta), encoding="utf-8")
    if demo.model_xml is not None:
        # No time stamp, so that the same input gives the same bytes. ISA-L takes 2 ms instead of 30.
        (folder / "model.xml.gz").write_bytes(igzip.compress(demo.model_xml.encode(), mtime=0))
    if episode.simulator_states is not None:
        np.savez_compressed(folder / "states.npz", states=episode.simulator_states)


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
