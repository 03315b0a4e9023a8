"""Data efficiency: success against target demonstrations, with and without pretraining."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.evaluation import published
from robocasa_lerobot.evaluation.report import format as fmt
from robocasa_lerobot.evaluation.report.charts import Line, line_chart
from robocasa_lerobot.evaluation.report.gather import PolicyResult, ReportData, average_of
from robocasa_lerobot.evaluation.report.model import Cell, Column, Figure, Section, Series, Table
from robocasa_lerobot.evaluation.report.sections.beside_published import ALL_DEMOS, TARGET_ONLY
from robocasa_lerobot.evaluation.statistics.data_efficiency import DataWorth, worth_of_pretraining


def section(data: ReportData) -> Section | None:
    """None where the labels do not give a curve of several amounts of target data."""
    only, pretrained = curves(data)
    if len(only) + len(pretrained) < 3:
        return None
    worth = _worth(only, pretrained)
    parts: list[Figure | Table] = [_figure(only, pretrained)]
    if worth:
        parts.append(_worth_table(worth))
    text = (
        "How success grows with target demonstrations, and how many of them the same success would take without "
        "pretraining.",
    )
    return Section("data-efficiency", "What pretraining is worth", text, parts=tuple(parts))


def curves(data: ReportData) -> tuple[dict[int, PolicyResult], dict[int, PolicyResult]]:
    """Target demonstrations per task -> policy, without and with pretraining."""
    only: dict[int, PolicyResult] = {}
    pretrained: dict[int, PolicyResult] = {}
    for policy in data.policies:
        if policy.info.demo_fraction is None:
            continue
        demos = round(ALL_DEMOS * policy.info.demo_fraction)
        side = only if (policy.info.training_data or "").strip().lower() == TARGET_ONLY else pretrained
        side[demos] = policy
    return dict(sorted(only.items())), dict(sorted(pretrained.items()))


def sentence(data: ReportData) -> str | None:
    """The worth at the smallest amount of target data, in plain words."""
    only, pretrained = curves(data)
    found = [one for one in _worth(only, pretrained) if one.demos > 0]
    if not found:
        return None
    one = found[0]
    bound = f"{one.bound} " if one.bound else ""
    return (
        f"With {one.demos} target demonstrations per task the pretrained policy does as well as {bound}"
        f"{one.equal_demos:.0f} without pretraining{_range(one)}: pretraining is worth {bound}{one.factor:.1f} times "
        "the target data."
    )


def _worth(only: dict[int, PolicyResult], pretrained: dict[int, PolicyResult]) -> list[DataWorth]:
    only = {demos: policy for demos, policy in only.items() if demos > 0}
    if len(only) < 2 or not pretrained:
        return []
    tasks = set.intersection(*({r.task for r in p.tasks} for p in (*only.values(), *pretrained.values())))
    if not tasks:
        return []
    counts = [
        {demos: [r.counts for r in policy.tasks if r.task in tasks] for demos, policy in side.items()}
        for side in (only, pretrained)
    ]
    # A report must say the same each time that it is written.
    return worth_of_pretraining(counts[0], counts[1], np.random.default_rng(0))


def _figure(only: dict[int, PolicyResult], pretrained: dict[int, PolicyResult]) -> Figure:
    lines, rows = [], []
    for number, (name, side) in enumerate((("with pretraining", pretrained), ("target data only", only))):
        if not side:
            continue
        means = {demos: average_of(policy.tasks) for demos, policy in side.items()}
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
                    Cell(_published_text(number == 0, demos)),
                )
            )
    svg = line_chart(
        "data-efficiency-chart",
        "Success against target demonstrations",
        "Success averaged over tasks with 95 % intervals, against target demonstrations per task, with and without "
        "pretraining; the table below has the numbers.",
        lines,
        "target demonstrations per task",
        "success, %",
        x_scale="symlog",
        y_range=(0, 100),
    )
    table = Table(
        "data-efficiency-numbers",
        "Success against target demonstrations",
        (
            Column("training"),
            Column("demonstrations per task", numeric=True),
            Column("success", numeric=True),
            Column("published average", numeric=True, published=True),
        ),
        tuple(rows),
        notes=("Published: GR00T N1.5, average of 50 tasks in target scenes. " + published.DIFFERENT_KITCHENS_SHORT,),
    )
    return Figure(
        "data-efficiency-figure",
        "Success against target demonstrations per task",
        svg,
        table,
        "Averages over tasks with 95 % intervals.",
        tuple(Series(line.label, line.series) for line in lines),
    )


def _published_text(pretrained: bool, demos: int) -> str:
    table = published.table("foundation")
    for column in table.columns:
        if column.facts["pretrained"] is pretrained and column.facts["target_demos"] == demos:
            value = table.value("average", column.key)
            return fmt.NONE if value is None else fmt.published(value)
    return fmt.NONE


def _worth_table(worth: list[DataWorth]) -> Table:
    rows = []
    for one in worth:
        factor = fmt.NONE if one.factor is None else f"{_bound(one.bound)}{one.factor:.1f}×"
        rows.append(
            (
                Cell(f"{one.demos}", one.demos),
                Cell(fmt.percent(one.success), one.success),
                Cell(f"{_bound(one.bound)}{one.equal_demos:.0f}", one.equal_demos, _ends(one), strong=True),
                Cell(factor, one.factor, strong=True),
            )
        )
    return Table(
        "data-worth",
        "How many demonstrations the same success takes without pretraining",
        (
            Column("target demonstrations per task"),
            Column("success", numeric=True),
            Column("equal to, without pretraining", numeric=True),
            Column("worth", numeric=True),
        ),
        tuple(rows),
        notes=(
            "Read off the curve without pretraining, which is taken as straight between its points on a logarithmic "
            "axis of demonstrations. Beyond its ends only a bound can be said (≥ or ≤). Intervals are 95 %, from "
            "trials drawn again within tasks.",
            "Published curves read the same way: 50 demonstrations after pretraining equal 184, worth 3.7×.",
        ),
        sortable=False,
    )


def _bound(bound: str | None) -> str:
    return {"at least": "≥ ", "at most": "≤ "}.get(bound or "", "")


def _ends(one: DataWorth) -> str:
    if one.low is None or one.high is None:
        return ""
    low, high = f"{_bound(one.low_bound)}{one.low:.0f}", f"{_bound(one.high_bound)}{one.high:.0f}"
    return "" if low == high and one.bound else f"{low} to {high}"


def _range(one: DataWorth) -> str:
    return f" (95 % interval {ends})" if (ends := _ends(one)) else ""
