"""A whole conversion: plan, shards in parallel, joining, and the one rename that makes the dataset appear.

Everything is written into `<out>.partial-<fingerprint>` beside the output. The fingerprint is that of settings and
source bytes, so the same command after a kill finds its finished shards again and goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot import __version__, contract
from robocasa_lerobot.convert.action_range import out_of_range, warning_of
from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.finish import conversion_facts, finish_dataset
from robocasa_lerobot.convert.lerobot_v2.plan import V2Plan, make_v2_plan, takes
from robocasa_lerobot.convert.lerobot_v2.shard import convert_v2_shard
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.record_files import (
    ACTIONS_OUT_OF_RANGE,
    CONVERSION_FILE,
    DATASET,
    EPISODES_FILE,
    EXTRAS,
    HISTOGRAMS_FILE,
    META_FOLDER,
    REJECTED_FILE,
    episode_folder,
    kept_assets,
)
from robocasa_lerobot.convert.scenes.prefetch import scenes_ahead
from robocasa_lerobot.convert.settings import (
    CORES_PER_WORKER,
    MIN_FRAMES_PER_WORKER,
    ConversionSettings,
    Plan,
    Shard,
    SourceRecord,
    make_plan,
)
from robocasa_lerobot.convert.shard import convert_shard
from robocasa_lerobot.convert.worker_imports import worker_imports
from robocasa_lerobot.convert.writing.card import write_dataset_card
from robocasa_lerobot.convert.writing.encoder import CODECS, SAMPLED_FRAMES, SAMPLED_PIXELS, Histogram
from robocasa_lerobot.convert.writing.encoding_process import shared_encoder
from robocasa_lerobot.convert.writing.modality import MODALITY_FILE, modality, write_modality
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import Execution
from robocasa_lerobot.jobs.pieces import report_frames, require_complete, run_pieces, submit_pieces
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
from robocasa_lerobot.jsonl import json_text, read_jsonl, write_jsonl
from robocasa_lerobot.quiet import quiet_libraries

_MERGED = "merged"  # in the working folder


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
    warnings: tuple[str, ...] = ()  # what in the data may be wrong


def convert(
    files: Sequence[Path],
    out: Path,
    settings: ConversionSettings,
    workers: int | None = None,
    overwrite: bool = False,
    execution: Execution | None = None,
) -> ConversionResult:
    """Convert demonstration files to one LeRobotDataset v3.0 at `out`.

    Args:
        files: HDF5 files, or folders of LeRobot v2.0 and v2.1 datasets, in the order in which their episodes come.
        out: folder of the dataset; it appears complete or not at all.
        settings: what decides the bytes of the dataset.
        workers: processes; None chooses by the amount of work. The dataset does not depend on it.
        overwrite: replace a dataset at `out`.
        execution: local (the default) or Ray; `workers` counts for local.

    Raises:
        UserError: the input or the output path cannot be used, or no episode is good. Nothing is at `out` then.
    """
    check_workers(workers)
    with contextlib.closing(shared_encoder), contextlib.closing(scenes_ahead):
        if workers == 1:
            shared_encoder.started()  # takes a moment, meanwhile the files are looked into
        return _convert(files, out, settings, workers, overwrite, execution or Execution())


def _convert(
    files: Sequence[Path],
    out: Path,
    settings: ConversionSettings,
    workers: int | None,
    overwrite: bool,
    execution: Execution,
) -> ConversionResult:
    plan, partial, out = _prepared(files, out, settings, overwrite)
    if out.exists() and not overwrite and _left_behind(out) == partial:
        with held_folder(partial):
            if not is_done(partial / _MERGED):  # a run with --overwrite was killed, which may go on
                check_output(out, overwrite)
            clear_away(partial)  # a run was killed after its dataset had appeared, while clearing away
        return _recorded_result(plan, out)
    with held_folder(partial), failures_explained(out, partial):
        go_on(partial / _MERGED)
        processes = num_workers(workers, len(plan.shards), plan.num_frames, MIN_FRAMES_PER_WORKER, CORES_PER_WORKER)
        run_pieces(
            _ShardTask(plan, str(partial), in_order=processes == 1 and execution.kind == "local"),
            len(plan.shards),
            partial,
            execution,
            processes,
            plan.num_frames,
            "converting",
            quiet_libraries,
            worker_imports(convert_shard.__module__),
        )
        return _completed(plan, partial, out, overwrite)


def submit(
    files: Sequence[Path], out: Path, settings: ConversionSettings, execution: Execution, overwrite: bool = False
) -> str:
    """Submit a conversion to Slurm; gives a line for the user. The last job makes the dataset appear at `out`.

    The same call later submits what has not been completed. All paths must be on file systems that the nodes share.

    Raises:
        UserError: as `convert`, and where Slurm does not take the jobs or still has those of an earlier call.
    """
    plan, partial, out = _prepared([file.absolute() for file in files], out, settings, overwrite)
    with held_folder(partial):
        go_on(partial / _MERGED)
    # Not locked: the last job takes the lock, and may start before this call returns.
    with failures_explained(out, partial):
        step, last = _ShardTask(plan, str(partial)), _LastJob(plan, str(partial), str(out), overwrite)
        return submit_pieces(step, last, len(plan.shards), partial, out, execution)


def merge(files: Sequence[Path], out: Path, settings: ConversionSettings, overwrite: bool = False) -> ConversionResult:
    """Join the shards of a submitted conversion, as its last job does.

    Raises:
        UserError: not all of them are complete.
    """
    plan, partial, out = _prepared([file.absolute() for file in files], out, settings, overwrite)
    return _LastJob(plan, str(partial), str(out), overwrite)()


@dataclass(frozen=True)
class _LastJob:
    """Joins the shards once all are complete."""

    plan: Plan
    partial: str
    out: str
    overwrite: bool

    def __call__(self) -> ConversionResult:
        partial, out = Path(self.partial), Path(self.out)
        check_output(out, self.overwrite)
        require_complete(len(self.plan.shards), partial)
        quiet_libraries()
        with held_folder(partial), failures_explained(out, partial):
            if is_done(partial / _MERGED):  # this job was killed while clearing away, and has begun again
                clear_away(partial)
                return _recorded_result(self.plan, out)
            return _completed(self.plan, partial, out, self.overwrite)


def _prepared(
    files: Sequence[Path], out: Path, settings: ConversionSettings, overwrite: bool
) -> tuple[Plan, Path, Path]:
    out = output_path(out)
    left = _left_behind(out)
    if left is None:
        check_output(out, overwrite)
    folders = takes(files)
    for file in files:
        check_outside(out, file)
    plan = make_v2_plan(files, settings) if folders else make_plan(files, settings)
    partial = partial_folder(out, plan.fingerprint)
    if left is not None and left != partial:
        check_output(out, overwrite)
    return plan, partial, out


def _left_behind(out: Path) -> Path | None:
    """The working folder of the conversion that made the dataset at `out`, or makes it again, where it is there."""
    try:
        record = json.loads((out / META_FOLDER / CONVERSION_FILE).read_text(encoding="utf-8"))
        folder = partial_folder(out, str(record["fingerprint"]))
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return folder if folder.is_dir() else None


def _recorded_result(plan: Plan, out: Path) -> ConversionResult:
    """What a conversion that has been completed wrote."""
    episodes, rejected = (read_jsonl(out / META_FOLDER / name) for name in (EPISODES_FILE, REJECTED_FILE))
    record = json.loads((out / META_FOLDER / CONVERSION_FILE).read_text(encoding="utf-8"))
    return _result(plan, out, episodes, rejected, record)


def _result(
    plan: Plan, out: Path, episodes: list[dict[str, Any]], rejected: list[dict[str, Any]], record: dict[str, Any]
) -> ConversionResult:
    warning = warning_of(record.get(ACTIONS_OUT_OF_RANGE))
    return ConversionResult(
        root=out,
        num_episodes=len(episodes),
        num_frames=sum(line["length"] for line in episodes),
        rejected=rejected,
        cameras=tuple(camera.name for camera in plan.cameras),
        instruction_sources=dict(Counter(line["instruction_source"] for line in episodes)),
        notes=plan.notes,
        warnings=(warning,) if warning else (),
    )


def _completed(plan: Plan, partial: Path, out: Path, overwrite: bool) -> ConversionResult:
    """Join the shards, let the dataset appear, and clear away the rest."""
    result = _join(plan, partial, out)
    if result is not None:
        check_output(out, overwrite)  # somebody else's may have appeared meanwhile
        publish(partial / _MERGED, out, partial / "replaced")
    rejected = result.rejected if result is not None else _rejected(plan, partial)
    clear_away(partial)
    if result is None:
        lines = "".join(f"\n  {r['source_file']} {r['source_demo']}: {r['reason']}" for r in rejected[:5])
        raise UserError(f"no episode could be converted ({len(rejected)} rejected), nothing was written:{lines}")
    return result


@dataclass
class _ShardTask:
    """The pipeline step that datatrove runs once for each shard."""

    plan: Plan
    partial: str
    in_order: bool = False  # one process makes all shards, one after the other

    def __call__(self, data: None, rank: int = 0, world_size: int = 1) -> None:
        partial = Path(self.partial)

        def report(frames: int) -> None:
            report_frames(partial, rank, frames)

        quiet_libraries()  # on another machine nobody has done it
        shard = self.plan.shards[rank]

        def write(folder: Path) -> None:
            if isinstance(self.plan, V2Plan):
                convert_v2_shard(self.plan, shard, folder, report)
            else:
                convert_shard(self.plan, shard, folder, report, self._next(rank))

        make_piece(shard_folder(partial, rank), write)

    def _next(self, rank: int) -> Shard | None:
        """The shard that this process will make next, if that is known."""
        later = range(rank + 1, len(self.plan.shards)) if self.in_order else ()
        coming = (r for r in later if not shard_folder(Path(self.partial), r).exists())
        return next((self.plan.shards[r] for r in coming), None)


def shard_folder(partial: Path, rank: int) -> Path:
    """Where a shard is written."""
    return partial / "shards" / f"{rank:05d}"


def _rejected(plan: Plan, partial: Path) -> list[dict[str, Any]]:
    return [
        line for rank in range(len(plan.shards)) for line in read_jsonl(shard_folder(partial, rank) / REJECTED_FILE)
    ]


def _join(plan: Plan, partial: Path, out: Path) -> ConversionResult | None:
    """Join the shards in a folder of `partial`; None where no shard has an episode."""
    from lerobot.datasets.io_utils import write_stats

    from robocasa_lerobot.convert.writing.joining import copy_tree, join_datasets
    from robocasa_lerobot.convert.writing.statistics import column_batches, dataset_statistics

    merged = partial / _MERGED
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
    for source in plan.sources:
        _keep_assets(source, merged / EXTRAS, settings=plan.settings)
    rejected = _rejected(plan, partial)
    ours = merged / META_FOLDER
    ours.mkdir(parents=True)
    write_jsonl(ours / EPISODES_FILE, episodes)
    write_jsonl(ours / REJECTED_FILE, rejected)
    record = _conversion_record(plan, out)
    record[ACTIONS_OUT_OF_RANGE] = out_of_range(plan.mapping, column_batches(merged, contract.ACTION_KEY))
    if isinstance(plan, V2Plan):
        finish_dataset(plan, merged)
        record |= conversion_facts(plan, episodes)
    if not (merged / MODALITY_FILE).exists():
        write_modality(merged, modality(info["features"], plan.mapping.state_parts, plan.mapping.action_parts))
    (ours / CONVERSION_FILE).write_text(json_text(record, indent=2, default=str) + "\n", encoding="utf-8")
    write_dataset_card(merged, [Path(source.file) for source in plan.sources])
    return _result(plan, out, episodes, rejected, record)


def _conversion_record(plan: Plan, out: Path) -> dict[str, Any]:
    """Every setting that made the dataset, for readers and for `verify`."""
    packages = ("lerobot", "mujoco", "h5py", "av", "numpy")
    return {
        "robocasa_lerobot_version": __version__,
        "fingerprint": plan.fingerprint,
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


def _keep_assets(source: SourceRecord, extras: Path, settings: ConversionSettings) -> None:
    """Write the meshes and textures that a file holds itself, without which its scenes cannot be rendered again."""
    if Path(source.file).is_dir():
        return
    with DemoFile(Path(source.file), settings.layout) as file:
        for name, content in file.assets():
            path = extras / kept_assets(source.sha256) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


def _source_record(source: SourceRecord, out: Path, settings: ConversionSettings) -> dict[str, Any]:
    path = Path(source.file)
    if path.is_dir():
        attributes = V2Dataset(path).collection
    else:
        with DemoFile(path, settings.layout) as file:
            attributes = file.attributes
    return asdict(source) | {"relative_to_dataset": os.path.relpath(source.file, out), "attributes": attributes}
