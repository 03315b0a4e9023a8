"""Runs an evaluation: the plan, minus recorded trials, through the workers, into `trials.jsonl`."""

from __future__ import annotations

import collections
import dataclasses
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig, check_factory, output_folder
from robocasa_lerobot.evaluation.planning import run_header as resolve
from robocasa_lerobot.evaluation.planning.sources import check_labels, open_sources, recorded_device
from robocasa_lerobot.evaluation.planning.trials import Shard, TrialSpec, make_plan, running_order, to_film
from robocasa_lerobot.evaluation.records.results import (
    REPLAY,
    SHARDS_FOLDER,
    TRIALS_FILE,
    PolicyInfo,
    Results,
    ResultsError,
    RunHeader,
    Seconds,
    TrialKey,
    TrialRecord,
    read_results,
)
from robocasa_lerobot.evaluation.records.trials_file import append, check_same_run, drop_torn_line
from robocasa_lerobot.evaluation.run.messages import WorkerSettings
from robocasa_lerobot.evaluation.run.serving import check_devices, open_servers, served_labels
from robocasa_lerobot.evaluation.run.worker_pool import Completed, WorkerPool
from robocasa_lerobot.evaluation.simulators.planning import plan_simulator
from robocasa_lerobot.evaluation.simulators.simulator import FOREIGN_FACTORY, env_arguments, simulator_of
from robocasa_lerobot.files import write_text
from robocasa_lerobot.gl import check_device
from robocasa_lerobot.jobs.locks import LockHeldError, locked
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.provenance import utc_now

CONFIG_FILE = "evaluation.yaml"


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """An evaluation that is ready to run; making one opens no process and writes no file.

    `plan` is the whole one, `todo_plan` the part of this shard; `out` is this shard's folder.
    """

    config: EvaluationConfig
    sources: dict[str, PolicySource]
    header: RunHeader
    plan: list[TrialSpec]
    todo_plan: list[TrialSpec]
    out: Path


def prepare(config: EvaluationConfig, ask: bool = True, here: bool = True) -> Evaluation:
    """Check everything that the user named, and fix the plan.

    Policies behind a socket are asked once; without `ask`, what the results in the output folder say of them counts.
    Without `here` the trials run or ran on other machines: this one need not have their devices, and where the
    settings leave the choice of one, that of the results in the output folder counts.

    Raises:
        UserError: an unknown task, a folder that is no checkpoint, a server that does not answer as it should, two
            policies with one label, a device that this machine does not have, ...
    """
    for number in config.env.render_devices if here else ():
        check_device(number)
    check_factory(config.env.factory)
    tasks = resolve.plan_tasks(config.env, config.first_sets)
    simulator = simulator_of(config.env.python, config.env.type, config.env.factory, config.env.options)
    sources, image_size = open_sources(config, ask)
    check_labels(source.label for source in sources)
    by_label = {source.label: source for source in sources}
    out = output_folder(config, list(by_label))
    device = _device(config.policy.device, any(source.is_checkpoint for source in sources), out, here)
    if device != "auto":
        check_devices(config.policy.devices, device, here)
    kinds = [source.type for source in sources if source.is_checkpoint]
    settings = resolve.outcome_settings(config, image_size, device, kinds)
    seeds = _stored_seeds(sources, config, settings, list(tasks.horizons))
    if simulator is not None:
        seeds = plan_simulator(simulator, config, sources, settings)
    phases: list[int | None] = [*config.policy.lifelong_phase] if config.lifelong else [None] * len(sources)
    own_tasks = {label: tasks.of_policy(phase) for label, phase in zip(by_label, phases, strict=True)}
    plan = make_plan(
        own_tasks, tasks.horizons, config.trials, config.seed, config.videos, config.perturbation.names, seeds
    )
    header = resolve.run_header(config, _describe(sources, config), tasks, settings)
    if config.shard is None:
        return Evaluation(config, by_label, header, plan, plan, out)
    shard = Shard.parse(config.shard)
    return Evaluation(config, by_label, header, plan, shard.of(plan), shard_folder(out, shard))


def _device(asked: str, needs_torch: bool, out: Path, here: bool) -> str:
    """What the policies compute on: a device of this machine, or of those where the trials run."""
    if here or not needs_torch:
        return resolve.resolve_device(asked, needs_torch)
    return asked if asked != "auto" else recorded_device(out) or asked


def shard_folder(out: Path, shard: Shard) -> Path:
    """Where a shard's results go."""
    return out / SHARDS_FOLDER / f"{shard.index}-of-{shard.count}"


def _describe(sources: Sequence[PolicySource], config: EvaluationConfig) -> dict[str, PolicyInfo]:
    described = {}
    for index, source in enumerate(sources):
        policy = config.policy
        described[source.label] = dataclasses.replace(
            source.describe(),
            lifelong_phase=policy.lifelong_phase[index] if policy.lifelong_phase else None,
            demo_fraction=policy.demo_fraction[index] if policy.demo_fraction else None,
            training_data=policy.training_data[index] if policy.training_data else None,
        )
    return described


def _stored_seeds(
    sources: Sequence[PolicySource], config: EvaluationConfig, settings: dict[str, Any], tasks: Sequence[str]
) -> dict[str, list[int]]:
    """Scene seeds of the episodes that are replayed, by task; {} where nothing is. They go into the settings."""
    replays = [source for source in sources if source.type == REPLAY]
    if not replays:
        return {}
    if len(replays) > 1:
        raise UserError("one replay:FILE at a time: its scenes are the trials' scenes.")
    from robocasa_lerobot.evaluation.actors.stored_episodes import one_per_scene, read_episodes

    file = Path(replays[0].path.partition(":")[2])
    seeds: dict[str, list[int]] = {}
    for task, split, seed in one_per_scene(read_episodes(file)):
        if split == config.env.split:
            seeds.setdefault(task, []).append(seed)
    for task in tasks:
        found = len(seeds.get(task, []))
        if found < config.trials:
            raise UserError(
                f"{file}: {found} episodes of {task} in {config.env.split} scenes, {config.trials} trials "
                "(several episodes of one scene count once): "
                f"use --trials={found} or fewer, other --env.tasks, or --env.split."
            )
    settings["scenes_of"] = replays[0].fingerprint
    return seeds


def evaluate(evaluation: Evaluation) -> list[TrialRecord]:
    """Run the trials that are not recorded yet; the records of the plan (or shard), in its order.

    Each trial is appended to `trials.jsonl` as it ends: after a kill the same call runs the missing ones only.

    Raises:
        ResultsError: the output folder holds trials of other settings, or another process writes to it.
        UserError: a policy or an env cannot be built.
    """
    out, header = evaluation.out, evaluation.header
    out.mkdir(parents=True, exist_ok=True)
    path = out / TRIALS_FILE
    with only_writer(out):
        if drop_torn_line(path):
            print(f"{path}: the last line was cut off by a kill; its trial runs again.", file=sys.stderr)
        earlier_runs = read_results(path) if path.exists() else Results(path, {}, [])
        check_same_run(path, earlier_runs.headers.values(), header)
        records = {record.key: record for record in earlier_runs.trials}
        check_plan(path, records, evaluation.todo_plan)
        write_text(out / CONFIG_FILE, yaml.safe_dump(dataclasses.asdict(evaluation.config), sort_keys=False))
        retry = evaluation.config.retry_errors
        todo = [spec for spec in evaluation.todo_plan if _is_missing(records.get(spec.key), retry)]
        if header.id != next(reversed(earlier_runs.headers), None):  # what was said last counts, also if said before
            append(path, header)
        for completed in _run(evaluation, running_order(todo), records):
            record = _record(completed, header)
            earlier = records.get(record.key)
            if earlier is not None and earlier.error is None:
                record = _with_film(earlier, record, out)
            append(path, record)
            records[record.key] = record
    return [records[spec.key] for spec in evaluation.todo_plan]


def showcase(
    plan: Sequence[TrialSpec], records: Mapping[TrialKey, TrialRecord], never: Collection[str] = ()
) -> list[TrialSpec]:
    """Trials to run once more for their films: those to film that have none, and others that show what no film does.

    The former were run before so many films were asked for, the latter are the first success and the first failure.
    Which trials succeed is not known when the filmed ones are fixed; a trial can be run again, because it takes the
    same course. Only policies that are filmed at all are looked at, and not those in `never`, whose trials take no
    course twice.
    """
    chosen: list[TrialSpec] = []
    groups: dict[tuple[str, str], list[TrialSpec]] = {}
    for spec in plan:
        if spec.label not in never:
            groups.setdefault((spec.label, spec.task), []).append(spec)
    for specs in groups.values():
        if not any(spec.film for spec in specs):
            continue
        done = [s for s in specs if s.key in records and records[s.key].error is None]
        asked = [s for s in done if s.film and records[s.key].video is None]
        chosen += asked
        for success in (True, False):
            these = [s for s in done if records[s.key].success is success]
            if these and all(records[s.key].video is None and s not in asked for s in these):
                chosen.append(to_film(these[0]))
    return chosen


def worker_settings(evaluation: Evaluation) -> WorkerSettings:
    """What the workers of an evaluation need."""
    config, header = evaluation.config, evaluation.header
    factory, env_kwargs = config.env.factory, {"split": config.env.split, "render_preset": config.env.render_preset}
    simulator = simulator_of(config.env.python, config.env.type, factory, config.env.options)
    if simulator is not None:
        factory, env_kwargs = FOREIGN_FACTORY, env_arguments(simulator)
    return WorkerSettings(
        sources=evaluation.sources,
        factory=factory,
        env_kwargs={**env_kwargs, "image_size": header.image_size or None},
        device=header.device,
        threads=config.policy.threads,
        executed_steps=config.executed_steps,
        out=str(evaluation.out),
        render_devices=tuple(config.env.render_devices),
        perturbations={name: resolve.env_arguments(name, config.perturbation) for name in config.perturbation.names},
        success_rule=config.success.rule,
        success_hold_steps=config.success.hold_steps,
        width=header.settings["batch_width"],
        runtime=config.policy.runtime,
        served=served_labels(evaluation.sources, config.policy, header.device),
    )


def _run(
    evaluation: Evaluation, todo: Sequence[TrialSpec], records: Mapping[TrialKey, TrialRecord]
) -> Iterator[Completed]:
    """The missing trials, then the ones to film, with a progress bar; `records` grows while this runs."""
    never = {label for label, source in evaluation.sources.items() if not source.repeats}
    if not todo and not showcase(evaluation.todo_plan, records, never):
        print(f"all {len(evaluation.todo_plan)} trials are in {evaluation.out / TRIALS_FILE}: nothing to run.")
        return
    config, settings = evaluation.config, worker_settings(evaluation)
    total = len(evaluation.todo_plan)
    counts = collections.Counter[str]()
    with (
        open_servers(settings, config) as servers,
        Bar(total=total, initial=total - len(todo), unit="trial", desc="trials", dynamic_ncols=True) as bar,
    ):
        pool = WorkerPool(settings, config.worker_count(total), config.stall_seconds, servers)

        def more() -> list[TrialSpec]:
            specs = showcase(evaluation.todo_plan, records, never)
            bar.total = (bar.total or 0) + len(specs)
            if specs:
                bar.set_description("films")
            return specs

        for completed in pool.run(todo, more):
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
    """The record of a trial that was run again for its film, with the film if it took the same course."""
    if again.video is not None and again.trajectory == earlier.trajectory:
        return dataclasses.replace(earlier, video=again.video)
    happened = "took another course when it was run again for its film: policy or env is not deterministic"
    if again.error is not None:
        happened = f"ended in an error when it was run again for its film: {_last_line(again.error).rstrip('.')}"
    print(
        f"{earlier.label} {earlier.task} trial {earlier.trial} {happened}. The first run counts, without a film.",
        file=sys.stderr,
    )
    if again.video is not None:
        (out / again.video).unlink(missing_ok=True)
    return earlier


def _record(completed: Completed, header: RunHeader) -> TrialRecord:
    spec, result, earlier = completed.spec, completed.result, completed.earlier
    outcome = result.outcome
    seconds = outcome.seconds if result.error is None else Seconds(total=result.wall_seconds)
    return TrialRecord(
        run=header.id,
        label=spec.label,
        task=spec.task,
        perturbation=spec.perturbation,
        trial=spec.trial,
        seed=spec.seed,
        policy_seed=spec.policy_seed,
        split=header.split,
        layout_id=outcome.layout_id,
        style_id=outcome.style_id,
        instruction=outcome.instruction,
        horizon=spec.horizon,
        horizon_multiplier=header.horizon_multiplier,
        success=outcome.success,
        first_success_step=outcome.first_success_step,
        steps=outcome.steps,
        terms=outcome.terms,
        stages=outcome.stages,
        outcome=result.kind,
        error=result.error,
        attempts=completed.attempts,
        first_outcome=earlier.kind if earlier else None,
        first_error=earlier.error if earlier else None,
        warnings=outcome.warnings,
        trajectory=outcome.trajectory,
        video=result.video,
        seconds=Seconds(**{name: round(value, 4) for name, value in dataclasses.asdict(seconds).items()}),
        finished=utc_now(),
        fps=outcome.fps,
    )


def _is_missing(record: TrialRecord | None, retry_errors: bool) -> bool:
    return record is None or (retry_errors and record.error is not None)


def check_plan(path: Path, records: Mapping[TrialKey, TrialRecord], plan: Sequence[TrialSpec]) -> None:
    """The recorded trials must be those that this version plans.

    Raises:
        ResultsError: a recorded trial had another seed or horizon.
    """
    for spec in plan:
        record = records.get(spec.key)
        planned = (spec.seed, spec.policy_seed, spec.horizon)
        if record is not None and (record.seed, record.policy_seed, record.horizon) != planned:
            raise ResultsError(
                f"{path}: {spec.task} trial {spec.trial} was run with seed {record.seed} and horizon {record.horizon}, "
                f"this version plans {spec.seed} and {spec.horizon}: choose another --out."
            )


def _last_line(text: str) -> str:
    return next((line for line in reversed(text.splitlines()) if line.strip()), "")


@contextmanager
def only_writer(out: Path) -> Iterator[None]:
    """Hold the folder's lock.

    Raises:
        ResultsError: another process holds it.
    """
    try:
        with locked(out / ".lock", wait=False):
            yield
    except LockHeldError:
        raise ResultsError(
            f"{out}: another evaluation is writing here; wait for it, or choose another --out."
        ) from None
