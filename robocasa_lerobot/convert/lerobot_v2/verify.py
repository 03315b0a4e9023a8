"""A dataset made from LeRobot v2 compared with its source: columns bit for bit, copied frames sample by sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.lerobot_v2.dataset import EXTRAS, V2Dataset
from robocasa_lerobot.convert.lerobot_v2.episode import Column, V2Episode
from robocasa_lerobot.convert.lerobot_v2.plan import Look, look_into, source_record
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.record_files import episode_folder
from robocasa_lerobot.convert.report import Check
from robocasa_lerobot.convert.settings import Camera, ConversionSettings
from robocasa_lerobot.convert.verification import Source, Verification, compare_bits, spread
from robocasa_lerobot.convert.writing.statistics import column_of
from robocasa_lerobot.convert.writing.video import digests
from robocasa_lerobot.progress import Bar

_MORE_CHECKS = ("other columns", "extras", "copied frames")


class V2Verification(Verification):
    """The comparison for sources in LeRobot v2."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._checks |= {name: Check(name) for name in _MORE_CHECKS}
        self._looks: dict[Path, Look] = {}
        self._cameras = {camera["name"]: Camera(**camera) for camera in self._record["cameras"]}

    def check_source(self, source: Source, settings: ConversionSettings) -> None:
        """That a source dataset is the one that was converted, and none of its episodes is unaccounted for."""
        path, look = source.path, self._look(source, settings)
        self._checks["source files"].expect(
            source_record(look.dataset).sha256 == source.sha256,
            f"{path} has changed since the conversion (its SHA-256 is another)",
        )
        written, out = {line["source_demo"] for line in self._written(source)}, self._rejected(source)
        lost = self._lost_tasks(look.dataset)
        self._checks["instructions"].expect(not lost, f"rows of {path}'s tasks are missing: {lost[:3]}")
        for line in look.episodes:
            self._checks["episodes"].expect(
                (line.name in written) != (line.name in out),
                f"{path} {line.name} is neither converted nor rejected, or both",
            )

    def check_episodes(self, source: Source, settings: ConversionSettings, part: range, bar: Bar | None) -> None:
        """Those episodes of a source dataset whose index is in `part`."""
        mine = {line["source_demo"]: line for line in self._written(source) if line["episode_index"] in part}
        look = self._look(source, settings) if mine else None
        if look is None or self._lost_tasks(look.dataset):
            return
        tasks = tuple(self._tasks[row] for row in sorted(self._tasks))
        for line in look.episodes:
            if line.name not in mine:
                continue
            try:
                episode = V2Episode(look.dataset, line, look.columns, tasks, settings)
                self._check_v2_episode(mine[line.name], episode, look.columns, dict(look.camera_keys))
            except RejectedEpisodeError as error:
                self._checks["episodes"].fail(f"{source.path} {line.name}: {error}")
            if bar is not None:
                bar.update()

    def _look(self, source: Source, settings: ConversionSettings) -> Look:
        """What a source dataset holds, looked into once."""
        if source.path not in self._looks:
            self._looks[source.path] = look_into(V2Dataset(source.path), settings)
        return self._looks[source.path]

    def _lost_tasks(self, dataset: V2Dataset) -> list[str]:
        """The source's instructions that are no row of the dataset's table of them."""
        return [text for text in dataset.tasks.values() if text not in self._tasks.values()]

    def _check_v2_episode(
        self, line: dict[str, Any], episode: V2Episode, columns: tuple[Column, ...], keys: dict[str, str]
    ) -> None:
        index, length = line["episode_index"], episode.length
        rows = np.flatnonzero(self._columns["episode_index"] == index)
        label = f"episode {index} ({episode.name})"
        videos = {key: episode.video(key)[0] for key in keys.values()}
        self._checks["source files"].expect(
            episode.digest(videos) == line["source_sha256"], f"{label}: its source files have changed"
        )
        self._checks["frames"].expect(len(rows) == length, f"{label}: {len(rows)} rows, {length} in the source")
        if len(rows) != length:
            return
        named = {contract.ACTION_KEY: "actions", contract.STATE_KEY: "states"}
        table = self._dataset.hf_dataset.select_columns([c.name for c in columns]).with_format("arrow")
        part = table[int(rows[0]) : int(rows[-1]) + 1]
        for column in columns:
            check = self._checks[named.get(column.name, "other columns")]
            compare_bits(check, f"{label} {column.name}", column_of(part, column.name), episode.columns[column.name])
        exact = (np.arange(length) / self._dataset.fps).astype(np.float32)
        compare_bits(self._checks["timestamps"], label, self._columns["timestamp"][rows], exact)
        self._check_instructions(label, line, episode, rows)
        folder = self._root / EXTRAS / episode_folder(index)
        for file in episode.extras.files:
            kept = folder / file.name
            same = kept.is_file() and kept.read_bytes() == file.read_bytes()
            self._checks["extras"].expect(same, f"{label}: {file.name} is not that of the source")
        self._check_copied(label, line, episode, keys)
        pictures = self._sample(episode, keys)
        self.check_pictures(label, int(rows[0]), length, pictures.__getitem__)

    def _check_instructions(self, label: str, line: dict[str, Any], episode: V2Episode, rows: NDArray[np.intp]) -> None:
        check = self._checks["instructions"]
        found = [self._tasks.get(int(row)) for row in self._columns["task_index"][rows]]
        tasks = [self._tasks[int(row)] for row in episode.task_index]
        check.expect(found == tasks, f"{label}: {sorted(set(map(str, found)))}, the source has {sorted(set(tasks))}")
        check.expect(line["instruction"] == tasks[0], f"{label}: recorded as {line['instruction']!r}")
        listed = self._dataset.meta.episodes[line["episode_index"]]["tasks"]
        check.expect(set(listed) == set(tasks), f"{label}: listed as {listed}")

    def _check_copied(self, label: str, line: dict[str, Any], episode: V2Episode, keys: dict[str, str]) -> None:
        """Every frame of a video that was not encoded again, in order."""
        check = self._checks["copied frames"]
        for camera, key in keys.items():
            if camera in line["reencoded"]:
                continue
            meta, index, feature = self._dataset.meta, line["episode_index"], contract.image_key(camera)
            file = self._root / meta.get_video_file_path(index, feature)
            start = meta.episodes[index][f"videos/{feature}/from_timestamp"]
            true = digests(episode.video(key)[0])
            try:
                found = digests(file, start, len(true))
            except Exception as error:  # whatever a decoder throws at a broken video
                check.fail(f"{label} {camera}: {type(error).__name__}: {error}")
                continue
            check.expect(len(found) == len(true), f"{label} {camera}: {len(found)} frames, {len(true)} in the source")
            for step, (ours, theirs) in enumerate(zip(found, true, strict=False)):
                check.expect(ours == theirs, f"{label} {camera} step {step}: another picture than in the source")

    def _sample(self, episode: V2Episode, keys: dict[str, str]) -> dict[int, dict[str, NDArray[np.uint8]]]:
        steps = set(spread(episode.length, self._pictures_per_episode))
        pictures: dict[int, dict[str, NDArray[np.uint8]]] = {step: {} for step in steps}
        for camera, key in keys.items():
            for step, picture in enumerate(episode.pictures(key, self._cameras[camera])):
                if step in steps:
                    pictures[step][camera] = picture
        return pictures
