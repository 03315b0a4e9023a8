"""All published tables of the benchmark, folded, so that nobody has to look them up elsewhere."""

from __future__ import annotations

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.evaluation.report.sections.beside_published import published_kitchens

NO_TRIALS = (
    "Measured on a real robot, of which this project has no trials: constants, with nothing of ours beside them."
)
INSPECT = "What lies on this machine: `robocasa-lerobot inspect REGISTRY`."


def section(data: ReportData) -> Section:
    """Every table of the paper, and the leaderboard."""
    parts = [_table(name) for name in published.TABLES]
    parts += [_datasets(), _leaderboard()]
    text = (published_kitchens(data.policies),)
    return Section("published", "The benchmark's published results", text, parts=tuple(parts))


def _table(name: str) -> Table:
    table = published.table(name)
    columns = (Column(table.row_head), *(Column(c.label, numeric=True, published=True) for c in table.columns))
    rows = []
    for row in table.rows:
        cells = [Cell(row.label)]
        for column in table.columns:
            value = table.value(row.key, column.key)
            cells.append(Cell("") if value is None else Cell(fmt.published(value), value / 100))
        rows.append(tuple(cells))
    constants = (NO_TRIALS,) if name == "real_robot" else ()
    protocol = f"{table.source}; {table.protocol['split']} scenes, {table.protocol['trials_per_task']} trials per task."
    return Table(
        f"published-{name}",
        table.title,
        columns,
        tuple(rows),
        (f"{protocol} {table.notes}".strip(), *constants),
        folded=True,
    )


def _datasets() -> Table:
    """How much data there is of what, the benchmark's Table 7."""
    values = published.read("data")
    names = {"tasks": "tasks", "scenes": "scenes", "demos_per_task": "demonstrations per task", "hours": "hours"}
    rows = tuple((Cell(row["setting"]), *(Cell(f"{row[key]:,}", row[key]) for key in names)) for row in values["rows"])
    return Table(
        "published-data",
        values["title"],
        (Column("setting"), *(Column(label, numeric=True, published=True) for label in names.values())),
        rows,
        (f"{values['source']}. {values['notes']} {INSPECT}",),
        folded=True,
    )


def _leaderboard() -> Table:
    values = published.read("leaderboard")
    rows = tuple(
        (Cell(row["model"]), Cell(f"{row['overall']:.1f}{fmt.NBSP}%", row["overall"] / 100)) for row in values["rows"]
    )
    return Table(
        "published-leaderboard",
        values["title"],
        (Column("model"), Column("overall", numeric=True, published=True)),
        rows,
        (f"{values['source']}. {values['notes']}",),
        folded=True,
    )
