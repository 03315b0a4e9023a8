"""What a report shows, computed from results files, training metrics and demonstration files; no formatting."""

from __future__ import annotations

import json
import statistics as median_of
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.results import TrialRecord, read_results
from robocasa_lerobot.evaluation.statistics import Rate, success_rate


@dataclass(frozen=True)
class TermCount:
    """A success term in the failed trials of a task: in how many it never held, and was lost again by the end."""

    name: str
    never: int
    lost: int


@dataclass(frozen=True)
class TaskResult:
    """The trials of one policy on one task; `median_seconds` is simulated time to success."""

    task: str
    trials: tuple[TrialRecord, ...]
    rate: Rate
    errors: int
    median_seconds: float | None
    failed: int
    terms: tuple[TermCount, ...]


@dataclass(frozen=True)
class PolicyResult:
    """All trials of one policy under one set of settings; `folder` is where they and their videos lie."""

    label: str
    folder: Path
    policy: dict[str, Any]
    settings: dict[str, Any]
    versions: dict[str, str]
    git_commits: tuple[str, ...]
    tasks: tuple[TaskResult, ...]
    pooled: Rate

    def task(self, name: str) -> TaskResult | None:
        """The result on task `name`, if it was evaluated."""
        return next((result for result in self.tasks if result.task == name), None)


@dataclass(frozen=True)
class TrainingPhase:
    """The loss curve of a training phase."""

    name: str
    steps: tuple[int, ...]
    losses: tuple[float, ...]


@dataclass(frozen=True)
class Training:
    """A training's phases in order, and its settings as they were saved."""

    folder: Path
    phases: tuple[TrainingPhase, ...]
    experiment: str


@dataclass(frozen=True)
class DemonstratorResult:
    """How often the demonstrator that made the training data solved a task."""

    task: str
    rate: Rate


@dataclass(frozen=True)
class Published:
    """Published numbers for the evaluated tasks, in percent, and what they are."""

    source: str
    note: str
    per_task_what: str
    per_task: dict[str, float]
    averages: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class ReportData:
    """Everything that a report shows."""

    title: str
    policies: tuple[PolicyResult, ...]
    published: Published
    trainings: tuple[Training, ...] = ()
    demonstrators: tuple[DemonstratorResult, ...] = ()
    task_names: tuple[str, ...] = field(default=())


def gather(
    results: Sequence[Path], training: Sequence[Path] = (), demos: Sequence[Path] = (), title: str | None = None
) -> ReportData:
    """Read everything a report needs.

    Args:
        results: folders with a `trials.jsonl`.
        training: output folders of trainings; without any, those that the evaluated checkpoints came from.
        demos: HDF5 files of demonstrations, for the demonstrator's success rate.
        title: heading; default: made from the tasks.

    Raises:
        UserError: a folder without results, an empty results file, or a file that cannot be read.
    """
    policies = tuple(policy for folder in results for policy in _read_policies(folder))
    if not policies:
        raise UserError(f"no trials in {', '.join(map(str, results))}: run `robocasa-lerobot eval` first.")
    policies = _with_distinct_labels(policies)
    names = tuple(dict.fromkeys(result.task for policy in policies for result in policy.tasks))
    folders = list(training) or find_trainings(policies)
    shown = " and ".join(", ".join(names).rsplit(", ", 1)) if len(names) <= 3 else f"{len(names)} tasks"
    return ReportData(
        title=title or f"Evaluation on {shown}",
        policies=policies,
        published=read_published(names),
        trainings=tuple(read_training(folder) for folder in folders),
        demonstrators=tuple(result for path in demos for result in read_demonstrator(path)),
        task_names=names,
    )


def summarize(task: str, trials: Sequence[TrialRecord]) -> TaskResult:
    """The result of one policy on one task; a trial that ended in an error counts as a failure."""
    ordered = tuple(sorted(trials, key=lambda record: record.trial))
    first = [r.first_success_step for r in ordered if r.first_success_step is not None]
    failed = [r for r in ordered if not r.success and r.error is None]
    names = dict.fromkeys(name for record in failed for name in record.terms)
    terms = []
    for name in names:
        never = sum(name not in r.terms or r.terms[name].first_step is None for r in failed)
        held = sum(name in r.terms and r.terms[name].first_step is not None and not r.terms[name].final for r in failed)
        terms.append(TermCount(name, never, held))
    return TaskResult(
        task=task,
        trials=ordered,
        rate=success_rate(sum(r.success for r in ordered), len(ordered)),
        errors=sum(r.error is not None for r in ordered),
        median_seconds=median_of.median(first) / contract.CONTROL_HZ if first else None,
        failed=len(failed),
        terms=tuple(sorted(terms, key=lambda term: (-term.never, -term.lost))),
    )


def _read_policies(folder: Path) -> list[PolicyResult]:
    results = read_results(folder)
    records = results.trials
    out = []
    for label in dict.fromkeys(record.label for record in records):
        own = [record for record in records if record.label == label]
        tasks = dict.fromkeys(record.task for record in own)
        header = results.header_of(own[0])
        out.append(
            PolicyResult(
                label=label,
                folder=folder,
                policy={**asdict(results.policy_of(own[0])), "device": header.device},
                settings=header.settings,
                versions=header.versions,
                git_commits=tuple(sorted({h.git_commit for h in results.headers.values() if h.git_commit is not None})),
                tasks=tuple(summarize(task, [r for r in own if r.task == task]) for task in tasks),
                pooled=success_rate(sum(r.success for r in own), len(own)),
            )
        )
    return sorted(out, key=_training_order)


def _training_order(policy: PolicyResult) -> tuple[bool, int]:
    # Reference policies first, then by step where it is known; sorting is stable, so the rest keeps its order.
    step = policy.policy.get("step")
    return (policy.policy.get("path") not in ("random", "zero"), -1 if step == 0 else 0)


def _with_distinct_labels(policies: tuple[PolicyResult, ...]) -> tuple[PolicyResult, ...]:
    import dataclasses

    labels = [policy.label for policy in policies]
    return tuple(
        dataclasses.replace(policy, label=f"{policy.label} ({policy.folder.name})")
        if labels.count(policy.label) > 1
        else policy
        for policy in policies
    )


def find_trainings(policies: Sequence[PolicyResult]) -> list[Path]:
    """Output folders of the trainings that the evaluated checkpoints lie in, if they are still there."""
    found: dict[Path, None] = {}
    for policy in policies:
        if policy.policy.get("phase") is not None:
            # <experiment>/<phase>/checkpoints/<step>/pretrained_model
            above = Path(policy.policy["path"]).resolve().parents
            if len(above) > 3 and any(above[3].glob("*/metrics.jsonl")):
                found[above[3]] = None
    return list(found)


def read_training(folder: Path) -> Training:
    """Loss curves of a training's phases, in the order of its experiment file where it has one.

    Raises:
        UserError: no `metrics.jsonl` in the folder or one level below, or a damaged one.
    """
    files = sorted([*folder.glob("metrics.jsonl"), *folder.glob("*/metrics.jsonl")], key=lambda p: p.stat().st_mtime)
    if not files:
        raise UserError(f"{folder}: no metrics.jsonl there or one level below; expected the output of a training.")
    experiment_file = folder / "experiment.yaml"
    experiment = experiment_file.read_text(encoding="utf-8") if experiment_file.is_file() else ""
    return Training(folder, tuple(_read_phase(file) for file in files), experiment)


def _read_phase(path: Path) -> TrainingPhase:
    losses: dict[int, float] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").split("\n")[:-1], start=1):
        try:
            values = json.loads(line)
            if "loss" in values:
                losses[int(values["step"])] = float(values["loss"])
        except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}:{number}: not a line of training metrics ({error!r}).") from error
    steps = tuple(sorted(losses))
    return TrainingPhase(path.parent.name, steps, tuple(losses[step] for step in steps))


def read_demonstrator(path: Path) -> list[DemonstratorResult]:
    """Success rate of the demonstrator from the counts in an HDF5 file's `data` attributes; none if it has no counts.

    Raises:
        UserError: not an HDF5 file.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            attributes = dict(file["data"].attrs)
    except (OSError, KeyError) as error:
        raise UserError(f"{path}: not an HDF5 file of demonstrations ({error}).") from error
    if "episodes_tried" not in attributes:
        return []
    tried, failed = int(attributes["episodes_tried"]), int(attributes["episodes_failed"])
    return [DemonstratorResult(str(attributes["env"]), success_rate(tried - failed, tried))] if tried else []


def read_published(tasks: Sequence[str]) -> Published:
    """The published numbers for `tasks`."""
    table = json.loads(resources.files(__package__).joinpath("published.json").read_text(encoding="utf-8"))
    per_task = {task: table["per_task"]["percent"][task] for task in tasks if task in table["per_task"]["percent"]}
    return Published(table["source"], table["note"], table["per_task"]["what"], per_task, tuple(table["averages"]))
