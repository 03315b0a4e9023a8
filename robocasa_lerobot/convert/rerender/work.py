"""Rendering a dataset again in pieces, and joining them into a new dataset that appears at once."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.configs import RGBEncoderConfig
from lerobot.datasets.video_utils import get_video_info

from robocasa_lerobot import __version__, contract
from robocasa_lerobot.convert.lerobot_v3 import ExportedEpisode
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.record_files import CONVERSION_FILE, META_FOLDER
from robocasa_lerobot.convert.rerender.plan import (
    SOURCE_FORMAT,
    EpisodePictures,
    ExportedScene,
    RenderPlan,
    RenderSettings,
    make_render_plan,
)
from robocasa_lerobot.convert.scenes.prefetch import scenes_ahead
from robocasa_lerobot.convert.worker_imports import worker_imports
from robocasa_lerobot.convert.writing.card import renew_dataset_card
from robocasa_lerobot.convert.writing.encoder import (
    CODECS,
    Histogram,
    VideoSettings,
    sampled_frames,
    unit_statistics,
)
from robocasa_lerobot.convert.writing.encoding_process import shared_encoder
from robocasa_lerobot.convert.writing.files import VIDEO_FILE_MB
from robocasa_lerobot.convert.writing.modality import modality, read_modality, write_modality
from robocasa_lerobot.convert.writing.statistics import picture_statistics
from robocasa_lerobot.convert.writing.video import VideoFiles, probe
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.jobs.executors import Execution
from robocasa_lerobot.jobs.pieces import report_frames, run_pieces, submit_pieces
from robocasa_lerobot.jobs.publish import (
    check_output,
    check_outside,
    clear_away,
    failures_explained,
    go_on,
    held_folder,
    is_done,
    make_piece,
    output_path,
    partial_folder,
    publish,
)
from robocasa_lerobot.jobs.workers import check_workers, num_workers
from robocasa_lerobot.jsonl import json_text
from robocasa_lerobot.quiet import quiet_libraries

_HISTOGRAMS = "histograms.npz"
_MERGED = "merged"  # in the working folder
_MIN_FRAMES_PER_WORKER = 200
_REPORT_FRAMES = 10


@dataclass(frozen=True)
class RenderResult:
    """What was written."""

    root: Path
    num_episodes: int
    num_frames: int
    cameras: tuple[str, ...]


def render_dataset(
    source: Path,
    out: Path,
    settings: RenderSettings,
    workers: int | None = None,
    overwrite: bool = False,
    execution: Execution | None = None,
) -> RenderResult | str:
    """Write the dataset `source` with its pictures rendered again at `out`.

    Args:
        source: folder of a LeRobotDataset v3.0 with `extras` (models and states).
        out: folder of the new dataset; it appears complete or not at all.
        settings: what decides the bytes.
        workers: processes; None chooses by the amount of work. The dataset does not depend on it.
        overwrite: replace a dataset at `out`.
        execution: local (the default), Ray, or Slurm; with the last, a line for the user is given.

    Raises:
        UserError: the dataset or the output path cannot be used. Nothing is at `out` then.
    """
    check_workers(workers)
    out, execution = output_path(out), execution or Execution()
    check_output(out, overwrite)
    plan = make_render_plan(source, settings)
    check_outside(out, source)
    partial = partial_folder(out, plan.fingerprint)
    step, last = _Piece(plan, str(partial)), _LastJob(plan, str(partial), str(out), overwrite)
    if execution.kind == "slurm":
        with held_folder(partial):
            go_on(partial / _MERGED)
        return submit_pieces(step, last, len(plan.pieces), partial, out, execution)
    workers = num_workers(workers, len(plan.pieces), plan.num_frames, _MIN_FRAMES_PER_WORKER)
    with (
        held_folder(partial),
        failures_explained(out, partial),
        contextlib.closing(shared_encoder),
        contextlib.closing(scenes_ahead),
    ):
        go_on(partial / _MERGED)
        run_pieces(
            step,
            len(plan.pieces),
            partial,
            execution,
            workers,
            plan.num_frames,
            "rendering",
            quiet_libraries,
            worker_imports(__name__),
        )
        return _complete(plan, partial, out, overwrite)


@dataclass(frozen=True)
class _Piece:
    """The pipeline step that datatrove runs once for each piece: videos of some episodes."""

    plan: RenderPlan
    partial: str

    def __call__(self, data: None, rank: int = 0, world_size: int = 1) -> None:
        partial = Path(self.partial)
        quiet_libraries()
        episodes = {episode.index: episode for episode in self.plan.dataset.episodes}

        def draw(folder: Path) -> None:
            done = 0
            numbers = self.plan.pieces[rank]
            for number, then in zip(numbers, (*numbers[1:], None), strict=True):
                coming = None if then is None else ExportedScene.of(self.plan, episodes[then])
                done = _render_episode(
                    self.plan,
                    episodes[number],
                    coming,
                    folder,
                    done,
                    lambda frames: report_frames(partial, rank, frames),
                )

        make_piece(_piece_folder(partial, rank), draw)


def _render_episode(
    plan: RenderPlan,
    episode: ExportedEpisode,
    coming: ExportedScene | None,
    folder: Path,
    done: int,
    report: Callable[[int], None],
) -> int:
    settings = VideoSettings.of_codec(plan.settings.video_codec, plan.dataset.fps)
    place = _episode_folder(folder, episode.index)
    place.mkdir()
    keys = [contract.image_key(camera.name) for camera in plan.cameras]
    try:
        with shared_encoder.borrowed() as encoder, EpisodePictures(plan, episode, scenes_ahead) as pictures:
            if coming is not None:
                scenes_ahead.request(coming, plan.settings.render_preset, pictures=True)
            encoder.start_episode(settings, keys, place, episode.length, takes_colours=True)
            for step in pictures:
                for key, picture in step.items():
                    encoder.feed(key, picture)
                done += 1
                if done % _REPORT_FRAMES == 0:
                    report(done)
            encoder.end_episode()
            videos = encoder.finished()
    except (RejectedEpisodeError, UnknownNameError) as error:  # a camera that other scenes have
        raise UserError(f"episode {episode.index} of {plan.source} cannot be rendered: {error}") from None
    for key, video in videos.items():
        video.path.rename(place / f"{key}.mp4")
        video.path.parent.rmdir()
    histograms: dict[str, Any] = {key: video.histogram for key, video in videos.items()}
    np.savez_compressed(place / _HISTOGRAMS, **histograms)
    return done


@dataclass(frozen=True)
class _LastJob:
    """Joins the pieces once all are complete."""

    plan: RenderPlan
    partial: str
    out: str
    overwrite: bool

    def __call__(self) -> RenderResult:
        partial, out = Path(self.partial), Path(self.out)
        check_output(out, self.overwrite)
        missing = [rank for rank in range(len(self.plan.pieces)) if not _piece_folder(partial, rank).exists()]
        if missing:
            raise UserError(f"{len(missing)} of {len(self.plan.pieces)} pieces are not complete: submit them again.")
        quiet_libraries()
        with held_folder(partial), failures_explained(out, partial):
            if is_done(partial / _MERGED):  # this job was killed while clearing away, and has begun again
                clear_away(partial)
                return _result(self.plan, out)
            return _complete(self.plan, partial, out, self.overwrite)


def _result(plan: RenderPlan, out: Path) -> RenderResult:
    cameras = tuple(camera.name for camera in plan.cameras)
    return RenderResult(out, len(plan.dataset.episodes), plan.num_frames, cameras)


def _complete(plan: RenderPlan, partial: Path, out: Path, overwrite: bool) -> RenderResult:
    merged = partial / _MERGED
    shutil.rmtree(merged, ignore_errors=True)  # an earlier try may have been killed here
    shutil.copytree(plan.source, merged, ignore=lambda folder, _: ["videos"] if Path(folder) == plan.source else [])
    keys = [contract.image_key(camera.name) for camera in plan.cameras]
    totals: dict[str, Histogram] = {}
    columns = _place_videos(plan, partial, merged, totals)
    _replace_entries(plan, merged, columns)
    codec = RGBEncoderConfig(**CODECS[plan.settings.video_codec])
    new = {}
    for key, camera in zip(keys, plan.cameras, strict=True):
        first = merged / "videos" / key / "chunk-000" / "file-000.mp4"
        new[key] = {
            "dtype": "video",
            "shape": [camera.height, camera.width, 3],
            "names": ["height", "width", "channel"],
            "info": get_video_info(first, video_encoder=codec),
        }
    info = dict(plan.dataset.info)
    info["features"] = new | {k: v for k, v in info["features"].items() if not contract.is_picture(v)}
    info |= {
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
    }
    _write_json(merged / "meta" / "info.json", info)
    stats_file = merged / "meta" / "stats.json"
    stats = json.loads(stats_file.read_text(encoding="utf-8")) if stats_file.is_file() else {}
    stats = {key: value for key, value in stats.items() if key in info["features"] and key not in new}
    for key, histogram in totals.items():
        levels = picture_statistics(histogram, new[key]["shape"])
        stats[key] = {name: value.tolist() for name, value in levels.items()}
    _write_json(stats_file, stats)
    names = read_modality(merged) or modality(info["features"], (), ())
    write_modality(merged, names | {"video": modality(new, (), ())["video"]})
    _write_record(plan, merged, out)
    renew_dataset_card(merged)
    check_output(out, overwrite)  # somebody else's may have appeared meanwhile
    publish(merged, out, partial / "replaced")
    clear_away(partial)
    return _result(plan, out)


def _place_videos(
    plan: RenderPlan, partial: Path, merged: Path, totals: dict[str, Histogram]
) -> dict[int, dict[str, Any]]:
    """Join the videos of the episodes; gives what the entry of each episode says of its pictures."""
    keys = [contract.image_key(camera.name) for camera in plan.cameras]
    files = {key: VideoFiles(merged, key, plan.dataset.fps, VIDEO_FILE_MB * 2**20) for key in keys}
    lengths = {episode.index: episode.length for episode in plan.dataset.episodes}
    columns: dict[int, dict[str, Any]] = {}
    for rank, numbers in enumerate(plan.pieces):
        for number in numbers:
            place = _episode_folder(_piece_folder(partial, rank), number)
            entry: dict[str, Any] = {}
            with np.load(place / _HISTOGRAMS) as histograms:
                for key in keys:
                    path = place / f"{key}.mp4"
                    entry |= files[key].append(path, probe(path))
                    count = len(sampled_frames(lengths[number]))
                    for name, value in unit_statistics(histograms[key], count).items():
                        entry[f"stats/{key}/{name}"] = value.tolist()
                    totals[key] = totals.get(key, 0) + histograms[key]
            columns[number] = entry
    for file in files.values():
        file.close()
    return columns


def _replace_entries(plan: RenderPlan, merged: Path, columns: Mapping[int, Mapping[str, Any]]) -> None:
    old = [key for key, feature in plan.dataset.features.items() if contract.is_picture(feature)]
    prefixes = tuple(f"{kind}/{key}/" for key in old for kind in ("videos", "stats"))
    for file in sorted((merged / "meta" / "episodes").glob("*/*.parquet")):
        table = pq.ParquetFile(file).read()
        table = table.select([name for name in table.column_names if not name.startswith(prefixes)])
        entries = [columns[int(number)] for number in table["episode_index"].to_pylist()]
        for name in entries[0] if entries else ():
            table = table.append_column(name, pa.array([entry[name] for entry in entries]))
        pq.write_table(table, file, compression="snappy")


def _write_record(plan: RenderPlan, merged: Path, out: Path) -> None:
    folder = merged / META_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / CONVERSION_FILE
    before = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    packages = ("lerobot", "mujoco", "av", "numpy")
    record = {
        "robocasa_lerobot_version": __version__,
        "versions": {package: version(package) for package in packages},
        "source_format": SOURCE_FORMAT,
        "settings": asdict(plan.settings) | {"cam_configs": json.loads(plan.settings.cam_configs)},
        "video": CODECS[plan.settings.video_codec],
        "robot_type": plan.dataset.robot_type,
        "fps": plan.dataset.fps,
        "cameras": [asdict(camera) for camera in plan.cameras],
        "sources": before.get("sources", []),
        "source_dataset": {"folder": str(plan.source), "relative_to_dataset": os.path.relpath(plan.source, out)},
        "source_conversion": before,
    }
    _write_json(file, record)


def _write_json(file: Path, content: Any) -> None:
    file.write_text(json_text(content, indent=4) + "\n", encoding="utf-8")


def _piece_folder(partial: Path, rank: int) -> Path:
    return partial / "pieces" / f"{rank:05d}"


def _episode_folder(folder: Path, number: int) -> Path:
    return folder / f"episode_{number:06d}"
