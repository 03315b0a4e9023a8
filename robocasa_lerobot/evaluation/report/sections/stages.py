"""How far trials come in tasks of several stages, and where they end: rates alone say 0 of most of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Cell, Column, Part, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, TaskResult
from robocasa_lerobot.evaluation.statistics import Estimate

MAX_POLICIES = 8
TEXT = (
    "A stage counts when its own condition holds after all stages before it have counted; what held before the first "
    "step is not progress. A trial that reaches the goal has met all its stages, one that ended in an error none. "
    "Whiskers are Wilson 95 % intervals for so many trials of that mean, on the safe side."
)


def section(data: ReportData) -> Section | None:
    """Mean progress and success side by side, and the stage at which failed trials ended; None for single stages."""
    policies = data.policies[-MAX_POLICIES:]
    names = [task for task in data.task_names if any(_several(policy.task(task)) for policy in policies)]
    if not names:
        return None
    ends = [table for policy in reversed(policies) if (table := _ends(data, policy, names))]
    parts: list[Part] = [_progress(data, policies, names), *ends]
    return Section("stages", "How far trials come", (TEXT,), parts=tuple(parts))


def _several(result: TaskResult | None) -> bool:
    return result is not None and (result.stages or 0) > 1


def _progress(data: ReportData, policies: Sequence[PolicyResult], names: list[str]) -> Table:
    columns = [Column("task"), Column("stages", numeric=True)]
    columns += [Column(policy.label, numeric=True, wide=True, series=data.series(policy)) for policy in policies]
    rows = []
    for name in names:
        results = [policy.task(name) for policy in policies]
        stages = max(result.stages or 0 for result in results if result is not None)
        cells = (_cell(data, policy, result) for policy, result in zip(policies, results, strict=True))
        rows.append((Cell(name, code=True), Cell(f"{stages}", stages), *cells))
    return Table(
        "stages-progress",
        "Mean share of a task's stages that trials met, and how many were solved",
        tuple(columns),
        tuple(rows),
        cards=True,
    )


def _cell(data: ReportData, policy: PolicyResult, result: TaskResult | None) -> Cell:
    progress = None if result is None else result.progress
    if result is None or progress is None:
        return Cell(fmt.NONE)
    rate = result.rate
    return Cell(
        fmt.percent(progress.value),
        progress.value,
        f"{fmt.interval(progress)} · solved {rate.successes}/{rate.trials}",
        bar=Bar(progress, data.series(policy)),
        strong=True,
    )


def _ends(data: ReportData, policy: PolicyResult, names: list[str]) -> Table | None:
    """The stage that failed trials of a policy did not get past, commonest first within each task."""
    rows = [row for name in names if (result := policy.task(name)) is not None for row in _rows(result)]
    if not rows:
        return None
    return Table(
        f"stages-ends-{data.series(policy) + 1}",
        f"{policy.label}: the stage at which failed trials ended",
        (Column("task"), Column("stage", numeric=True), Column("what was to be done"), Column("trials", numeric=True)),
        tuple(rows),
        notes=("In the words of the trial that is named first; objects and places may differ between trials.",),
        folded=True,
        cards=True,
    )


def _rows(result: TaskResult) -> Iterator[tuple[Cell, ...]]:
    failed = [record for record in result.trials if not record.success and record.stages is not None]
    ends = Counter(_stage(record) for record in failed)
    for number, trials in ends.most_common():
        words = next(r.stages.next for r in failed if r.stages is not None and _stage(r) == number)
        place = Cell(fmt.NONE) if number is None else Cell(f"{number}", number)
        share = trials / len(failed)
        bar = Bar(Estimate(share, share, share), loss=True, whisker=False)
        yield (
            Cell(result.task, code=True),
            place,
            Cell(words or "all stages were met, but the goal did not hold as long as it had to"),
            Cell(f"{trials} of {len(failed)}", trials, bar=bar),
        )


def _stage(record: TrialRecord) -> int | None:
    """The number, from 1, of the first stage that a trial did not meet; None where it met all."""
    assert record.stages is not None
    return record.stages.met + 1 if record.stages.met < record.stages.total else None
