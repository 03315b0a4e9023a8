"""Lifelong learning: the matrix of phases with forgetting and transfer, beside the published one."""

from __future__ import annotations

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.lifelong_series import LifelongSeries, all_series
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.report.published_cells import OurCell, our_cells
from robocasa_lerobot.evaluation.report.sections.beside_published import (
    differences,
    other_kitchens,
    other_types,
    our_cell,
    published_cell,
)
from robocasa_lerobot.evaluation.statistics import Estimate
from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong


def section(data: ReportData) -> Section | None:
    """None where no policy is labelled with the phase that it was trained up to, or nothing can be said of them."""
    found = all_series(data)
    parts: list[Table] = []
    for number, one in enumerate(found, start=1):
        result = one.matrix()
        if result is not None:
            end = f"-{number}" if len(found) > 1 else ""
            of = f" of {one.label}" if len(found) > 1 else ""
            parts += [_heat_map(result, one, end, of), _summary(result, max(result.matrix), end, of)]
    parts += [table] if (table := _published(data)) is not None else []
    if not parts:
        return None
    text = [
        "Rows are the policy after each phase of training, columns the tasks of each phase. Reading down a column "
        "shows what later phases cost; the diagonal is what a phase reached when it was new.",
    ]
    text += [
        f"The phases of {one.label} have other tasks than the published ones, or not all of them: its matrix is to be "
        "read by itself, not beside the published numbers."
        for one in found
        if one.sets and one.other_tasks
    ]
    text += [
        f"The phases of {one.label} are policies of several trainings, which may differ in more than their phase: "
        f"{fmt.listed([policy.label for policy in one.policies.values()])}."
        for one in found
        if one.several
    ]
    text += [
        f"Left out of the matrix of {one.label}, since a column compares the same tasks: {fmt.listed(one.left_out)}."
        for one in found
        if one.left_out
    ]
    return Section("lifelong", "Lifelong learning", tuple(text), parts=tuple(parts))


def matrix(data: ReportData) -> Lifelong | None:
    """The matrix of the last training that has one, and its summaries."""
    found = _with_matrix(data)
    return found[-1].matrix() if found else None


def sentence(data: ReportData) -> str | None:
    """What was kept and what was lost in the last training, in plain words."""
    result = matrix(data)
    if result is None or not result.average:
        return None
    last, found = max(result.average), _with_matrix(data)
    who = f"the policy of {found[-1].label}" if len(found) > 1 else "the policy"
    text = f"After phase {last} {who} solves {_with_interval(result.average[last])} averaged over the phases"
    if last in result.forgetting:
        lost = result.forgetting[last]
        text += (
            f"; of what earlier phases had reached, {fmt.bare(lost.value)} points are forgotten (95 % interval "
            f"{fmt.bare_interval(lost)})"
        )
    later = max(found[-1].policies)
    return text + (f"; phase {later} was not evaluated on all tasks." if later > last else ".")


def _heat_map(result: Lifelong, series: LifelongSeries, end: str, of: str) -> Table:
    phases = sorted({j for row in result.matrix.values() for j in row})
    columns = (Column("trained up to"), *(Column(series.heading(j), numeric=True) for j in phases))
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
            else Cell(fmt.bare(lost.value), 100 * lost.value, fmt.bare_interval(lost), strong=True)
        )
        rows.append(tuple(cells))
    return Table(
        f"lifelong-matrix{end}",
        f"Success{of} after each phase on the tasks of each phase",
        columns,
        tuple(rows),
        notes=("Darker is more success (lighter in the dark theme). Intervals are 95 %, over exactly these tasks.",),
        sortable=False,
    )


def _summary(result: Lifelong, last: int, end: str, of: str) -> Table:
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
        f"lifelong-summary{end}",
        f"Lifelong learning{of} in four numbers",
        columns,
        rows,
        notes=(
            "Average, backward and forward transfer: Lopez-Paz and Ranzato, NeurIPS 2017. Forgetting: Chaudhry et al., "
            "ECCV 2018. Intervals treat the phases' trials as independent, which is cautious.",
        ),
        sortable=False,
    )


def _with_matrix(data: ReportData) -> list[LifelongSeries]:
    return [one for one in all_series(data) if one.matrix() is not None]


def _published(data: ReportData) -> Table | None:
    cells = our_cells(data, "lifelong")
    if not cells:
        return None
    table = published.table("lifelong")
    columns = [Column("trained")]
    for column in table.columns:
        columns += [Column(column.label, numeric=True, ours=True), Column(column.label, numeric=True, published=True)]
    rows = []
    for row in table.rows:
        by_policy: dict[PolicyResult, dict[str, OurCell]] = {}
        for cell in cells:
            if cell.row == row.key:
                by_policy.setdefault(cell.policy, {})[cell.column] = cell
        for policy, own in by_policy.items() or [(None, {})]:
            line = [Cell(row.label, interval=f"ours: {policy.label}" if policy is not None else "")]
            for column in table.columns:
                line += [our_cell(own.get(column.key)), published_cell(table.value(row.key, column.key))]
            rows.append(tuple(line))
    policies = list(dict.fromkeys(cell.policy for cell in cells))
    return Table(
        "lifelong-published",
        f"{table.title}: ours and published success",
        tuple(columns),
        tuple(rows),
        notes=(f"Published: {table.source}. {table.notes}",),
        warnings=(*other_kitchens(policies), *differences(policies, table.protocol), *other_types(cells)),
        sortable=False,
    )


def _with_interval(one: Estimate) -> str:
    return f"{fmt.percent(one.value)} of trials ({fmt.interval(one)})"
