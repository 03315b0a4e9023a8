"""Data efficiency: success against target demonstrations, with and without pretraining, per group and on average."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.efficiency_curves import (
    ALL_DEMOS,
    AVERAGE,
    FEWEST_POINTS,
    Curve,
    GroupCurves,
    all_curves,
    groups,
    published_percent,
)
from robocasa_lerobot.evaluation.report.formats.charts import Line, line_chart
from robocasa_lerobot.evaluation.report.model import Cell, Column, Figure, Section, Series, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.report.sections.beside_published import other_kitchens
from robocasa_lerobot.evaluation.statistics.averages import average_over_tasks
from robocasa_lerobot.evaluation.statistics.data_efficiency import DataWorth


def section(data: ReportData) -> Section | None:
    """None where the labels do not give a curve of several amounts of target data."""
    groups_of_tasks = _groups(data)
    if not groups_of_tasks:
        return None
    found = [group for group in groups_of_tasks if group.is_curve]
    kitchens = other_kitchens([policy for side in curves(data) for policy in side.values()])
    parts: list[Figure | Table] = [_figure(group, kitchens) for group in found]
    if any(group.worth() for group in found):
        parts.append(_worth_table(found))
    text = [
        "How success grows with target demonstrations, and how many of them the same success would take without "
        "pretraining.",
        *_said(data, found),
        *(
            f"{group.label}: no curve, since no {FEWEST_POINTS} of these policies have tasks of it in common."
            for group in groups_of_tasks
            if not group.is_curve
        ),
    ]
    return Section("data-efficiency", "What pretraining is worth", tuple(text), parts=tuple(parts))


def curves(data: ReportData) -> tuple[dict[int, PolicyResult], dict[int, PolicyResult]]:
    """Target demonstrations per task -> policy, without and with pretraining, of the curves that are compared."""
    only, pretrained = _chosen(data)
    return (only.points if only else {}), (pretrained.points if pretrained else {})


def sentence(data: ReportData) -> str | None:
    """The worth at the smallest amount of target data, in plain words, for the average where there is one."""
    what, amount = "target demonstrations per task", _number
    if _others_data(data):
        what, amount = "of the target demonstrations", _share
    for group in _groups(data):
        for one in group.worth() if group.is_curve else ():
            if one.demos > 0:
                bound = f"{one.bound} " if one.bound else ""
                return (
                    f"With {amount(one.demos)} {what} the pretrained policy does as well as {bound}"
                    f"{amount(one.equal_demos)} without pretraining{_range(one, amount)}, on {_which(group)}: "
                    f"pretraining is worth {bound}{one.factor:.1f} times the target data."
                )
    return None


def _chosen(data: ReportData) -> tuple[Curve | None, Curve | None]:
    found = all_curves(data)
    only = next((curve for curve in found if not curve.pretrained), None)
    return only, next((curve for curve in found if curve.pretrained), None)


def _groups(data: ReportData) -> list[GroupCurves]:
    """Of tasks, whether their points are enough for a curve or not; none where the policies are too few for any."""
    only, pretrained = curves(data)
    return groups(only, pretrained) if len(only) + len(pretrained) >= FEWEST_POINTS else []


def _which(group: GroupCurves) -> str:
    if group.key == AVERAGE:
        return f"the average over {fmt.count(group.tasks, 'task')}"
    return f"{fmt.count(group.tasks, 'task')} ({group.label.lower()})"


def _others_data(data: ReportData) -> list[str]:
    """Registries of the policies on the curves that are not the benchmark's."""
    policies = [policy for side in curves(data) for policy in side.values()]
    files = [header.registry for policy in policies for header in policy.headers if header.registry is not None]
    return sorted({Path(file).name for file in files})


def _number(demos: float) -> str:
    return f"{demos:.0f}"


def _share(demos: float) -> str:
    return f"{100 * demos / ALL_DEMOS:.0f} %"


def _said(data: ReportData, found: list[GroupCurves]) -> list[str]:
    """Which policies are on no curve or not on every one, so that none is left out in silence."""
    shown = [curve for curve in _chosen(data) if curve is not None]
    rest = [curve for curve in all_curves(data) if curve not in shown]
    out = []
    files = _others_data(data)
    if files:
        out.append(
            f"Demonstrations are counted as if 100 % were {ALL_DEMOS} of each task, as in the benchmark. The data of "
            f"these policies are of another registry ({fmt.listed(files)}), which may hold other numbers of them: "
            "read the shares, and not the numbers."
        )
    out += [
        f"The points of {curve.label} are of several experiments, which may differ in more than their target data."
        for curve in shown
        if curve.several
    ]
    if rest:
        names = [f"{curve.label} ({', '.join(f'{demos}' for demos in curve.points)})" for curve in rest]
        out.append(
            f"The curves are those of {fmt.listed([curve.label for curve in shown])}. Further policies with their "
            f"demonstrations per task are in the other tables: {fmt.listed(names, 12)}."
        )
    perturbed = [p.label for p in data.policies if p.info.demo_fraction is not None and p.condition != UNPERTURBED]
    if perturbed:
        out.append(f"Without {fmt.listed(perturbed)}, all of whose trials are perturbed.")
    for group in found:
        if group.left_out:
            out.append(f"{group.label}: without {fmt.listed(list(group.left_out))}, which lack some of these tasks.")
    return out


def _figure(group: GroupCurves, kitchens: Sequence[str]) -> Figure:
    lines, rows = [], []
    for number, (name, side) in enumerate((("with pretraining", group.pretrained), ("target data only", group.only))):
        if not side:
            continue
        means = {demos: average_over_tasks(counts) for demos, counts in side.items()}
        lines.append(
            Line(
                name,
                number,
                tuple(means),
                tuple(100 * mean.value for mean in means.values()),
                tuple(100 * mean.low for mean in means.values()),
                tuple(100 * mean.high for mean in means.values()),
                errorbars=True,
            )
        )
        for demos, mean in means.items():
            rows.append(
                (
                    Cell(name),
                    Cell(f"{demos}", demos),
                    Cell(fmt.percent(mean.value), mean.value, fmt.interval(mean)),
                    Cell(_published_text(number == 0, demos, group.key) if group.whole else fmt.NONE),
                )
            )
    some = "" if group.whole else f", {group.tasks} of {group.of} tasks"
    title = f"{group.label}{some}: success against target demonstrations per task"
    svg = line_chart(
        f"data-efficiency-{group.key}-chart",
        title,
        f"Success averaged over {fmt.count(group.tasks, 'task')} with 95 % intervals, against target demonstrations "
        "per task, with and without pretraining; the table below has the numbers.",
        lines,
        "target demonstrations per task",
        "success, %",
        x_scale="symlog",
        y_range=(0, 100),
    )
    table = Table(
        f"data-efficiency-{group.key}-numbers",
        title,
        (
            Column("training"),
            Column("demonstrations per task", numeric=True),
            Column("success", numeric=True),
            Column(group.label, numeric=True, published=True),
        ),
        tuple(rows),
        notes=(" ".join(("Published: GR00T N1.5 in target scenes.", *kitchens)),),
    )
    return Figure(
        f"data-efficiency-{group.key}-figure",
        f"{group.label}{some}",
        svg,
        table,
        f"Averages over {fmt.count(group.tasks, 'task')} with 95 % intervals.",
        tuple(Series(line.label, line.series) for line in lines),
    )


def _published_text(pretrained: bool, demos: int, key: str = AVERAGE) -> str:
    value = published_percent(key, pretrained, demos)
    return fmt.NONE if value is None else fmt.published(value)


def _worth_table(found: list[GroupCurves]) -> Table:
    rows = [_worth_row(group, one, group.published_worth().get(one.demos)) for group in found for one in group.worth()]
    return Table(
        "data-worth",
        "How many demonstrations the same success takes without pretraining",
        (
            Column("tasks"),
            Column("target demonstrations per task", numeric=True),
            Column("success", numeric=True),
            Column("equal to, without pretraining", numeric=True),
            Column("worth", numeric=True, ours=True),
            Column("worth", numeric=True, published=True),
        ),
        tuple(rows),
        notes=(
            "Read off the curve without pretraining, which is taken as straight between its points on a logarithmic "
            "axis of demonstrations. Beyond its ends only a bound can be said (≥ or ≤). Intervals are 95 %, from "
            "trials drawn again within tasks. The published curves are read by the same rule.",
        ),
        sortable=False,
    )


def _worth_row(group: GroupCurves, one: DataWorth, known: DataWorth | None) -> tuple[Cell, ...]:
    some = "" if group.whole else f"{group.tasks} of {group.of} tasks"
    return (
        Cell(group.label, interval=some),
        Cell(f"{one.demos}", one.demos),
        Cell(fmt.percent(one.success), one.success),
        Cell(f"{_bound(one.bound)}{one.equal_demos:.0f}", one.equal_demos, _ends(one), strong=True),
        Cell(_factor(one), one.factor, _factor_ends(one), strong=True),
        Cell(fmt.NONE) if known is None else Cell(_factor(known), known.factor),
    )


def _factor(one: DataWorth) -> str:
    return fmt.NONE if one.factor is None else f"{_bound(one.bound)}{one.factor:.1f}×"


def _factor_ends(one: DataWorth) -> str:
    if one.low is None or one.high is None or not one.demos:
        return ""
    low, high = (
        f"{_bound(one.low_bound)}{one.low / one.demos:.1f}",
        f"{_bound(one.high_bound)}{one.high / one.demos:.1f}",
    )
    return "" if low == high and one.bound else f"{low} to {high}"


def _bound(bound: str | None) -> str:
    return {"at least": "≥ ", "at most": "≤ "}.get(bound or "", "")


def _ends(one: DataWorth, amount: Callable[[float], str] = _number) -> str:
    if one.low is None or one.high is None:
        return ""
    low, high = f"{_bound(one.low_bound)}{amount(one.low)}", f"{_bound(one.high_bound)}{amount(one.high)}"
    return "" if low == high and one.bound else f"{low} to {high}"


def _range(one: DataWorth, amount: Callable[[float], str]) -> str:
    return f" (95 % interval {ends})" if (ends := _ends(one, amount)) else ""
