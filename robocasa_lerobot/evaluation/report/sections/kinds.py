"""Success by kinds of tasks: stages, mobile or not, family and activity, where a run has enough tasks of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import TaskFacts, task_facts
from robocasa_lerobot.evaluation.report import comparable
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, average_of

# A kind with fewer tasks is an anecdote; a breakdown with one kind says nothing.
MIN_TASKS = 3
MIN_KINDS = 2
MAX_POLICIES = 8
_STAGES = ((1, 1), (2, 2), (3, 3), (4, 5), (6, None))


def section(data: ReportData) -> Section | None:
    """None where the run has not enough tasks of two kinds in any respect.

    What a task is like is known of our own: policies that were tried in another simulator are left out.
    """
    own = [policy for policy in data.policies if policy.simulator is None]
    tables = [table for one in BREAKDOWNS if (table := _table(data, own, *one)) is not None]
    if not tables:
        return None
    text = [
        f"Means over tasks of a kind, each task weighing the same; kinds of fewer than {MIN_TASKS} tasks are left out.",
        _mobile_totals(),
    ]
    if others := [policy.label for policy in data.policies if policy not in own]:
        text.append(f"Without {fmt.listed(others)}, tried in another simulator.")
    if len(own) > MAX_POLICIES:
        text.append(f"The last {MAX_POLICIES} policies; the others are in the tables above.")
    return Section("kinds", "Kinds of tasks", tuple(text), parts=tuple(tables))


def _stages(facts: TaskFacts) -> str | None:
    low, high = next(pair for pair in _STAGES if pair[0] <= facts.subtasks <= (pair[1] or facts.subtasks))
    return f"{low} or more" if high is None else f"{low}" if low == high else f"{low} to {high}"


def _mobile(facts: TaskFacts) -> str | None:
    return "mobile" if facts.mobile else "stationary"


def _family(facts: TaskFacts) -> str | None:
    return "atomic" if facts.family is None else facts.family.replace("_", " ")


def _activity(facts: TaskFacts) -> str | None:
    return None if facts.activity is None else facts.activity.replace("_", " ")


BREAKDOWNS: tuple[tuple[str, str, Callable[[TaskFacts], str | None]], ...] = (
    ("stages", "stages", _stages),
    ("mobile", "base", _mobile),
    ("family", "family of activities", _family),
    ("activity", "activity", _activity),
)


def _table(
    data: ReportData,
    own: Sequence[PolicyResult],
    name: str,
    label: str,
    kind_of: Callable[[TaskFacts], str | None],
) -> Table | None:
    facts = task_facts()
    kinds: dict[str, list[str]] = {}
    for task in (task for task in data.task_names if any(policy.task(task) for policy in own)):
        kind = kind_of(facts[task]) if task in facts else None
        if kind is not None:
            kinds.setdefault(kind, []).append(task)
    kinds = {kind: tasks for kind, tasks in sorted(kinds.items()) if len(tasks) >= MIN_TASKS}
    if len(kinds) < MIN_KINDS:
        return None
    policies = own[-MAX_POLICIES:]
    rows = tuple(
        (Cell(kind), Cell(f"{len(tasks)}", len(tasks)), *(_mean(policy, tasks) for policy in policies))
        for kind, tasks in kinds.items()
    )
    columns = [Column(label), Column("tasks", numeric=True)]
    columns += [Column(policy.label, numeric=True, series=data.series(policy)) for policy in policies]
    title, warnings = f"Success by {label}", comparable.warnings(policies)
    return Table(f"kinds-{name}", title, tuple(columns), rows, warnings=warnings, folded=name == "activity")


def _mean(policy: PolicyResult, tasks: list[str]) -> Cell:
    found = [result for task in tasks if (result := policy.task(task)) is not None]
    if not found:
        return Cell(fmt.NONE)
    mean = average_of(found)
    some = "" if len(found) == len(tasks) else f" · {fmt.count(len(found), 'task')}"
    return Cell(fmt.percent(mean.value), mean.value, fmt.interval(mean) + some, strong=True)


def _mobile_totals() -> str:
    """How many tasks are mobile, by each of the sources that do not agree."""
    own = sum(one.mobile for one in task_facts().values())
    said = [f"{one['mobile']} and {one['stationary']} by {one['where']}" for one in published.read("data")["mobile"]]
    return (
        f"Of the benchmark's 365 tasks {fmt.listed(said)} are mobile and stationary. Here {own} count as mobile: the "
        "list's, but for three target tasks that the paper's tables call stationary."
    )
