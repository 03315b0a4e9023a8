"""Lifelong learning: the matrix of phases with forgetting and transfer, beside the published one."""

from __future__ import annotations

from robocasa_lerobot.data.published import published_task_sets
from robocasa_lerobot.evaluation import published
from robocasa_lerobot.evaluation.report import format as fmt
from robocasa_lerobot.evaluation.report.gather import GROUP_LABELS, LIFELONG_SETS, PolicyResult, ReportData, average_of
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.sections.beside_published import differences
from robocasa_lerobot.evaluation.statistics import Estimate
from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong, lifelong


def section(data: ReportData) -> Section | None:
    """None where fewer than two policies are labelled with the phase that they were trained up to."""
    policies = policies_by_phase(data)
    result = matrix(data)
    if result is None:
        return None
    last = max(result.matrix)
    parts = (
        _heat_map(result),
        _summary(result, last),
        _published(policies),
    )
    text = (
        "Rows are the policy after each phase of training, columns the tasks of each phase. Reading down a column "
        "shows what later phases cost; the diagonal is what a phase reached when it was new.",
    )
    return Section("lifelong", "Lifelong learning", text, parts=parts)


def policies_by_phase(data: ReportData) -> dict[int, PolicyResult]:
    """Lifelong phase -> the policy trained up to it."""
    return {
        policy.info.lifelong_phase: policy
        for policy in sorted(data.policies, key=lambda policy: policy.info.lifelong_phase or 0)
        if policy.info.lifelong_phase is not None
    }


def matrix(data: ReportData) -> Lifelong | None:
    """The matrix and its summaries, if there is one."""
    policies = policies_by_phase(data)
    counts = {
        phase: {
            j: [result.counts for result in policy.group(name)]
            for j, name in enumerate(LIFELONG_SETS, start=1)
            if policy.group(name)
        }
        for phase, policy in policies.items()
        if phase > 0
    }
    counts = {phase: row for phase, row in counts.items() if row}
    if len(counts) < 2:
        return None
    untrained = policies.get(0)
    start = (
        {j: [r.counts for r in untrained.group(name)] for j, name in enumerate(LIFELONG_SETS, 1)} if untrained else {}
    )
    return lifelong(counts, {j: tasks for j, tasks in start.items() if tasks})


def sentence(data: ReportData) -> str | None:
    """What was kept and what was lost, in plain words."""
    result = matrix(data)
    if result is None:
        return None
    last = max(result.matrix)
    text = f"After phase {last} the policy solves {_with_interval(result.average[last])} averaged over the phases"
    if last in result.forgetting:
        lost = result.forgetting[last]
        text += (
            f"; of what earlier phases had reached, {100 * lost.value:.1f} points are forgotten (95 % interval "
            f"{100 * lost.low:.1f} to {100 * lost.high:.1f})"
        )
    return text + "."


def _heat_map(result: Lifelong) -> Table:
    phases = sorted({j for row in result.matrix.values() for j in row})
    columns = (Column("trained up to"), *(Column(GROUP_LABELS[LIFELONG_SETS[j - 1]], numeric=True) for j in phases))
    columns = (*columns, Column("average so far", numeric=True), Column("forgetting, points", numeric=True))
    top = max((one.value for row in result.matrix.values() for one in row.values()), default=0) or 1.0
    rows = []
    for k, row in result.matrix.items():
        cells = [Cell(f"phase {k}")]
        for j in phases:
            one = row.get(j)
            cells.append(
                Cell("")
                if one is None
                else Cell(fmt.percent(one.value), one.value, fmt.interval(one), heat=one.value / top)
            )
        mean, lost = result.average.get(k), result.forgetting.get(k)
        cells.append(
            Cell(fmt.NONE)
            if mean is None
            else Cell(fmt.percent(mean.value), mean.value, fmt.interval(mean), strong=True)
        )
        cells.append(
            Cell(fmt.NONE)
            if lost is None
            else Cell(f"{100 * lost.value:.1f}", 100 * lost.value, fmt.bare_interval(lost), strong=True)
        )
        rows.append(tuple(cells))
    return Table(
        "lifelong-matrix",
        "Success after each phase on the tasks of each phase",
        columns,
        tuple(rows),
        notes=("Darker is more success (lighter in the dark theme). Intervals are 95 %, over exactly these tasks.",),
        sortable=False,
    )


def _summary(result: Lifelong, last: int) -> Table:
    def row(name: str, one: Estimate | None, meaning: str, signed: bool = True) -> tuple[Cell, ...]:
        if one is None:
            return (Cell(name), Cell(fmt.NONE), Cell(meaning))
        text, ends = fmt.points(one.value), fmt.points_interval(one)
        if not signed:
            text, ends = fmt.bare(one.value), fmt.bare_interval(one)
        return (Cell(name), Cell(text, 100 * one.value, ends, strong=True), Cell(meaning))

    rows = (
        row("average success", result.average.get(last), f"after phase {last}, mean over the phases", signed=False),
        row(
            "forgetting",
            result.forgetting.get(last),
            "best earlier success on a phase minus the last; more is worse",
            signed=False,
        ),
        row("backward transfer", result.backward_transfer, "last success on a phase minus that when it was new"),
        row(
            "forward transfer",
            result.forward_transfer,
            "success on a phase before it was trained, minus that of the untrained policy"
            + ("" if result.forward_transfer else " (needs trials of the untrained policy and of later phases)"),
        ),
    )
    columns = (Column("summary"), Column("percent or points", numeric=True), Column("what it is"))
    return Table(
        "lifelong-summary",
        "Lifelong learning in four numbers",
        columns,
        rows,
        notes=(
            "Average, backward and forward transfer: Lopez-Paz and Ranzato, NeurIPS 2017. Forgetting: Chaudhry et al., "
            "ECCV 2018. Intervals treat the phases' trials as independent, which is cautious.",
        ),
        sortable=False,
    )


def _published(policies: dict[int, PolicyResult]) -> Table:
    table = published.table("lifelong")
    columns = [Column("trained")]
    for column in table.columns:
        columns += [Column(column.label, numeric=True, ours=True), Column(column.label, numeric=True, published=True)]
    rows = []
    for row in table.rows:
        policy = policies.get(int(row.key))
        cells = [Cell(row.label)]
        for column in table.columns:
            tasks = policy.group(column.key) if policy else ()
            if tasks:
                mean = average_of(tasks)
                full = len(published_task_sets()[column.key])
                some = "" if len(tasks) == full else f"{len(tasks)} of {full} tasks"
                cells.append(Cell(fmt.percent(mean.value), mean.value, some, strong=True))
            else:
                cells.append(Cell(""))
            value = table.value(row.key, column.key)
            cells.append(Cell("") if value is None else Cell(fmt.published(value), value / 100))
        rows.append(tuple(cells))
    return Table(
        "lifelong-published",
        f"{table.title}: ours and published success",
        tuple(columns),
        tuple(rows),
        notes=(f"Published: {table.source}. {table.notes}",),
        warnings=(published.DIFFERENT_KITCHENS_SHORT, *differences(list(policies.values()), table.protocol)),
        sortable=False,
    )


def _with_interval(one: Estimate) -> str:
    return f"{fmt.percent(one.value)} of trials ({fmt.interval(one)})"
