"""Runs an evaluation: the plan, minus what is recorded, through the workers, into `trials.jsonl`."""

from __future__ import annotations

import collections
import dataclasses
import fcntl
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from tqdm import tqdm

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation import config as settings_of
from robocasa_lerobot.evaluation.checkpoints import PolicySource, common_image_size, read_source
from robocasa_lerobot.evaluation.config import EvaluationConfig
from robocasa_lerobot.evaluation.plan import TrialSpec, make_plan
from robocasa_lerobot.evaluation.provenance import utc_now
from robocasa_lerobot.evaluation.results import (
    TRIALS_FILE,
    Results,
    ResultsError,
    RunHeader,
    Seconds,
    TrialKey,
    TrialRecord,
    read_results,
)
from robocasa_lerobot.evaluation.trials_file import append, check_same_run, drop_torn_line
from robocasa_lerobot.evaluation.worker import WorkerSettings
from robocasa_lerobot.evaluation.workers import Completed, WorkerPool

CONFIG_FILE = "evaluation.yaml"


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """An evaluation that is ready to run; making one opens no process and writes no file."""

    config: EvaluationConfig
    sources: dict[str, PolicySource]
    header: RunHeader
    plan: list[TrialSpec]
    out: Path


def prepare(config: EvaluationConfig) -> Evaluation:
    """Check everything that the user named, and fix the plan.

    Raises:
        UserError: an unknown task, a folder that is no checkpoint, two policies with one label, ...
    """
    settings_of.check_factory(config.env.factory)
    horizons = settings_of.horizons(config.env)
    asked: list[str | None] = [*config.policy.label] or [None] * len(config.policy.path)
    sources = [read_source(path, label) for path, label in zip(config.policy.path, asked, strict=True)]
    by_label: dict[str, PolicySource] = {}
    for source in sources:
        if source.label in by_label:
            raise UserError(f"two policies are called {source.label!r}: name them with --policy.label=A,B.")
        if not source.label or "/" in source.label or source.label.startswith("."):
            raise UserError(f"policy.label {source.label!r}: it names a folder, so no '/' and no leading '.'.")
        by_label[source.label] = source
    settings = settings_of.outcome_settings(config, common_image_size(sources, config.env.image_size))
    plan = make_plan(list(by_label), horizons, config.trials, config.seed, config.videos)
    header = settings_of.run_header(config, {label: s.describe() for label, s in by_label.items()}, horizons, settings)
    return Evaluation(config, by_label, header, plan, settings_of.output_folder(config, list(by_label)))


def evaluate(evaluation: Evaluation) -> list[TrialRecord]:
    """Run the trials that are not recorded yet; the records of the whole plan, in its order.

    Each trial is appended to `trials.jsonl` as it ends: after a kill the same call runs the missing ones only.

    Raises:
        ResultsError: the output folder holds trials of other settings, or another process writes to it.
        UserError: a policy or an env cannot be built.
    """
    out, config = evaluation.out, evaluation.config
    out.mkdir(parents=True, exist_ok=True)
    path = out / TRIALS_FILE
    with _only_writer(out):
        if drop_torn_line(path):
            print(f"{path}: the last line was cut off by a kill; its trial runs again.", file=sys.stderr)
        header = evaluation.header
        earlier_runs = read_results(path) if path.exists() else Results(path, {}, [])
        check_same_run(path, earlier_runs.headers.values(), header)
        records = {record.key: record for record in earlier_runs.trials}
        _check_seeds(path, records, evaluation.plan)
        _write_config(out / CONFIG_FILE, config)
        todo = [spec for spec in evaluation.plan if _is_missing(records.get(spec.key), config.retry_errors)]
        if header.id not in earlier_runs.headers:
            append(path, header)
        for completed in _run(evaluation, todo, records):
            record = _record(completed, header)
            earlier = records.get(record.key)
            if earlier is not None and earlier.error is None:
                record = _with_film(earlier, record, out)
            append(path, record)
            records[record.key] = record
    return [records[spec.key] for spec in evaluation.plan]


def showcase(plan: Sequence[TrialSpec], records: Mapping[TrialKey, TrialRecord]) -> list[TrialSpec]:
    """Trials to run once more for their films: the first success and the first failure that no film shows yet.

    Which trials succeed is not known when the filmed ones are fixed; a trial can be run again, because it goes the
    same way. Only policies that are filmed at all are looked at.
    """
    chosen = []
    groups = dict.fromkeys((spec.label, spec.task) for spec in plan if spec.film)
    for label, task in groups:
        specs = [spec for spec in plan if (spec.label, spec.task) == (label, task) and spec.key in records]
        for success in (True, False):
            these = [s for s in specs if records[s.key].success is success and records[s.key].error is None]
            if these and all(records[spec.key].video is None for spec in these):
                chosen.append(dataclasses.replace(these[0], film=True))
    return chosen


def _run(
    evaluation: Evaluation, todo: Sequence[TrialSpec], records: Mapping[TrialKey, TrialRecord]
) -> Iterator[Completed]:
    """The missing trials, then the ones to film, with a progress bar; `records` grows while this runs."""
    if not todo and not showcase(evaluation.plan, records):
        print(f"all {len(evaluation.plan)} trials are in {evaluation.out / TRIALS_FILE}: nothing to run.")
        return
    config = evaluation.config
    worker_settings = WorkerSettings(
        sources=evaluation.sources,
        factory=config.env.factory,
        env_kwargs={
            "split": config.env.split,
            "render_preset": config.env.render_preset,
            "image_size": evaluation.header.image_size,
        },
        device=config.policy.device,
        threads=config.policy.threads,
        executed_steps=config.executed_steps,
        out=str(evaluation.out),
        render_devices=tuple(config.env.render_devices),
    )
    total = len(evaluation.plan)
    pool = WorkerPool(worker_settings, config.worker_count(max(1, len(todo))), config.stall_seconds)
    counts = collections.Counter[str]()
    with tqdm(total=total, initial=total - len(todo), unit="trial", desc="trials", dynamic_ncols=True) as bar:

        def to_film() -> list[TrialSpec]:
            specs = showcase(evaluation.plan, records)
            bar.total = (bar.total or 0) + len(specs)
            if specs:
                bar.set_description("films")
            return specs

        for completed in pool.run(todo, to_film):
            error = completed.result.error or (completed.earlier.error if completed.earlier else None)
            if error is not None:
                what = "failed with an error" if completed.result.error else "was tried again after an error"
                spec = completed.spec
                bar.write(f"{spec.label} {spec.task} trial {spec.trial} {what}: {_last_line(error)}", file=sys.stderr)
            if completed.spec.key not in records:
                kind = (
                    "errors" if completed.result.error else "solved" if completed.result.outcome.success else "failed"
                )
                counts[kind] += 1
                bar.set_postfix(counts)
            yield completed
            bar.update()


def _with_film(earlier: TrialRecord, again: TrialRecord, out: Path) -> TrialRecord:
    """The record of a trial that was run again for its film, with the film if it went the same way."""
    if again.video is not None and again.trajectory == earlier.trajectory:
        return dataclasses.replace(earlier, video=again.video)
    print(
        f"{earlier.label} {earlier.task} trial {earlier.trial} went another way when it was run again for its film: "
        "policy or env is not deterministic. The first run counts, without a film.",
        file=sys.stderr,
    )
    if again.video is not None:
        (out / again.video).unlink(missing_ok=True)
    return earlier


def _record(completed: Completed, header: RunHeader) -> TrialRecord:
    spec, result, earlier = completed.spec, completed.result, completed.earlier
    return TrialRecord(
        run=header.id,
        label=spec.label,
        task=spec.task,
        perturbation=spec.perturbation,
        trial=spec.trial,
        seed=spec.seed,
        policy_seed=spec.policy_seed,
        split=header.split,
        layout_id=result.outcome.layout_id,
        style_id=result.outcome.style_id,
        instruction=result.outcome.instruction,
        horizon=spec.horizon,
        horizon_multiplier=header.horizon_multiplier,
        success=result.outcome.success,
        first_success_step=result.outcome.first_success_step,
        steps=result.outcome.steps,
        terms=result.outcome.terms,
        outcome=result.kind,
        error=result.error,
        attempts=completed.attempts,
        first_outcome=earlier.kind if earlier else None,
        first_error=earlier.error if earlier else None,
        warnings={},
        trajectory=result.outcome.trajectory,
        video=result.video,
        seconds=Seconds(total=round(result.wall_seconds, 3)),
        finished=utc_now(),
    )


def _is_missing(record: TrialRecord | None, retry_errors: bool) -> bool:
    return record is None or (retry_errors and record.error is not None)


def _check_seeds(path: Path, records: dict[Any, TrialRecord], plan: Sequence[TrialSpec]) -> None:
    for spec in plan:
        record = records.get(spec.key)
        if record is not None and (record.seed, record.horizon) != (spec.seed, spec.horizon):
            raise ResultsError(
                f"{path}: {spec.task} trial {spec.trial} was run with seed {record.seed} and horizon {record.horizon}, "
                f"this version plans {spec.seed} and {spec.horizon}: choose another --out."
            )


def _last_line(text: str) -> str:
    return next((line for line in reversed(text.splitlines()) if line.strip()), "")


def _write_config(path: Path, config: EvaluationConfig) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(yaml.safe_dump(dataclasses.asdict(config), sort_keys=False), encoding="utf-8")
    part.replace(path)


@contextmanager
def _only_writer(out: Path) -> Iterator[None]:
    """Hold the folder's lock, which the system frees when this process ends in whatever way."""
    descriptor = os.open(out / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ResultsError(
                f"{out}: another evaluation is writing here; wait for it, or choose another --out."
            ) from error
        yield
    finally:
        os.close(descriptor)
