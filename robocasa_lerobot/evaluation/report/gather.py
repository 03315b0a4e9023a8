"""Reading runs for a report: the policies in them, with their tasks."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import KITCHEN_ENV_FACTORY
from robocasa_lerobot.evaluation.records.results import (
    TRIALS_FILE,
    UNPERTURBED,
    PolicyInfo,
    Results,
    RunHeader,
    TrialRecord,
    read_results,
)
from robocasa_lerobot.evaluation.report.joining import join
from robocasa_lerobot.evaluation.report.policies import (
    PolicyResult,
    ReportData,
    TaskResult,
    TermCount,
    is_reference,
    label_under,
)
from robocasa_lerobot.evaluation.statistics import success_rate
from robocasa_lerobot.evaluation.statistics.horizon import time_to_success

_LABELS = ("lifelong_phase", "demo_fraction", "training_data")  # that a user gives for the report


def gather(results: Sequence[Path], title: str | None = None) -> ReportData:
    """Read runs.

    Args:
        results: folders with a `trials.jsonl`, such files of whatever name, or outputs of trainings with evaluations.
        title: heading; default: made from the protocol and the tasks.

    Raises:
        UserError: a folder without results, an empty results file, or a file that cannot be read.
    """
    once = {run.resolve(): run for folder in results for run in runs_in(folder)}  # one that is named twice is one
    runs = {folder: read_results(folder) for folder in once.values()}
    policies = tuple(policy for run in runs.values() for policy in _policies(run))
    if not policies:
        raise UserError(f"no trials in {', '.join(map(str, results))}: run `robocasa-lerobot eval` first.")
    policies = _with_distinct_labels(join(_with_distinct_labels(policies)))
    names = tuple(dict.fromkeys(result.task for policy in policies for result in policy.tasks))
    not_begun = tuple(label for run in runs.values() for label in _not_begun(run))
    return ReportData(title or _title(policies, names), policies, names, not_begun)


def runs_in(folder: Path) -> list[Path]:
    """The folder itself, or the evaluations of each phase where it is the output of a training."""
    if not folder.is_dir() or (folder / TRIALS_FILE).is_file():
        return [folder]
    found = sorted(folder.glob(f"*/evaluations/*/{TRIALS_FILE}"), key=lambda path: path.stat().st_mtime)
    return [path.parent for path in found] or [folder]


def summarize(task: str, trials: Sequence[TrialRecord], fps: float | None = contract.CONTROL_HZ) -> TaskResult:
    """The result of one policy on one task; a trial that ended in an error counts as a failure.

    `fps` is control steps a second where a record does not say, None where nobody does.
    """
    ordered = tuple(sorted(trials, key=lambda record: record.trial))
    seconds = _seconds(ordered, fps)
    times = None if seconds is None else time_to_success(seconds)
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
        seconds=seconds,
        median_seconds=None if times is None else times.median,
        failed=len(failed),
        terms=tuple(sorted(terms, key=lambda term: (-term.never, -term.lost))),
    )


def _seconds(trials: Sequence[TrialRecord], fps: float | None) -> tuple[float | None, ...] | None:
    """Simulated time to success of each trial; None where a solved one does not tell it."""
    out: list[float | None] = []
    for record in trials:
        rate = record.fps or fps
        if record.first_success_step is None:
            out.append(None)
        elif rate is None:
            return None
        else:
            out.append(record.first_success_step / rate)
    return tuple(out)


def _policies(results: Results) -> list[PolicyResult]:
    # In the order of the plan: that in which trials end depends on horizons, workers and machines.
    order = _places(name for header in results.headers.values() for name in header.policies)
    places = _places(name for header in results.headers.values() for name in header.tasks)
    last = len(places)
    by_label: dict[str, dict[str, dict[str, list[TrialRecord]]]] = {}
    for record in sorted(results.trials, key=lambda one: (order[one.label], places.get(one.task, last))):
        conditions = by_label.setdefault(record.label, {})
        conditions.setdefault(record.perturbation, {}).setdefault(record.task, []).append(record)
    out = []
    fps = _own_fps(next(iter(results.headers.values()))) if by_label else None
    for label, conditions in by_label.items():
        names = sorted(conditions, key=lambda name: name != UNPERTURBED)
        tasks = {name: tuple(summarize(*item, fps) for item in conditions[name].items()) for name in names}
        info, headers, planned = _info(results, tasks), _headers(results, tasks), _planned(results, label)
        folder, file = results.path.parent, results.path.name
        out.append(PolicyResult(label_under(label, names[0]), folder, info, headers, tasks, planned=planned, file=file))
    return sorted(out, key=_training_order)


def _places(names: Iterable[str]) -> dict[str, int]:
    return {name: place for place, name in enumerate(dict.fromkeys(names))}


def _own_fps(header: RunHeader) -> float | None:
    """Control steps a second in our kitchens; None in another env, whose records say it, if it does."""
    kitchens = header.settings.get("factory", KITCHEN_ENV_FACTORY) == KITCHEN_ENV_FACTORY
    return contract.CONTROL_HZ if kitchens else None


def _planned(results: Results, label: str) -> dict[tuple[str, str], int]:
    """Trials that a file's runs planned for a policy, by perturbation and task; of each the last run counts."""
    tried = {record.task for record in results.trials if record.label == label}
    out: dict[tuple[str, str], int] = {}
    for header in results.headers.values():
        if label in header.policies:
            phase = header.policies[label].lifelong_phase or 0
            first = {task for tasks in list(header.task_sets.values())[:phase] for task in tasks}
            # No header says whether the phase left the policy the tasks of its phases, or was a label alone: other
            # tasks, which are the longest and so run first, tell.
            tasks = [task for task in header.tasks if task in first] if tried <= first else header.tasks
            out |= {(name, task): header.trials for name in header.perturbations for task in tasks}
    return out


def _not_begun(results: Results) -> list[str]:
    """Labels of policies that a file's runs planned, and of which it has no trial."""
    planned = dict.fromkeys(label for header in results.headers.values() for label in header.policies)
    begun = {record.label for record in results.trials}
    return [label for label in planned if label not in begun]


def _headers(results: Results, conditions: Mapping[str, Sequence[TaskResult]]) -> tuple[RunHeader, ...]:
    runs = dict.fromkeys(r.run for tasks in conditions.values() for result in tasks for r in result.trials)
    return tuple(results.headers[run] for run in runs)


def _info(results: Results, conditions: Mapping[str, Sequence[TaskResult]]) -> PolicyInfo:
    """The policy as the run of its first trial describes it, with the labels that any run was given last."""
    info = results.policy_of(next(iter(conditions.values()))[0].trials[0])
    told = [header.policies[info.label] for header in results.headers.values() if info.label in header.policies]
    given = {name: value for policy in told for name in _LABELS if (value := getattr(policy, name)) is not None}
    return dataclasses.replace(info, **given)


def _training_order(policy: PolicyResult) -> tuple[bool, int]:
    # Reference policies first, then the untrained one; sorting is stable, so the rest keeps its order.
    return (not is_reference(policy), -1 if policy.info.step == 0 else 0)


def _with_distinct_labels(policies: tuple[PolicyResult, ...]) -> tuple[PolicyResult, ...]:
    found: dict[str, list[Path]] = {}
    for policy in policies:
        found.setdefault(policy.label, []).append(_place(policy))
    return tuple(
        dataclasses.replace(policy, label=f"{policy.label} ({_end_of(_place(policy), found[policy.label])})")
        if len(found[policy.label]) > 1
        else policy
        for policy in policies
    )


def _place(policy: PolicyResult) -> Path:
    """The folder of a policy's results, or the file where it is called otherwise than each folder's."""
    return policy.folder if policy.file == TRIALS_FILE else policy.folder / policy.file


def _end_of(place: Path, places: Sequence[Path]) -> str:
    """As much of the end of a path as tells it from the others."""
    for length in range(1, len(place.parts) + 1):
        end = place.parts[-length:]
        if sum(other.parts[-length:] == end for other in places) == 1:
            return "/".join(end)
    return str(place)


def _title(policies: Sequence[PolicyResult], names: Sequence[str]) -> str:
    shown = " and ".join(", ".join(names).rsplit(", ", 1)) if len(names) <= 3 else f"{len(names)} tasks"
    protocols = {policy.header.protocol for policy in policies}
    if len(protocols) == 1 and (protocol := protocols.pop()) != "custom":
        return f"{protocol[:1].upper()}{protocol[1:]} evaluation on {shown}"
    return f"Evaluation on {shown}"
