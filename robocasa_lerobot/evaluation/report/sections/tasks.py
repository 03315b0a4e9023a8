"""Success on every task."""

from __future__ import annotations

from collections.abc import Sequence

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import TaskFacts, task_facts
from robocasa_lerobot.evaluation.records.results import UNPERTURBED, TrialRecord
from robocasa_lerobot.evaluation.report import comparable
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Cell, Column, Section, Series, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, TaskResult, trial_title
from robocasa_lerobot.evaluation.report.sections.beside_published import differences, other_kitchens
from robocasa_lerobot.evaluation.statistics import Estimate

# More trials than this are a texture, no longer something to point at; with many policies there is no room.
MAX_MARKS, MAX_MARKED_POLICIES = 60, 3
_SAME_KITCHENS = "each square is one trial; the same place is the same kitchen for every policy"
_SAME_STARTS = "each square is one trial; the same place is the same start for every policy"
_OWN_KITCHENS = "each square is one trial"


def section(data: ReportData) -> Section:
    """A row per task with each policy's rate, interval and single trials, and the published rate beside them."""
    marks = len(data.policies) <= MAX_MARKED_POLICIES and all(
        result.rate.trials <= MAX_MARKS for policy in data.policies for result in policy.tasks
    )
    roomy = len(data.policies) <= MAX_MARKED_POLICIES
    # Published rates are of unperturbed trials, and stand beside no others.
    plain = [policy for policy in data.policies if policy.condition == UNPERTURBED]
    tried = {result.task for policy in plain for result in policy.tasks}
    known = {task: rate for task, rate in published.per_task_rates().items() if task in tried}
    # A simulator's tasks may have the names of ours.
    ours = {result.task for policy in data.policies if policy.simulator is None for result in policy.tasks}
    facts = {task: one for task, one in task_facts().items() if task in ours}
    columns = [Column("task")]
    columns += [Column("stages", numeric=True), Column("mobile")] if facts else []
    columns += [Column(policy.label, numeric=True, wide=roomy, series=data.series(policy)) for policy in data.policies]
    if known:
        columns.append(Column("best", numeric=True, published=True))
    rows = []
    for task in data.task_names:
        cells = [Cell(task, code=True)]
        cells += _facts(facts.get(task)) if facts else []
        for policy in data.policies:
            beside = known.get(task) if policy in plain else None
            cells.append(_cell(data, policy, policy.task(task), beside, marks))
        if known:
            value = known.get(task)
            cells.append(Cell(fmt.NONE) if value is None else Cell(f"{value:.0f}{fmt.NBSP}%", value / 100))
        rows.append(tuple(cells))
    notes = ["Whiskers are Wilson 95 % intervals. A trial that ended in an error counts as not solved."]
    if known:
        notes.append(
            "The diamond is the published rate of the best variant: "
            f"{published.read('per_task')['notes'].rstrip('.')}, target scenes, 30 trials."
        )
    protocol = published.read("per_task")["protocol"]
    table = Table(
        "task-rates",
        "Success rate on each task",
        tuple(columns),
        tuple(rows),
        notes=tuple(notes),
        warnings=(
            *comparable.warnings(data.policies),
            *((*other_kitchens(plain), *differences(plain, protocol)) if known else ()),
        ),
        cards=True,
    )
    series = tuple(Series(policy.label, data.series(policy)) for policy in data.policies)
    same = _SAME_KITCHENS if ours else _SAME_STARTS
    legend = "" if not marks else same if _in_line(data.policies) else _OWN_KITCHENS
    return Section("tasks", "Task by task", parts=(table,), legend=series, marks_legend=legend)


def _in_line(policies: Sequence[PolicyResult]) -> bool:
    """Whether trials at the same place of a task's rows of marks have the same start for all policies."""
    starts: dict[str, set[tuple[int, ...]]] = {}
    for policy in policies:
        for result in policy.tasks:
            starts.setdefault(result.task, set()).add(tuple(record.seed for record in result.trials))
    alike = all(not comparable.differences(policy, policies[-1]) for policy in policies)
    return alike and all(len(seeds) == 1 for seeds in starts.values())


def _facts(facts: TaskFacts | None) -> list[Cell]:
    """How many stages a task has, and whether the base must move."""
    if facts is None:
        return [Cell(fmt.NONE), Cell(fmt.NONE)]
    return [Cell(f"{facts.subtasks}", facts.subtasks), Cell("yes" if facts.mobile else "no", int(facts.mobile))]


def _cell(data: ReportData, policy: PolicyResult, result: TaskResult | None, known: float | None, marks: bool) -> Cell:
    if result is None:
        return Cell(fmt.NONE)
    rate = result.rate
    errors = f"; {fmt.count(result.errors, 'error')}" if result.errors else ""
    bar = Bar(Estimate(rate.rate, rate.low, rate.high), data.series(policy), None if known is None else known / 100)
    return Cell(
        fmt.percent(rate.rate),
        rate.rate,
        f"{fmt.interval(rate)} · {rate.successes}/{rate.trials}{errors}",
        bar=bar,
        strong=True,
        marks=tuple((_mark(record), trial_title(record)) for record in result.trials) if marks else (),
    )


def _mark(record: TrialRecord) -> str:
    return "e" if record.error is not None else "s" if record.success else "f"
