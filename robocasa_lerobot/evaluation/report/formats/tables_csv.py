"""The published tables cell by cell with ours beside them, as CSV: a line for each cell and each policy in it."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.report.formats.csv_text import csv_text
from robocasa_lerobot.evaluation.report.places import PER_TASK, tables
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.evaluation.report.published_cells import OurCell, our_cells

COLUMNS = (
    "table",
    "row",
    "column",
    "published",
    "ours",
    "low",
    "high",
    "partial",
    "tasks",
    "of_tasks",
    "successes",
    "trials",
    "policy",
    "policies",
    "experiment",
    "policy_type",
    "published_type",
    "split",
    "published_split",
    "synthetic",
)


def render(data: ReportData) -> str:
    """All numbers in percent. `ours` is empty where not all of a cell's tasks were run: see `partial` then."""
    return csv_text(COLUMNS, _lines(data))


def _lines(data: ReportData) -> Iterator[dict[str, object]]:
    for name in (*published.TABLES, PER_TASK):
        filled: dict[tuple[str, str], list[OurCell]] = {}
        for cell in our_cells(data, name) if name in tables() else ():
            filled.setdefault((cell.row, cell.column), []).append(cell)
        for row, column, percent in _published_cells(name):
            line: dict[str, object] = {
                "table": name,
                "row": row,
                "column": column,
                "published": "" if percent is None else f"{percent:g}",
            }
            ours = filled.get((row, column), [])
            yield from ({**line, **_ours(cell)} for cell in ours)
            if not ours and percent is not None:
                yield line


def _published_cells(name: str) -> Iterator[tuple[str, str, float | None]]:
    if name == PER_TASK:
        yield from ((task, "best", percent) for task, percent in published.per_task_rates().items())
        return
    table = published.table(name)
    yield from (
        (row.key, column.key, table.value(row.key, column.key)) for row in table.rows for column in table.columns
    )


def _ours(cell: OurCell) -> dict[str, object]:
    policy, mean, partial = cell.policy, cell.mean, cell.partial
    values: dict[str, object] = {
        "tasks": len(cell.tasks),
        "of_tasks": cell.of,
        "successes": sum(result.rate.successes for result in cell.tasks),
        "trials": sum(result.rate.trials for result in cell.tasks),
        "policy": policy.label,
        "policies": "; ".join(part.label for part in policy.parts or (policy,)),
        "experiment": policy.info.experiment or "",
        "policy_type": policy.info.type,
        "published_type": published.policy_type(cell.table, cell.column),
        "split": policy.header.split,
        "published_split": published.read(cell.table)["protocol"]["split"],
        "synthetic": int(bool(policy.header.settings.get("synthetic"))),
    }
    if mean is not None:
        values |= {"ours": _percent(mean.value), "low": _percent(mean.low), "high": _percent(mean.high)}
    if partial is not None:
        values["partial"] = _percent(partial.value)
    return values


def _percent(rate: float) -> str:
    return f"{100 * rate:.4f}"
