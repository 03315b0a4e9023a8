"""The comparison of a converted dataset with its sources, check by check."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.episode import Episode
from robocasa_lerobot.convert.mapping.robot_mapping import EXTRA_PREFIX, RobotMapping
from robocasa_lerobot.convert.mapping.robots import choose_mapping
from robocasa_lerobot.convert.reading.demo_file import DemoFile, RejectedEpisodeError
from robocasa_lerobot.convert.reading.stages import StageTrack
from robocasa_lerobot.convert.record_files import META_FOLDER, REJECTED_FILE
from robocasa_lerobot.convert.report import CameraQuality, Check, Report
from robocasa_lerobot.convert.settings import Camera, ConversionSettings, Plan, file_sha256
from robocasa_lerobot.convert.writing.stages import active_texts, read_subtasks
from robocasa_lerobot.convert.writing.statistics import column_of
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl
from robocasa_lerobot.progress import Bar

_CHECKS = (
    "source files",
    "episodes",
    "frames",
    "video frames",
    "actions",
    "states",
    "instructions",
    "timestamps",
    "pictures",
)

_COLUMNS = (
    contract.ACTION_KEY,
    contract.STATE_KEY,
    "timestamp",
    "frame_index",
    "episode_index",
    "index",
    "task_index",
)
_EXTRAS, _STAGES = "extra columns", "stages"  # checks of datasets that have such
_PEAK = 255.0
# A picture counts as misplaced where another step's true picture fits it better by this factor in squared error.
_MISPLACED_FACTOR = 1.5


@dataclass(frozen=True)
class Source:
    """A source file or dataset: as the conversion recorded it, where it is now, and its recorded SHA-256."""

    recorded: str
    path: Path
    sha256: str


class Verification:
    """The comparison of a dataset with its sources: any of `check_*`, then `report`."""

    def __init__(
        self,
        root: Path,
        dataset: LeRobotDataset,
        episodes: list[dict[str, Any]],
        record: dict[str, Any],
        pictures_per_episode: int | None,
        min_psnr_db: float,
    ) -> None:
        self._root, self._dataset, self._episodes, self._record = root, dataset, episodes, record
        self._pictures_per_episode, self._min_psnr_db = pictures_per_episode, min_psnr_db
        self._checks = {name: Check(name) for name in _CHECKS}
        self._quality = {camera["name"]: CameraQuality(camera["name"]) for camera in record["cameras"]}
        # The dataset as LeRobot opened it, without the conversion to float32 that its items go through.
        extras = [key for key in dataset.meta.features if key.startswith(EXTRA_PREFIX)]
        if extras:
            self._checks[_EXTRAS] = Check(_EXTRAS)
        self._has_stages = all(key in dataset.meta.features for key in contract.STAGE_KEYS)
        if self._has_stages:
            self._checks[_STAGES] = Check(_STAGES)
        stages = [contract.STAGE_KEY, contract.SUBTASK_KEY] if self._has_stages else []
        self._subtasks = read_subtasks(root) if self._has_stages else []
        keys = [*_COLUMNS, *extras, *stages]
        table = dataset.hf_dataset.select_columns(keys).with_format("arrow")[:]
        self._columns: dict[str, NDArray[Any]] = {key: column_of(table, key) for key in keys}
        self._tasks = {int(row.task_index): str(task) for task, row in dataset.meta.tasks.iterrows()}

    @property
    def num_episodes(self) -> int:
        """Episodes that the conversion wrote."""
        return len(self._episodes)

    def report(self) -> Report:
        """What was found so far."""
        return Report(
            str(self._root),
            self._dataset.num_episodes,
            self._dataset.num_frames,
            list(self._checks.values()),
            list(self._quality.values()),
        )

    def check_structure(self) -> None:
        """Counts and running indices of the dataset in itself."""
        lengths = [line["length"] for line in self._episodes]
        check = self._checks["episodes"]
        check.expect(
            self._dataset.num_episodes == len(lengths),
            f"LeRobot opens {self._dataset.num_episodes} episodes, {len(lengths)} were written",
        )
        check = self._checks["frames"]
        total = sum(lengths)
        rows = len(self._columns["index"])
        check.expect(self._dataset.num_frames == total, f"info.json has {self._dataset.num_frames} frames, not {total}")
        check.expect(rows == total, f"the tables have {rows} rows, not {total}")
        expected = {
            "index": np.arange(total),
            "episode_index": np.repeat(np.arange(len(lengths)), lengths),
            "frame_index": np.concatenate([np.arange(length) for length in lengths]),
        }
        for key, values in expected.items():
            check.expect(np.array_equal(self._columns[key], values), f"column {key} does not count through")
        for index, line in enumerate(self._episodes):
            length = int(self._dataset.meta.episodes[index]["length"]) if index < self._dataset.num_episodes else -1
            check.expect(length == line["length"], f"episode {index}: {length} frames, {line['length']} were written")

    def check_videos(self) -> None:
        """As many frames in the video files as in the tables, for every camera: none dropped anywhere."""
        check = self._checks["video frames"]
        for camera in self._quality:
            key = contract.image_key(camera)
            count = sum(num_video_frames(file) for file in (self._root / "videos" / key).glob("*/*.mp4"))
            total = self._dataset.num_frames
            check.expect(count == total, f"{camera}: {count} frames in the videos, {total} in the tables")

    def check_source(self, source: Source, settings: ConversionSettings) -> None:
        """That a source file is the one that was converted, and none of its demos is unaccounted for."""
        path = source.path
        self._checks["source files"].expect(
            file_sha256(path) == source.sha256, f"{path} has changed since the conversion (its SHA-256 is another)"
        )
        written, out = {line["source_demo"] for line in self._written(source)}, self._rejected(source)
        with DemoFile(path, settings.layout) as file:
            for name in settings.select(file):
                self._checks["episodes"].expect(
                    (name in written) != (name in out), f"{path} {name} is neither converted nor rejected, or both"
                )

    def check_episodes(self, source: Source, settings: ConversionSettings, part: range, bar: Bar | None) -> None:
        """Those episodes of a source file whose index is in `part`."""
        mine = [line for line in self._written(source) if line["episode_index"] in part]
        if not mine:
            return
        with DemoFile(source.path, settings.layout) as file:
            plan = _plan(file, mine, settings, self._record, self._has_stages)
            for line in mine:
                try:
                    with Episode(file, line["source_demo"], plan) as episode:
                        self._check_episode(line, episode)
                except RejectedEpisodeError as error:
                    self._checks["episodes"].fail(f"{source.path} {line['source_demo']}: {error}")
                if bar is not None:
                    bar.update()

    def _written(self, source: Source) -> list[dict[str, Any]]:
        return [line for line in self._episodes if line["source_file"] == source.recorded]

    def _rejected(self, source: Source) -> set[str]:
        rejected = read_jsonl(self._root / META_FOLDER / REJECTED_FILE)
        return {line["source_demo"] for line in rejected if line["source_file"] == source.recorded}

    def _check_episode(self, line: dict[str, Any], episode: Episode) -> None:
        index, length = line["episode_index"], episode.length
        where = self._columns["episode_index"] == index
        label = f"episode {index} ({line['source_demo']})"
        rows = np.flatnonzero(where)
        self._checks["frames"].expect(len(rows) == length, f"{label}: {len(rows)} rows, {length} in the source")
        for name, key, expected in (
            ("actions", contract.ACTION_KEY, episode.actions),
            ("states", contract.STATE_KEY, episode.states),
            *((_EXTRAS, key, values) for key, values in episode.extras.items()),
        ):
            compare_bits(self._checks[name], label, self._columns[key][where].reshape(-1, expected.shape[1]), expected)
        timestamps = self._columns["timestamp"][where]
        exact = (np.arange(length) / self._dataset.fps).astype(np.float32)
        compare_bits(self._checks["timestamps"], label, timestamps, exact)
        tasks = {self._tasks.get(int(task)) for task in np.unique(self._columns["task_index"][where])}
        self._checks["instructions"].expect(
            tasks == {episode.instruction.text} and line["instruction"] == episode.instruction.text,
            f"{label}: {sorted(map(str, tasks))}, the source has {episode.instruction.text!r}",
        )
        if episode.stages is not None and len(rows) == length:
            self._check_stages(label, episode.stages, rows)
        if len(rows) == length:
            self.check_pictures(label, int(rows[0]), length, episode.pictures_at)

    def _check_stages(self, label: str, stages: StageTrack, rows: NDArray[np.intp]) -> None:
        """The stage of each step, and its text by the table of subtasks and in LeRobot's language column."""
        check = self._checks[_STAGES]
        compare_bits(check, label, self._columns[contract.STAGE_KEY][rows], stages.index)
        true = [stages.texts[stage] for stage in stages.index]
        known = dict(enumerate(self._subtasks))
        listed = [known.get(int(row)) for row in self._columns[contract.SUBTASK_KEY][rows]]
        check.expect(listed == true, f"{label}: its rows of the table of subtasks are not its stages")
        column = self._dataset.hf_dataset.with_format(None)[int(rows[0]) : int(rows[-1]) + 1][contract.LANGUAGE_KEY]
        said = active_texts(column, self._columns["timestamp"][rows])
        check.expect(said == true, f"{label}: {contract.LANGUAGE_KEY} does not have its stages")

    def check_pictures(
        self, label: str, first_row: int, length: int, pictures_at: Callable[[int], dict[str, NDArray[np.uint8]]]
    ) -> None:
        """Each decoded picture resembles its true one, and no other step's true picture fits it better."""
        check = self._checks["pictures"]
        steps = spread(length, self._pictures_per_episode)
        true: dict[str, list[NDArray[np.uint8]]] = {camera: [] for camera in self._quality}
        decoded: dict[str, list[NDArray[np.uint8]]] = {camera: [] for camera in self._quality}
        for step in steps:
            try:
                item = self._dataset[first_row + step]
            except Exception as error:  # whatever a decoder throws at a broken video
                check.expect(False, f"{label} step {step}: LeRobot cannot read it: {type(error).__name__}: {error}")
                return
            for camera, picture in pictures_at(step).items():
                true[camera].append(picture)
                decoded[camera].append(item[contract.image_key(camera)].permute(1, 2, 0).numpy())
        for camera, quality in self._quality.items():
            for own, step in enumerate(steps):
                errors = [_squared_error(decoded[camera][own], picture) for picture in true[camera]]
                psnr = psnr_db(decoded[camera][own], true[camera][own])
                quality.psnr_db.append(psnr)
                check.expect(
                    psnr >= self._min_psnr_db,
                    f"{label} step {step} {camera}: PSNR {psnr:.1f} dB, at least {self._min_psnr_db:g} needed",
                )
                best = int(np.argmin(errors))
                check.expect(
                    errors[own] <= _MISPLACED_FACTOR * errors[best],
                    f"{label} step {step} {camera}: shows the picture of step {steps[best]}",
                )


def compare_bits(check: Check, label: str, found: NDArray[Any], expected: NDArray[Any]) -> None:
    """Count the values whose bit patterns differ between two arrays with the same first axis, the steps."""
    check.compared += expected.size
    if found.shape != expected.shape or found.dtype != expected.dtype:
        check.fail(f"{label}: {found.shape} {found.dtype}, the source has {expected.shape} {expected.dtype}")
        return
    # Bit patterns, so that -0.0 and 0.0 are told apart.
    bits = np.dtype(f"u{expected.dtype.itemsize}")
    different = np.argwhere(np.ascontiguousarray(found).view(bits) != np.ascontiguousarray(expected).view(bits))
    for where in different:
        at = tuple(int(i) for i in where)
        check.fail(f"{label} step {at[0]} component {at[1:]}: {found[at]!r}, the source has {expected[at]!r}")


def spread(length: int, count: int | None) -> list[int]:
    """`count` evenly spaced steps of an episode, or all of them."""
    if count is None or count >= length:
        return list(range(length))
    return sorted({int(step) for step in np.linspace(0, length - 1, count).round()})


def _squared_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    difference = a.astype(np.int32) - b
    return float(np.mean(difference * difference))


def psnr_db(found: NDArray[np.uint8], true: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of a picture in dB, infinite where it is equal."""
    error = _squared_error(found, true)
    return float(10 * np.log10(_PEAK**2 / error)) if error > 0 else float("inf")


def num_video_frames(file: Path) -> int:
    """How many frames a video file holds, without decoding them."""
    with av.open(str(file)) as container:
        return sum(1 for packet in container.demux(video=0) if packet.size)


def _plan(
    file: DemoFile, lines: list[dict[str, Any]], settings: ConversionSettings, record: dict[str, Any], stages: bool
) -> Plan:
    return Plan(
        settings=settings,
        sources=(),
        mapping=_mapping(file, [line["source_demo"] for line in lines]),
        cameras=tuple(Camera(**camera) for camera in record["cameras"]),
        fps=record["fps"],
        shards=(),
        num_frames=0,
        stages=stages,
    )


def _mapping(file: DemoFile, names: Sequence[str]) -> RobotMapping:
    """By the first demo that shows the robot: one with a broken scene can be converted, but not judged by."""
    failure: RejectedEpisodeError | None = None
    for name in names:
        try:
            return choose_mapping(file, file.demo(name))
        except RejectedEpisodeError as error:
            failure = failure or error
    raise UserError(f"{file.path} shows no robot any more: {failure}")
