"""What a report compares: policies with their tasks, and questions about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.config.evaluation import KITCHEN_ENV_FACTORY
from robocasa_lerobot.evaluation.records.results import (
    REFERENCE_TYPES,
    TRIALS_FILE,
    UNPERTURBED,
    PolicyInfo,
    RunHeader,
    TrialRecord,
)
from robocasa_lerobot.evaluation.report.places import PERTURBATIONS, Place, places, tables
from robocasa_lerobot.evaluation.statistics import Estimate, Rate, average_over_tasks
from robocasa_lerobot.evaluation.statistics.paired import Outcomes
from robocasa_lerobot.evaluation.statistics.progress import mean_progress

REFERENCES = {  # by type: the path of one that is replayed names its file too
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
# Settings of a run that say which simulator its trials ran in; results have only those that say something.
_SIMULATOR = ("factory", "type", "simulator", "options")


@dataclass(frozen=True)
class TermCount:
    """A success term in the failed trials of a task: in how many it never held, and was lost again by the end."""

    name: str
    never: int
    lost: int


@dataclass(frozen=True)
class TaskResult:
    """The trials of one policy on one task under one perturbation.

    `seconds` is the simulated time to success of each trial, None of one without; as a whole None, like their median,
    where the env does not say how long a step is.
    """

    task: str
    trials: tuple[TrialRecord, ...]
    rate: Rate
    errors: int
    seconds: tuple[float | None, ...] | None
    median_seconds: float | None
    failed: int
    terms: tuple[TermCount, ...]

    @cached_property
    def progress(self) -> Estimate | None:
        """Mean share of the stages that trials met; None where no trial says. One that broke has met none."""
        known = [r for r in self.trials if r.stages is not None or r.error is not None]
        if all(r.stages is None for r in known):
            return None
        return mean_progress([0.0 if r.stages is None else r.stages.progress for r in known])

    @property
    def stages(self) -> int | None:
        """The most stages that a trial of the task had; None where no trial says."""
        return max((r.stages.total for r in self.trials if r.stages is not None), default=None)

    @property
    def counts(self) -> tuple[int, int]:
        """Successes and trials."""
        return self.rate.successes, self.rate.trials


@dataclass(frozen=True, eq=False)
class PolicyResult:
    """All trials of one policy in one run; `folder` is where they, in `file`, and their videos lie.

    `conditions` has the tasks under each perturbation, the unperturbed ones (where there are any) first. One that was
    joined of several policies (`joining`) has these in `parts`; `folder` is then that of the first. `planned` has the
    trials that its runs planned, by perturbation and task; of a run that was killed not all of them are there.
    """

    label: str
    folder: Path
    info: PolicyInfo
    headers: tuple[RunHeader, ...]
    conditions: dict[str, tuple[TaskResult, ...]]
    parts: tuple[PolicyResult, ...] = ()
    planned: Mapping[tuple[str, str], int] = field(default_factory=dict)
    file: str = TRIALS_FILE

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Where the policy stands in the published tables, which are of unperturbed trials but for one."""
        one = self.parts[0] if self.parts else self

        def stands(place: Place) -> bool:
            of_perturbations = tables()[place.table].get("columns_are") == PERTURBATIONS
            return len(one.conditions) > 1 if of_perturbations else UNPERTURBED in one.conditions

        return tuple(filter(stands, places(one.info, one.header)))

    @property
    def header(self) -> RunHeader:
        """The header of the first of its runs; those of shards differ in nothing that decides a trial."""
        return self.headers[0]

    @property
    def simulator(self) -> str | None:
        """What its trials ran in, where that was not our kitchens: `lerobot:NAME`, or a factory of envs."""
        settings = self.header.settings
        factory = settings.get("factory", KITCHEN_ENV_FACTORY)
        return None if factory == KITCHEN_ENV_FACTORY else str(settings.get("type") or Path(factory).name)

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
    """The policies that a report compares, in its order, and the names of their tasks; joined ones count once.

    `not_begun` are labels of policies that the runs planned, and of which no trial is recorded.
    """

    title: str
    policies: tuple[PolicyResult, ...]
    task_names: tuple[str, ...]
    not_begun: tuple[str, ...] = ()

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


def average_of(tasks: Iterable[TaskResult]) -> Estimate:
    """The mean over tasks with its interval.

    Raises:
        UserError: no tasks.
    """
    return average_over_tasks([result.counts for result in tasks])


def same_trials(
    a: PolicyResult, b: PolicyResult, condition_a: str | None = None, condition_b: str | None = None
) -> Mapping[str, tuple[Outcomes, Outcomes]]:
    """Task -> successes of A and of B on the trials that both ran: same simulator, seed, kitchens, horizon and rules.

    Under the same perturbation too, each policy's own, unless both are named.
    """
    if any(getattr(a.header, rule) != getattr(b.header, rule) for rule in _SAME_RULES):
        return {}
    if simulator_of(a.header) != simulator_of(b.header):
        return {}
    one, two = condition_a or a.condition, condition_b or b.condition
    if one != two and (condition_a is None or condition_b is None):
        return {}
    if one == two and a.header.perturbations.get(one) != b.header.perturbations.get(two):
        return {}
    out = {}
    for result in a.conditions.get(one, ()):
        other = b.task(result.task, two)
        if other is None:
            continue
        theirs = {_start(record): record for record in other.trials}
        found = [(record, theirs[_start(record)]) for record in result.trials if _start(record) in theirs]
        pairs = [(one.success, their.success) for one, their in found if _may_share_kitchen(one, their)]
        if pairs:
            columns = np.array(pairs, dtype=bool)
            out[result.task] = (columns[:, 0], columns[:, 1])
    return out


def _start(record: TrialRecord) -> tuple[object, ...]:
    return (record.task, record.trial, record.seed, record.split, record.horizon)


def simulator_of(header: RunHeader) -> tuple[object, ...]:
    """What tells one simulator, and its adapter's settings, from another."""
    settings = {"factory": KITCHEN_ENV_FACTORY, **header.settings}
    return tuple(settings.get(name) or None for name in _SIMULATOR)


def _may_share_kitchen(a: TrialRecord, b: TrialRecord) -> bool:
    """False where both say their kitchens, and these differ: versions draw others from the same seed."""
    one, two = (a.layout_id, a.style_id), (b.layout_id, b.style_id)
    return None in one or None in two or one == two


def is_reference(policy: PolicyResult) -> bool:
    """Whether a policy was not learned, but is one of those that others are measured by."""
    return policy.info.type in REFERENCE_TYPES


def label_under(label: str, condition: str) -> str:
    """A policy's label, with the perturbation of its trials where there is one: it stands wherever they are shown."""
    return label if condition == UNPERTURBED else f"{label} (perturbed: {condition})"


def describe_policy(policy: PolicyResult) -> str:
    """What a policy is, in a phrase."""
    info = policy.info
    if is_reference(policy):
        return REFERENCES[info.type]
    facts = [info.type]
    if info.remote is not None:
        facts = [f"behind a socket ({info.remote['address']}, key map {info.remote['keys']}), weights unknown"]
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
        facts.append(
            f"after lifelong phase {info.lifelong_phase}" if info.lifelong_phase else "before lifelong phase 1"
        )
    return ", ".join(facts)


def trial_title(record: TrialRecord) -> str:
    """What a trial's square says when pointed at."""
    if record.error is not None:
        return f"trial {record.trial}, seed {record.seed}: {record.outcome}"
    result = f"success at step {record.first_success_step}" if record.success else f"failure after {record.steps} steps"
    return f"trial {record.trial}, seed {record.seed}: {result}"
