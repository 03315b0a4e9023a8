"""A whole conversion: plan, shards in parallel, joining, and the one rename that makes the dataset appear.

Everything is written into `<out>.partial-<fingerprint>` beside the output. The fingerprint is that of settings and
source bytes, so the same command after a kill finds its finished shards again and goes on.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from robocasa_lerobot import __version__
from robocasa_lerobot.convert.encoder import CODECS, SAMPLED_FRAMES, SAMPLED_PIXELS, Histogram
from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.finish import conversion_facts, finish_dataset
from robocasa_lerobot.convert.lerobot_v2.plan import V2Plan, make_v2_plan, takes
from robocasa_lerobot.convert.lerobot_v2.shard import convert_v2_shard
from robocasa_lerobot.convert.settings import ConversionSettings, Plan, SourceRecord, make_plan
from robocasa_lerobot.convert.shard import (
    DATASET,
    EPISODES_FILE,
    EXTRAS,
    HISTOGRAMS_FILE,
    REJECTED_FILE,
    convert_shard,
    episode_folder,
    read_jsonl,
    write_jsonl,
)
from robocasa_lerobot.convert.source import DemoFile
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.parallel import PoolExecutor, exit_if_orphaned, polled

# Our part of a dataset's folder; LeRobot reads nothing in it.
META_FOLDER = "meta/robocasa"
CONVERSION_FILE = "conversion.json"
# Starting a worker imports LeRobot and MuJoCo (about 6 s of CPU time); below this much work that does not pay.
_MIN_FRAMES_PER_WORKER = 400
_MAX_AUTOMATIC_WORKERS = 8


@dataclass(frozen=True)
class ConversionResult:
    """What a conversion wrote."""

    root: Path
    num_episodes: int
    num_frames: int
    rejected: list[dict[str, Any]]
    cameras: tuple[str, ...]
    instruction_sources: dict[str, int]
    notes: tuple[str, ...] = ()  # what the sources hold that was left out or changed


def convert(
    files: Sequence[Path], out: Path, settings: ConversionSettings, workers: int | None = None, overwrite: bool = False
) -> ConversionResult:
    """Convert demonstration files to one LeRobotDataset v3.0 at `out`.

    Args:
        files: HDF5 files, or folders of LeRobot v2.0 and v2.1 datasets, in the order in which their episodes come.
        out: folder of the dataset; it appears complete or not at all.
        settings: what decides the bytes of the dataset.
        workers: processes; None chooses by the amount of work. The dataset does not depend on it.
        overwrite: replace a dataset at `out`.

    Raises:
        UserError: the input or the output path cannot be used, or no episode is good. Nothing is at `out` then.
    """
    out = out.absolute()
    _check_output(out, overwrite)
    plan = make_v2_plan(files, settings) if takes(files) else make_plan(files, settings)
    partial = out.with_name(f"{out.name}.partial-{plan.fingerprint}")
    partial.mkdir(parents=True, exist_ok=True)
    with _locked(partial):
        try:
            _run_shards(plan, partial, _num_workers(plan, workers))
            result = _join(plan, partial, out)
        except OSError as error:
            raise UserError(
                f"writing failed: {error}. Nothing is at {out}; finished parts are kept in {partial}: free what is "
                "lacking and give the same command to go on."
            ) from error
        if result is not None:
            _publish(partial / "merged", out, partial / "replaced")
    rejected = result.rejected if result is not None else _rejected(plan, partial)
    shutil.rmtree(partial)
    if result is None:
        lines = "".join(f"\n  {r['source_file']} {r['source_demo']}: {r['reason']}" for r in rejected[:5])
        raise UserError(f"no episode could be converted ({len(rejected)} rejected), nothing was written:{lines}")
    return result


def _check_output(out: Path, overwrite: bool) -> None:
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not overwrite:
        raise UserError(f"{out} exists already. Choose another --out, or replace it with --overwrite.")
    if not (out / "meta" / "info.json").is_file():
        raise UserError(f"{out} is not a LeRobotDataset, so --overwrite leaves it alone. Choose another --out.")


@contextlib.contextmanager
def _locked(partial: Path) -> Iterator[None]:
    with (partial / "lock").open("w") as lock:
        try:
            # A record lock is not inherited, so no orphaned child holds it after the parent was killed.
            fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UserError(
                f"the same conversion is running already (it holds {partial}). Wait until it ends."
            ) from None
        yield


def _num_workers(plan: Plan, workers: int | None) -> int:
    if workers is not None:
        if workers < 1:
            raise UserError(f"{workers} workers: at least 1 is needed.")
        return min(workers, len(plan.shards))
    cores = min(os.cpu_count() or 1, _MAX_AUTOMATIC_WORKERS)
    return max(1, min(cores, len(plan.shards), plan.num_frames // _MIN_FRAMES_PER_WORKER))


@dataclass
class _ShardTask:
    """The pipeline step that datatrove runs once for each shard."""

    plan: Plan
    partial: str

    def __call__(self, data: None, rank: int = 0, world_size: int = 1) -> None:
        partial = Path(self.partial)
        done = partial / "progress" / f"{rank:05d}"
        done.parent.mkdir(exist_ok=True)
        shard = self.plan.shards[rank]
        folder = shard_folder(partial, rank)
        if folder.exists():
            return  # complete; only the executor's marker was lost
        # Of its own, since the worker of a run that was killed may still be at the same shard for a moment.
        attempt = folder.with_name(f"{folder.name}.attempt-{os.getpid()}")
        if isinstance(self.plan, V2Plan):
            convert_v2_shard(self.plan, shard, attempt, lambda frames: _report(done, frames))
        else:
            convert_shard(self.plan, shard, attempt, lambda frames: _report(done, frames))
        try:
            attempt.rename(folder)
        except OSError:
            if not folder.exists():
                raise
            shutil.rmtree(attempt)  # somebody else finished it: the bytes are the same


def quiet_libraries() -> None:
    """Silence what libraries print about every file they write; their errors still arrive as exceptions."""
    import av
    import datasets

    datasets.disable_progress_bars()
    av.logging.set_libav_level(av.logging.ERROR)


def shard_folder(partial: Path, rank: int) -> Path:
    """Where a shard is written."""
    return partial / "shards" / f"{rank:05d}"


def _run_shards(plan: Plan, partial: Path, workers: int) -> None:
    quiet_libraries()
    executor = PoolExecutor(
        pipeline=[_ShardTask(plan, str(partial))],
        tasks=len(plan.shards),
        workers=workers,
        logging_dir=str(partial / "executor"),
        initializer=quiet_libraries,
        preload=[convert_shard.__module__],
    )
    if not executor.get_incomplete_ranks():
        return
    with _progress_bar(plan, partial):
        executor.run()


@contextlib.contextmanager
def _progress_bar(plan: Plan, partial: Path) -> Iterator[None]:
    """A bar over frames, fed by the counts that the workers leave in files."""

    def done(rank: int) -> int:
        with contextlib.suppress(OSError, ValueError):
            return int((partial / "progress" / f"{rank:05d}").read_text())
        return 0

    def show() -> None:
        bar.n = min(plan.num_frames, sum(done(rank) for rank in range(len(plan.shards))))
        bar.refresh()

    with tqdm(total=plan.num_frames, unit="frame", desc="converting", smoothing=0.05) as bar:
        with polled(show):
            yield
        bar.n = plan.num_frames


def _report(file: Path, count: int) -> None:
    exit_if_orphaned()
    with contextlib.suppress(OSError):  # only for the eye
        file.write_text(str(count))


def _rejected(plan: Plan, partial: Path) -> list[dict[str, Any]]:
    return [
        line for rank in range(len(plan.shards)) for line in read_jsonl(shard_folder(partial, rank) / REJECTED_FILE)
    ]


def _join(plan: Plan, partial: Path, out: Path) -> ConversionResult | None:
    """Join the shards in `<partial>/merged`; None where no shard has an episode."""
    from lerobot.datasets.io_utils import write_stats

    from robocasa_lerobot.convert.joining import copy_tree, join_datasets
    from robocasa_lerobot.convert.statistics import dataset_statistics

    merged = partial / "merged"
    shutil.rmtree(merged, ignore_errors=True)  # an earlier try may have been killed here
    folders = [shard_folder(partial, rank) for rank in range(len(plan.shards))]
    full = [folder for folder in folders if (folder / DATASET).exists()]
    if not full:
        return None
    join_datasets([folder / DATASET for folder in full], merged)
    episodes: list[dict[str, Any]] = []
    histograms: dict[str, Histogram] = {}
    for folder in full:
        for line in read_jsonl(folder / EPISODES_FILE):
            index = len(episodes)
            copy_tree(folder / EXTRAS / episode_folder(line["episode_index"]), merged / EXTRAS / episode_folder(index))
            episodes.append(line | {"episode_index": index})
        with np.load(folder / HISTOGRAMS_FILE) as arrays:
            for key in arrays.files:
                histograms[key] = histograms.get(key, 0) + arrays[key]
    num_frames = sum(line["length"] for line in episodes)
    info = json.loads((merged / "meta" / "info.json").read_text(encoding="utf-8"))
    if (info["total_episodes"], info["total_frames"]) != (len(episodes), num_frames):
        raise RuntimeError(
            f"joining gave {info['total_episodes']} episodes with {info['total_frames']} frames, "
            f"expected {len(episodes)} with {num_frames}."
        )
    write_stats(dataset_statistics(merged, info["features"], histograms), merged)
    rejected = _rejected(plan, partial)
    ours = merged / META_FOLDER
    ours.mkdir(parents=True)
    write_jsonl(ours / EPISODES_FILE, episodes)
    write_jsonl(ours / REJECTED_FILE, rejected)
    record = _conversion_record(plan, out)
    if isinstance(plan, V2Plan):
        finish_dataset(plan, merged)
        record |= conversion_facts(plan, episodes)
    (ours / CONVERSION_FILE).write_text(
        json.dumps(record, indent=2, ensure_ascii=False, default=str) + "\n", encoding="utf-8"
    )
    sources = dict(Counter(line["instruction_source"] for line in episodes))
    cameras = tuple(camera.name for camera in plan.cameras)
    notes = plan.notes if isinstance(plan, V2Plan) else ()
    return ConversionResult(out, len(episodes), num_frames, rejected, cameras, sources, notes)


def _conversion_record(plan: Plan, out: Path) -> dict[str, Any]:
    """Every setting that made the dataset, for readers and for `verify`."""
    packages = ("lerobot", "mujoco", "h5py", "av", "numpy")
    return {
        "robocasa_lerobot_version": __version__,
        "versions": {package: version(package) for package in packages},
        "settings": asdict(plan.settings),
        "video": CODECS[plan.settings.video_codec],
        "image_statistics": (
            f"{SAMPLED_FRAMES} evenly spaced frames of each episode (all of shorter ones), of each "
            f"{SAMPLED_PIXELS} or more evenly spaced rows and columns (all of smaller pictures)"
        ),
        "robot_type": plan.mapping.robot_type,
        "fps": plan.fps,
        "cameras": [asdict(camera) for camera in plan.cameras],
        "sources": [_source_record(source, out, plan.settings) for source in plan.sources],
    }


def _source_record(source: SourceRecord, out: Path, settings: ConversionSettings) -> dict[str, Any]:
    path = Path(source.file)
    if path.is_dir():
        attributes = V2Dataset(path).collection
    else:
        with DemoFile(path, settings.layout) as file:
            attributes = file.attributes
    return asdict(source) | {"relative_to_dataset": os.path.relpath(source.file, out), "attributes": attributes}


def _publish(merged: Path, out: Path, replaced: Path) -> None:
    """Let the finished dataset appear at `out` by a rename, after moving an old one aside."""
    if out.exists():
        shutil.rmtree(replaced, ignore_errors=True)
        out.rename(replaced)
    merged.rename(out)
