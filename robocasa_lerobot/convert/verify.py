"""A converted dataset, read back through LeRobot, compared with the files it was made from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.plan import SOURCE_FORMAT, source_record
from robocasa_lerobot.convert.lerobot_v2.verify import V2Verification
from robocasa_lerobot.convert.reading.inputs import check_converted, is_dataset
from robocasa_lerobot.convert.record_files import CONVERSION_FILE, EPISODES_FILE, META_FOLDER
from robocasa_lerobot.convert.report import Report
from robocasa_lerobot.convert.rerender.plan import SOURCE_FORMAT as RERENDERED
from robocasa_lerobot.convert.rerender.verify import verify_rerendered
from robocasa_lerobot.convert.settings import ConversionSettings, SourceRecord, file_sha256
from robocasa_lerobot.convert.verification import Source, Verification
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.as_completed import as_they_end
from robocasa_lerobot.jobs.workers import check_workers, num_workers
from robocasa_lerobot.jsonl import read_jsonl
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.quiet import quiet_libraries

# Each further process imports LeRobot and MuJoCo, which takes as long as looking at some dozens of episodes.
_MIN_EPISODES_PER_WORKER = 64
_PARTS_PER_WORKER = 4  # so that none waits long for the last


def verify(
    root: Path,
    sources: Sequence[Path] = (),
    asset_roots: Sequence[str] = (),
    pictures_per_episode: int | None = 8,
    min_psnr_db: float = 25.0,
    workers: int | None = None,
) -> Report:
    """Compare a converted dataset with its source files.

    Args:
        root: folder of the dataset.
        sources: those of the source files that are not at their recorded places any more.
        asset_roots: folders with meshes and textures, besides the recorded ones.
        pictures_per_episode: evenly spaced steps whose pictures are decoded and compared; None takes all.
        min_psnr_db: the least that a decoded picture must reach.
        workers: processes; None chooses by the number of episodes and cores. The outcome does not depend on it. A
            dataset that was rendered again is checked by one.

    Raises:
        UserError: the folder is no dataset of `convert`, it does not open, a source file is not to be found, or fewer
            than one process was asked for.
    """
    check_workers(workers)
    check_converted(root)
    record = json.loads((root / META_FOLDER / CONVERSION_FILE).read_text(encoding="utf-8"))
    if record.get("source_format") == RERENDERED:
        dataset = _opened(root)
        return verify_rerendered(root, dataset, record, sources, asset_roots, pictures_per_episode, min_psnr_db)
    job = _Job(root, record, recorded_settings(record, asset_roots), pictures_per_episode, min_psnr_db)
    verification = job.verification()
    count = verification.num_episodes
    number = num_workers(workers, count, count, _MIN_EPISODES_PER_WORKER)
    found_sources = tuple(_find_sources(root, record["sources"], sources))
    verification.check_structure()
    verification.check_videos()
    for source in found_sources:
        verification.check_source(source, job.settings)
    with Bar(total=count, unit="episode", desc="verifying") as bar:
        if number == 1:
            for source in found_sources:
                verification.check_episodes(source, job.settings, range(count), bar)
            return verification.report()
        found: dict[int, Report] = {}
        jobs = [(job, found_sources, part) for part in _parts(count, number)]
        for part, report in as_they_end(_check_part, jobs, number):
            found[part.start] = report
            bar.update(len(part))
    whole = verification.report()
    for _, report in sorted(found.items()):
        whole.add(report)
    return whole


@dataclass(frozen=True)
class _Job:
    """What a process must know to open a dataset for comparison."""

    root: Path
    record: dict[str, Any]
    settings: ConversionSettings
    pictures_per_episode: int | None
    min_psnr_db: float

    def verification(self) -> Verification:
        """The dataset, opened, with nothing checked yet."""
        episodes = read_jsonl(self.root / META_FOLDER / EPISODES_FILE)
        kind = V2Verification if self.record.get("source_format") == SOURCE_FORMAT else Verification
        dataset = _opened(self.root)
        return kind(self.root, dataset, episodes, self.record, self.pictures_per_episode, self.min_psnr_db)


def _check_part(job: _Job, sources: Sequence[Source], part: range) -> tuple[range, Report]:
    verification = job.verification()
    for source in sources:
        verification.check_episodes(source, job.settings, part, None)
    return part, verification.report()


def _parts(count: int, workers: int) -> list[range]:
    number = min(count, workers * _PARTS_PER_WORKER)
    return [range(count * part // number, count * (part + 1) // number) for part in range(number)]


def _opened(root: Path) -> LeRobotDataset:
    quiet_libraries()
    try:
        return LeRobotDataset(f"local/{root.name}", root=root, video_backend="pyav", return_uint8=True)
    except Exception as error:
        raise UserError(f"LeRobot does not open {root}: {type(error).__name__}: {error}") from error


def recorded_settings(record: dict[str, Any], asset_roots: Sequence[str]) -> ConversionSettings:
    """The settings of a conversion from its `conversion.json`, with further asset roots."""
    settings = record["settings"]
    recorded = [root for root in settings["asset_roots"] if Path(root).is_dir()]
    cameras = settings["cameras"]
    return ConversionSettings(
        **{
            **settings,
            "asset_roots": (*asset_roots, *recorded),
            "cameras": tuple(cameras) if cameras is not None else None,
        }
    )


def _sha256(path: Path) -> str:
    return source_record(V2Dataset(path)).sha256 if is_dataset(path) else file_sha256(path)


def _find_sources(root: Path, recorded: list[dict[str, Any]], given: Sequence[Path]) -> Iterator[Source]:
    shas = {path: _sha256(path) for path in given if path.exists()}
    by_sha = {sha: path for path, sha in shas.items()}
    missing = [path for path in given if not path.exists()]
    if missing:
        raise UserError(f"--source {missing[0]} does not exist.")
    recorded_shas = {entry["sha256"] for entry in recorded}
    others = [path for path in given if shas[path] not in recorded_shas]  # the rest are known to be another source
    for entry in recorded:
        fields = {key: entry[key] for key in ("file", "sha256", "size_bytes")}
        source = SourceRecord(**fields)
        same_name = [path for path in others if path.name == Path(source.file).name]
        places = [Path(source.file), root / entry["relative_to_dataset"]]
        candidates = [by_sha[source.sha256]] if source.sha256 in by_sha else [*same_name, *places]
        path = next((place for place in candidates if place.exists()), None)
        if path is None:
            raise UserError(
                f"the source {source.file} is not there any more. Give the source files with --source FILE ..."
            )
        yield Source(source.file, path, source.sha256)
