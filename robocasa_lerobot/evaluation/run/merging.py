"""Joining the results of shards into one `trials.jsonl`, after checking that they are parts of the same evaluation."""

from __future__ import annotations

import collections
import dataclasses
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from robocasa_lerobot.evaluation.records.results import (
    SHARDS_FOLDER,
    TRIALS_FILE,
    ResultsError,
    RunHeader,
    TrialKey,
    TrialRecord,
    read_results,
)
from robocasa_lerobot.evaluation.records.trials_file import check_same_run
from robocasa_lerobot.evaluation.run.engine import Evaluation, check_plan, only_writer
from robocasa_lerobot.files import written_aside

_SHOWN = 10


def merge(evaluation: Evaluation) -> list[TrialRecord]:
    """Join what the shards of an evaluation have recorded into the `trials.jsonl` of its output folder.

    Films stay where they are: the records name them by their places in the shards' folders.

    Args:
        evaluation: prepared with the settings of the shards, without a shard.

    Returns:
        The records of the whole plan, in its order.

    Raises:
        ResultsError: no shards, shards of other settings or with different results for one trial, trials of the plan
            that no shard has recorded (all that there are have been written then), or another process writes here.
    """
    out = evaluation.out
    folders = sorted(file.parent for file in out.glob(f"{SHARDS_FOLDER}/*-of-*/{TRIALS_FILE}"))
    if not folders:
        raise ResultsError(f"{out / SHARDS_FOLDER}: no shards; run them with --shard=1/N to --shard=N/N first.")
    with only_writer(out):  # what it appends meanwhile would not be in the file that takes the place
        return _join(evaluation, folders)


def _join(evaluation: Evaluation, folders: Sequence[Path]) -> list[TrialRecord]:
    out, path = evaluation.out, evaluation.out / TRIALS_FILE
    headers: dict[str, RunHeader] = {}
    records: dict[TrialKey, TrialRecord] = {}
    places: dict[TrialKey, Path] = {}
    unlike: collections.Counter[tuple[Path, Path]] = collections.Counter()
    parts = [(out, read_results(path))] if path.is_file() else []
    for folder, results in [*parts, *((folder, read_results(folder)) for folder in folders)]:
        check_same_run(results.path, results.headers.values(), evaluation.header)
        headers = _in_turn(headers, results.headers)
        for record in results.trials:
            moved = _moved(record, folder, out)
            earlier = records.get(record.key)
            source = evaluation.sources.get(record.label)
            if earlier is not None and earlier.error is None and source is not None and not source.repeats:
                continue  # made again after the number of shards had changed; the first one counts, not the best one
            if earlier is not None and earlier.comparable() != moved.comparable() and earlier.error is None:
                if record.error is not None:
                    continue
                if dataclasses.replace(moved, trajectory=earlier.trajectory).comparable() == earlier.comparable():
                    unlike[places[record.key], results.path] += 1  # nothing that a report tells differs
                    continue
                raise ResultsError(
                    f"{results.path}: {record.label} {record.task} trial {record.trial} ended otherwise than in "
                    f"{places[record.key]}: policy or env is not deterministic, or the two were made with something "
                    "else. Move one of the two away, run what is missing then, and give --merge again."
                )
            if moved.video is None and earlier is not None and earlier.comparable() == moved.comparable():
                moved = dataclasses.replace(moved, video=earlier.video)
            records[record.key], places[record.key] = moved, results.path
    for (first, again), count in unlike.items():
        print(
            f"{again}: {count} trials ended as in {first}, but on another course, as on another machine or with other "
            f"software. The first ones count, those of {first}.",
            file=sys.stderr,
        )
    if evaluation.header.id in headers:  # the labels and plan of this command are the last ones that were given
        headers = _in_turn(headers, {evaluation.header.id: headers[evaluation.header.id]})
    check_plan(path, records, evaluation.plan)
    write_results(path, headers.values(), records.values())
    missing = [spec for spec in evaluation.plan if spec.key not in records]
    if missing:
        shown = ", ".join(f"{s.label} {s.task} {s.trial}" for s in missing[:_SHOWN])
        raise ResultsError(
            f"{len(missing)} of {len(evaluation.plan)} trials are recorded in no shard ({shown}"
            f"{', ...' if len(missing) > _SHOWN else ''}): run the shards again, they go on where they were. "
            f"{path} holds the others."
        )
    return [records[spec.key] for spec in evaluation.plan]


def _in_turn(earlier: Mapping[str, RunHeader], later: Mapping[str, RunHeader]) -> dict[str, RunHeader]:
    """Headers of which those that were said last are the last ones."""
    return {**{name: header for name, header in earlier.items() if name not in later}, **later}


def write_results(path: Path, headers: Iterable[RunHeader], records: Iterable[TrialRecord]) -> None:
    """Write a whole results file, which appears at its place only when it is complete."""
    with written_aside(path) as aside, aside.open("w", encoding="utf-8") as file:
        for line in (*(header.to_line() for header in headers), *(record.to_line() for record in records)):
            file.write(line + "\n")
        file.flush()
        os.fsync(file.fileno())


def _moved(record: TrialRecord, folder: Path, out: Path) -> TrialRecord:
    if record.video is None or folder == out:
        return record
    return dataclasses.replace(record, video=(folder.relative_to(out) / record.video).as_posix())
