"""A dataset that was rendered again compared with the one it was made from: tables byte for byte, pictures anew."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.record_files import EXTRAS
from robocasa_lerobot.convert.report import CameraQuality, Check, Report
from robocasa_lerobot.convert.rerender.plan import EpisodePictures, RenderPlan, RenderSettings, make_render_plan
from robocasa_lerobot.convert.verification import num_video_frames, psnr_db, spread
from robocasa_lerobot.convert.writing.stages import SUBTASKS_FILE
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

_CHECKS = ("tables", "extras", "entries", "video frames", "pictures")


def verify_rerendered(
    root: Path,
    dataset: LeRobotDataset,
    record: dict[str, Any],
    sources: Sequence[Path],
    asset_roots: Sequence[str],
    pictures_per_episode: int | None,
    min_psnr_db: float,
) -> Report:
    """Compare; see `verify.verify` for the arguments. `sources` may name the dataset it was made from, if moved.

    Raises:
        UserError: the dataset that it was made from is not there, or cannot be rendered.
    """
    place = record["source_dataset"]
    places = [*sources, Path(place["folder"]), root / place["relative_to_dataset"]]
    source = next((path.resolve() for path in places if (path / "meta" / "info.json").is_file()), None)
    if source is None:
        raise UserError(f"the dataset {place['folder']} is not there any more. Give it with --source DIR.")
    fields = dict(record["settings"])
    roots = (*asset_roots, *fields["asset_roots"])
    cameras = tuple(camera["name"] for camera in record["cameras"])
    settings = RenderSettings(
        **fields | {"asset_roots": roots, "cameras": cameras, "cam_configs": json.dumps(fields["cam_configs"])}
    )
    plan = make_render_plan(source, settings)
    checks = {name: Check(name) for name in _CHECKS}
    quality = {camera.name: CameraQuality(camera.name) for camera in plan.cameras}
    for name, folder in (("tables", "data"), ("extras", EXTRAS)):
        _compare_files(checks[name], source / folder, root / folder)
    for table in ("meta/tasks.parquet", SUBTASKS_FILE):
        if (source / table).is_file():
            same = (root / table).is_file() and filecmp.cmp(source / table, root / table, shallow=False)
            checks["tables"].expect(same, f"{Path(table).name} differs")
    _compare_entries(checks["entries"], source, root)
    for camera in quality:
        files = (root / "videos" / contract.image_key(camera)).glob("*/*.mp4")
        count = sum(num_video_frames(file) for file in files)
        checks["video frames"].expect(
            count == plan.num_frames, f"{camera}: {count} frames in the videos, {plan.num_frames} in the tables"
        )
    first = 0
    for episode in Bar(plan.dataset.episodes, unit="episode", desc="verifying"):
        steps = spread(episode.length, pictures_per_episode)
        label = f"episode {episode.index}"
        try:
            with EpisodePictures(plan, episode) as pictures:
                for step in steps:
                    decoded = _decoded(dataset, first + step, plan)
                    for key, picture in pictures.at(step).items():
                        camera = key.removeprefix(contract.IMAGE_PREFIX)
                        psnr = psnr_db(decoded[key], picture)
                        quality[camera].psnr_db.append(psnr)
                        checks["pictures"].expect(
                            psnr >= min_psnr_db,
                            f"{label} step {step} {camera}: PSNR {psnr:.1f} dB, at least {min_psnr_db:g} needed",
                        )
        except RejectedEpisodeError as error:
            checks["pictures"].fail(f"{label}: {error}")
        first += episode.length
    return Report(str(root), dataset.num_episodes, dataset.num_frames, list(checks.values()), list(quality.values()))


def _decoded(dataset: LeRobotDataset, row: int, plan: RenderPlan) -> dict[str, NDArray[np.uint8]]:
    try:
        item = dataset[row]
    except Exception as error:  # whatever a decoder throws at a broken video
        raise RejectedEpisodeError(f"LeRobot cannot read row {row}: {type(error).__name__}: {error}") from error
    keys = [contract.image_key(camera.name) for camera in plan.cameras]
    return {key: item[key].permute(1, 2, 0).numpy() for key in keys}


def _compare_files(check: Check, source: Path, copy: Path) -> None:
    names = {path.relative_to(folder) for folder in (source, copy) for path in folder.rglob("*") if path.is_file()}
    for name in sorted(names):
        there = (source / name).is_file() and (copy / name).is_file()
        check.expect(there and filecmp.cmp(source / name, copy / name, shallow=False), f"{copy.name}/{name} differs")


def _compare_entries(check: Check, source: Path, copy: Path) -> None:
    """What the episodes' entries say of anything but pictures."""
    for file in sorted((source / "meta" / "episodes").glob("*/*.parquet")):
        other = copy / file.relative_to(source)
        check.expect(other.is_file(), f"{other} is missing")
        if other.is_file():
            before, after = pq.ParquetFile(file).read(), pq.ParquetFile(other).read()
            for name in before.column_names:
                if not name.startswith(("videos/", f"stats/{contract.IMAGE_PREFIX}")):
                    same = name in after.column_names and before[name].equals(after[name])
                    check.expect(same, f"{other.name}: column {name} differs")
