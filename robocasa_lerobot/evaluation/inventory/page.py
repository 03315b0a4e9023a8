"""An inventory as text for the terminal, and as a page with the paper's two figures: stages, and lengths."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Sequence

import numpy as np

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.evaluation.inventory.inventory import VIEWS, Holding
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.formats.charts import Bars, bar_chart
from robocasa_lerobot.evaluation.report.model import Cell, Column, Document, Figure, Section, Series, Table

# Seconds at which the bars of lengths begin; the last has no end.
LENGTHS = (*range(0, 60, 10), *range(60, 180, 30), 180)
MAX_STAGES = 16
_HEADS = ("data", "tasks", "scenes", "demonstrations", "per task", "hours")


def text(name: str, holdings: Sequence[Holding]) -> str:
    """The table of datasets and both distributions, with published numbers below ours."""
    rows = [list(_HEADS)]
    for holding in holdings:
        rows.append([cell.text for cell in _ours(holding)])
        known = _published_row(holding)
        rows += [["  published", *(cell.text for cell in known[1:])]] if known else []
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADS))]
    lines = [f"registry {name}"]
    for row in rows:
        first, *rest = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        lines.append("  ".join((row[0].ljust(len(first)), *rest)).rstrip())
    for table in (_stages_table(holdings), _lengths_table(holdings)):
        lines += ["", table.caption, *_plain(table)]
    return "\n".join((*lines, "", _mobile(holdings)))


def page(name: str, holdings: Sequence[Holding]) -> Document:
    """The same as a page."""
    there = [holding for holding in holdings if holding.demonstrations]
    hours = sum(holding.hours for holding in there)
    demonstrations = sum(len(holding.demonstrations) for holding in there)
    section = Section(
        "datasets",
        "Datasets",
        (
            "What lies on this machine, with the published data of the same split and source beside it.",
            _mobile(holdings),
        ),
        parts=(_table(holdings),),
    )
    figures = Section(
        "lengths",
        "How long tasks and demonstrations are",
        parts=(_figure("stages", _stages_table(holdings), "stages of a task", "tasks"), _lengths_figure(holdings)),
    )
    return Document(
        title=f"Data of the registry {name}",
        headline=f"{fmt.count(demonstrations, 'demonstration')} of {_hours(hours)} hours in "
        f"{fmt.count(sum(len(holding.folders) for holding in there), 'dataset')}.",
        sections=[section, figures],
        made=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        synthetic=False,
        source="the datasets' own tables",
    )


def _hours(hours: float) -> str:
    return f"{hours:,.2f}" if hours < 10 else f"{hours:,.1f}"


def _ours(holding: Holding) -> tuple[Cell, ...]:
    tasks, total, scenes = len(holding.with_data), len(holding.tasks), holding.scenes
    number = len(holding.demonstrations)
    return (
        Cell(holding.name),
        Cell(f"{tasks} of {total}", tasks),
        Cell(fmt.NONE) if scenes is None else Cell(f"{scenes:,}", scenes),
        Cell(f"{number:,}", number),
        Cell(f"{number / tasks:,.0f}", number / tasks) if tasks else Cell(fmt.NONE),
        Cell(_hours(holding.hours), holding.hours),
    )


def _published_row(holding: Holding) -> tuple[Cell, ...] | None:
    for row in published.read("data")["rows"]:
        if (row["split"], row["source"], VIEWS) == (holding.split, holding.source, holding.views):
            keys = ("tasks", "scenes", "demonstrations", "demos_per_task", "hours")
            cells = (Cell(f"{row[key]:,}", row[key], muted=True) for key in keys)
            return (Cell(holding.name, muted=True, tag="published"), *cells)
    return None


def _table(holdings: Sequence[Holding]) -> Table:
    rows = []
    for holding in holdings:
        rows.append(_ours(holding))
        known = _published_row(holding)
        rows += [known] if known else []
    values = published.read("data")
    columns = (Column(_HEADS[0]), *(Column(head, numeric=True) for head in _HEADS[1:]))
    note = f"Published: {values['source']}. {values['notes']}"
    return Table("datasets-table", "Tasks, scenes, demonstrations and hours", columns, tuple(rows), (note,), cards=True)


def _stages_table(holdings: Sequence[Holding]) -> Table:
    facts = task_facts()
    own = {task for holding in holdings for task in holding.with_data if task in facts}
    ours, known = (Counter(facts[task].subtasks for task in tasks) for tasks in (own, facts))
    rows = tuple(
        (Cell(f"{stages}", stages), Cell(f"{ours[stages]}", ours[stages]), Cell(f"{known[stages]}", known[stages]))
        for stages in range(1, MAX_STAGES + 1)
    )
    columns = (Column("stages"), Column("tasks with data here", numeric=True), Column("of all 365", numeric=True))
    return Table("stages-numbers", "How many stages tasks have", columns, rows)


def _lengths_table(holdings: Sequence[Holding]) -> Table:
    there = [holding for holding in holdings if holding.demonstrations]
    columns = [Column("seconds"), *(Column(f"{holding.name}, %", numeric=True) for holding in there)]
    columns.append(Column("mean of a task's human demonstrations, % of 365 tasks", numeric=True, published=True))
    shares = [_shares([one.seconds for one in holding.demonstrations]) for holding in there]
    shares.append(_shares([one.human_seconds for one in task_facts().values()]))
    rows = tuple(
        (Cell(label, LENGTHS[index]), *(Cell(f"{100 * share[index]:.1f}", 100 * share[index]) for share in shares))
        for index, label in enumerate(_length_labels())
    )
    return Table("lengths-numbers", "How long demonstrations are", tuple(columns), rows)


def _length_labels() -> list[str]:
    ends = LENGTHS[1:]
    labels = [f"{low}{fmt.DASH}{high}" for low, high in zip(LENGTHS[:-1], ends, strict=True)]
    return [*labels, f"{LENGTHS[-1]} or more"]


def _shares(seconds: Sequence[float]) -> list[float]:
    counts, _ = np.histogram(seconds, bins=[*LENGTHS, np.inf])
    return [float(count) / len(seconds) for count in counts]


def _figure(name: str, table: Table, x_label: str, y_label: str, shown: int = 8) -> Figure:
    labels = [row[0].text for row in table.rows]
    series = [
        Bars(column.label, number, tuple(float(row[number + 1].value or 0) for row in table.rows))
        for number, column in enumerate(table.columns[1:])
    ][-shown:]
    description = f"{table.caption}, as bars; the table below has the numbers."
    svg = bar_chart(f"{name}-chart", table.caption, description, labels, series, x_label, y_label)
    legend = tuple(Series(one.label, one.series) for one in series)
    return Figure(f"{name}-figure", table.caption, svg, table, description, legend)


def _lengths_figure(holdings: Sequence[Holding]) -> Figure:
    return _figure("lengths", _lengths_table(holdings), "seconds", "share, %")


def _mobile(holdings: Sequence[Holding]) -> str:
    facts = task_facts()
    own = {task for holding in holdings for task in holding.with_data if task in facts}
    mobile = sum(facts[task].mobile for task in own)
    told = [f"{one['mobile']} and {one['stationary']} by {one['where']}" for one in published.read("data")["mobile"]]
    return (
        f"Tasks with data here: {len(own)}, of which {mobile} need a moving base. Of all 365 tasks {fmt.listed(told)} "
        "are mobile and stationary."
    )


def _plain(table: Table) -> list[str]:
    rows = [[column.label for column in table.columns], *([cell.text for cell in row] for row in table.rows)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
