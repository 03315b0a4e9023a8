"""Reading runs for a report: policies with their tasks, groups of tasks, and which trials are the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation import published
from robocasa_lerobot.evaluation.published.places import PERTURBATIONS, Place, places, tables
from robocasa_lerobot.evaluation.report.joining import join
from robocasa_lerobot.evaluation.results import (
    TRIALS_FILE,
    UNPERTURBED,
    PolicyInfo,
    Results,
    RunHeader,
    TrialRecord,
    read_results,
)
from robocasa_lerobot.evaluation.statistics import Estimate, Rate, average_over_tasks, success_rate
from robocasa_lerobot.evaluation.statistics.horizon import time_to_success
from robocasa_lerobot.evaluation.statistics.paired import Outcomes

REFERENCES = {
    "random": "reference: actions drawn uniformly from [-1, 1] at each step",
    "zero": "reference: every action component zero",
    "demonstrator": "reference: the scripted demonstrator, which sees the simulator's state",
    "replay": "reference: stored actions played again",
}
LIFELONG_SETS = tuple(f"lifelong_phase{phase}" for phase in range(1, 5))
GROUP_LABELS = {
    "atomic_seen": "Atomic",
    "composite_seen": "Composite, seen",
    "composite_unseen": "Composite, unseen",
    "lifelong_phase1": "Phase 1: atomic",
    "lifelong_phase2": "Phase 2: 2-3 stages",
    "lifelong_phase3": "Phase 3: 4-5 stages",
    "lifelong_phase4": "Phase 4: 6+ stages",
}
# What decides whether two trials had the same scene, start, wording and rules; the policy alone may differ.
_SAME_RULES = ("render_preset", "success_rule", "success_hold_steps")


@dataclass(frozen=True)
class TermCount:
    """A success term in the failed trials of a task: in how many it never held, and was lost again by the end."""

    name: str
    never: int
    lost: int


@dataclass(frozen=True)
class TaskResult:
    """The trials of one policy on one task under one perturbation; `median_seconds` is simulated time to success."""

    task: str
    trials: tuple[TrialRecord, ...]
    rate: Rate
    errors: int
    median_seconds: float | None
    failed: int
    terms: tuple[TermCount, ...]

    @property
    def counts(self) -> tuple[int, int]:
        """Successes and trials."""
        return self.rate.successes, self.rate.trials


@dataclass(frozen=True, eq=False)
class PolicyResult:
    """All trials of one policy in one run; `folder` is where they and their videos lie.

    `conditions` has the tasks under each perturbation, the unperturbed ones (where there are any) first. One that was
    joined of several policies (`joining`) has these in `parts`; `folder` is then that of the first.
    """

    label: str
    folder: Path
    info: PolicyInfo
    headers: tuple[RunHeader, ...]
    conditions: dict[str, tuple[TaskResult, ...]]
    parts: tuple[PolicyResult, ...] = ()

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Where the policy stands in the published tables."""
        one = self.parts[0] if self.parts else self
        perturbed = len(one.conditions) > 1
        found = places(one.info, one.header)
        return tuple(p for p in found if perturbed or tables()[p.table].get("columns_are") != PERTURBATIONS)

    @property
    def header(self) -> RunHeader:
        """The header of the first of its runs; those of shards differ in nothing that decides a trial."""
        return self.headers[0]

    @property
    def tasks(self) -> tuple[TaskResult, ...]:
        """The tasks without perturbation, or under the only kind there is."""
        return next(iter(self.conditions.values()))

    @property
    def condition(self) -> str:
        """The perturbation that `tasks` are under."""
        return next(iter(self.conditions))

    @cached_property
    def average(self) -> Estimate:
        """The mean over tasks, each weighing the same."""
        return average_of(self.tasks)

    @property
    def trials(self) -> int:
        """Trials of `tasks`."""
        return sum(result.rate.trials for result in self.tasks)

    @property
    def errors(self) -> int:
        """Trials of `tasks` that ended in an error."""
        return sum(result.errors for result in self.tasks)

    def task(self, name: str, condition: str | None = None) -> TaskResult | None:
        """The result on task `name`, if it was evaluated."""
        tasks = self.conditions.get(condition or self.condition, ())
        return next((result for result in tasks if result.task == name), None)

    def group(self, name: str, condition: str | None = None) -> tuple[TaskResult, ...]:
        """The results on the tasks of a group (`atomic_seen`, `lifelong_phase2`); "average" is all groups of 50."""
        groups = published.group_of_task()
        tasks = self.conditions.get(condition or self.condition, ())
        if name == "average":
            return tuple(result for result in tasks if result.task in groups)
        if name in published.GROUPS:
            return tuple(result for result in tasks if groups.get(result.task) == name)
        members = {task for header in self.headers for task in header.task_sets.get(name, ())}
        return tuple(result for result in tasks if result.task in members)


@dataclass(frozen=True)
class ReportData:
    """The policies that a report compares, in its order, and the names of their tasks; joined ones count once."""

    title: str
    policies: tuple[PolicyResult, ...]
    task_names: tuple[str, ...]

    @property
    def single(self) -> tuple[PolicyResult, ...]:
        """The policies as they were evaluated, each with one run's trials."""
        return tuple(part for policy in self.policies for part in (policy.parts or (policy,)))

    @property
    def synthetic(self) -> bool:
        """Whether some of the trials were never run, but made to show what a report looks like."""
        return any(header.settings.get("synthetic") for policy in self.policies for header in policy.headers)

    def series(self, policy: PolicyResult) -> int:
        """The policy's number in the palette."""
        return self.policies.index(policy)


def gather(results: Sequence[Path], title: str | None = None) -> ReportData:
    """Read runs.

    Args:
        results: folders with a `trials.jsonl`, or outputs of trainings with evaluations.
        title: heading; default: made from the protocol and the tasks.

    Raises:
        UserError: a folder without results, an empty results file, or a file that cannot be read.
    """
    once = {run.resolve(): run for folder in results for run in runs_in(folder)}  # one that is named twice is one
    policies = tuple(policy for folder in once.values() for policy in _read_policies(folder))
    if not policies:
        raise UserError(f"no trials in {', '.join(map(str, results))}: run `robocasa-lerobot eval` first.")
    policies = _with_distinct_labels(join(_with_distinct_labels(policies)))
    names = tuple(dict.fromkeys(result.task for policy in policies for result in policy.tasks))
    return ReportData(title or _title(policies, names), policies, names)


def runs_in(folder: Path) -> list[Path]:
    """The folder itself, or the evaluations of each phase where it is the output of a training."""
    if not folder.is_dir() or (folder / TRIALS_FILE).is_file():
        return [folder]
    found = sorted(folder.glob(f"*/evaluations/*/{TRIALS_FILE}"), key=lambda path: path.stat().st_mtime)
    return [path.parent for path in found] or [folder]


def summarize(task: str, trials: Sequence[TrialRecord]) -> TaskResult:
    """The result of one policy on one task; a trial that ended in an error counts as a failure."""
    ordered = tuple(sorted(trials, key=lambda record: record.trial))
    times = time_to_success([r.first_success_step for r in ordered])
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
        median_seconds=None if times is None else times.median / contract.CONTROL_HZ,
        failed=len(failed),
        terms=tuple(sorted(terms, key=lambda term: (-term.never, -term.lost))),
    )


def average_of(tasks: Iterable[TaskResult]) -> Estimate:
    """The mean over tasks with its interval.

    Raises:
        UserError: no tasks.
    """
    return average_over_tasks([result.counts for result in tasks])


def same_trials(
    a: PolicyResult, b: PolicyResult, condition_a: str | None = None, condition_b: str | None = None
) -> Mapping[str, tuple[Outcomes, Outcomes]]:
    """Task -> successes of A and of B on the trials that both ran: same seed, kitchens, horizon and rules."""
    if any(getattr(a.header, rule) != getattr(b.header, rule) for rule in _SAME_RULES):
        return {}
    out = {}
    for result in a.conditions.get(condition_a or a.condition, ()):
        other = b.task(result.task, condition_b)
        if other is None:
            continue
        theirs = {_start(record): record.success for record in other.trials}
        pairs = [(r.success, theirs[_start(r)]) for r in result.trials if _start(r) in theirs]
        if pairs:
            columns = np.array(pairs, dtype=bool)
            out[result.task] = (columns[:, 0], columns[:, 1])
    return out


def _start(record: TrialRecord) -> tuple[object, ...]:
    return (record.task, record.trial, record.seed, record.split, record.horizon)


def describe_policy(policy: PolicyResult) -> str:
    """What a policy is, in a phrase."""
    info = policy.info
    if info.path in REFERENCES:
        return REFERENCES[info.path]
    facts = [info.type]
    if policy.parts:
        phases = [part.info.phase or part.label for part in policy.parts]
        facts.append(f"{len(policy.parts)} policies ({', '.join(phases)})")
    if info.experiment is not None:
        facts.append(f"experiment {info.experiment}")
    if info.phase is not None:
        facts.append(f"phase {info.phase}, step {info.step:,}" if info.step is not None else f"phase {info.phase}")
    if info.step == 0:
        facts.append("untrained")
    if info.training_data:
        facts.append(info.training_data)
    if info.demo_fraction is not None:
        facts.append(f"{100 * info.demo_fraction:g} % of the target demonstrations")
    if info.lifelong_phase is not None:
        facts.append(f"after lifelong phase {info.lifelong_phase}")
    return ", ".join(facts)


def _read_policies(folder: Path) -> list[PolicyResult]:
    results = read_results(folder)
    by_label: dict[str, dict[str, dict[str, list[TrialRecord]]]] = {}
    for record in results.trials:
        conditions = by_label.setdefault(record.label, {})
        conditions.setdefault(record.perturbation, {}).setdefault(record.task, []).append(record)
    out = []
    for label, conditions in by_label.items():
        names = sorted(conditions, key=lambda name: name != UNPERTURBED)
        tasks = {name: tuple(summarize(*item) for item in conditions[name].items()) for name in names}
        out.append(PolicyResult(label, folder, _info(results, tasks), _headers(results, tasks), tasks))
    return sorted(out, key=_training_order)


def _headers(results: Results, conditions: Mapping[str, Sequence[TaskResult]]) -> tuple[RunHeader, ...]:
    runs = dict.fromkeys(r.run for tasks in conditions.values() for result in tasks for r in result.trials)
    return tuple(results.headers[run] for run in runs)


def _info(results: Results, conditions: Mapping[str, Sequence[TaskResult]]) -> PolicyInfo:
    return results.policy_of(next(iter(conditions.values()))[0].trials[0])


def _training_order(policy: PolicyResult) -> tuple[bool, int]:
    # Reference policies first, then the untrained one; sorting is stable, so the rest keeps its order.
    return (policy.info.path not in REFERENCES, -1 if policy.info.step == 0 else 0)


def _with_distinct_labels(policies: tuple[PolicyResult, ...]) -> tuple[PolicyResult, ...]:
    folders: dict[str, list[Path]] = {}
    for policy in policies:
        folders.setdefault(policy.label, []).append(policy.folder)
    return tuple(
        dataclasses.replace(policy, label=f"{policy.label} ({_end_of(policy.folder, folders[policy.label])})")
        if len(folders[policy.label]) > 1
        else policy
        for policy in policies
    )


def _end_of(folder: Path, folders: Sequence[Path]) -> str:
    """As much of the end of a folder's path as tells it from the others."""
    for length in range(1, len(folder.parts) + 1):
        end = folder.parts[-length:]
        if sum(other.parts[-length:] == end for other in folders) == 1:
            return "/".join(end)
    return str(folder)


def _title(policies: Sequence[PolicyResult], names: Sequence[str]) -> str:
    shown = " and ".join(", ".join(names).rsplit(", ", 1)) if len(names) <= 3 else f"{len(names)} tasks"
    protocols = {policy.header.protocol for policy in policies}
    if len(protocols) == 1 and (protocol := protocols.pop()) != "custom":
        return f"{protocol[:1].upper()}{protocol[1:]} evaluation on {shown}"
    return f"Evaluation on {shown}"
