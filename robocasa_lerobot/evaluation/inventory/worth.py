"""What demonstrations are worth, as text for the terminal and as a page: coverage, sources, diversity, quality."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from robocasa_lerobot.demos.quality.measure import EVERY
from robocasa_lerobot.demos.quality.summary import BIN_M, Quality
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Cell, Column, Document, Section, Table
from robocasa_lerobot.evaluation.statistics import Estimate
from robocasa_lerobot.wilson import wilson_interval


@dataclass(frozen=True)
class Row:
    """A measure: its heading, its value, and how that is written."""

    label: str
    value: Callable[[Quality], float | None]
    written: Callable[[float], str]


def _percent(value: float) -> str:
    return f"{value:.0%}"


def _metres(value: float) -> str:
    return f"{100 * value:.1f} cm"


COVERAGE = (
    Row("starts covered", lambda one: one.covered, _percent),
    Row("most used source", lambda one: one.most_used_source, _percent),
    Row("as of so many sources", lambda one: one.effective_sources, lambda value: f"{value:.1f}"),
)
DIVERSITY = (
    Row("paths apart", lambda one: one.path_spread_m, _metres),
    Row("two most alike", lambda one: one.most_alike_m, _metres),
    Row("spread of stands", lambda one: one.stand_spread_m, _metres),
    Row("of headings", lambda one: one.stand_spread_rad, lambda value: f"{value:.2f} rad"),
    Row("seconds", lambda one: one.mean("seconds"), lambda value: f"{value:.1f}"),
    Row("spread of seconds", lambda one: one.seconds_spread, lambda value: f"{value:.1f}"),
)
QUALITY = (
    Row("jerk", lambda one: one.mean("jerk"), lambda value: f"{value:.0f} m/s³"),
    Row("idle", lambda one: one.mean("idle"), _percent),
    Row("commands at their bound", lambda one: one.mean("saturated"), _percent),
    Row("touches other things", lambda one: one.mean("other_contacts"), _percent),
    Row("target in view", lambda one: one.mean("in_view"), _percent),
)
_MEASURES = {"coverage": COVERAGE, "diversity": DIVERSITY, "quality": QUALITY}
_NOTES = {
    "coverage": (
        "Starts: where the thing that the first stage is about lies before the robot, in squares of "
        f"{100 * BIN_M:.0f} cm; covered is the share of the squares in which an attempt began, in which one began that "
        "was kept. Most used source: its share of all segments. As of so many sources: of how many evenly used "
        "ones the segments would be as mixed.",
    ),
    "segments": (
        "Of the attempts that began such a segment, those that were kept, whatever others failed for; several tries at "
        "one segment count once.",
    ),
    "sources": ("The same by whose segments they are.",),
    "diversity": (
        "Paths: of the hand at the same shares of its time, in the frame of the thing that the first stage is about; "
        "root mean square distance of two demonstrations, on average and of the two that are most alike. Stands: where "
        "the base is at the end, in that frame; standard deviations.",
    ),
    "quality": (
        "Jerk: root mean square of the hand's third derivative. Idle: steps in which neither hand nor base moves. "
        "Touches other things: steps in which the robot touches what no stage is about. Target in view: steps in which "
        "the middle of what the stage is about is in one of the three pictures, whatever stands before it. Both from "
        f"every {EVERY}th step.",
    ),
}


def text(sets: Mapping[str, Sequence[Quality]]) -> str:
    """Tables for the terminal: a line for each task and set."""
    lines = []
    tables = [_table(name, rows, sets) for name, rows in _MEASURES.items()]
    for table in (*tables[:1], *_parts_tables(sets), *tables[1:]):
        lines += [*_shown(table), ""]
    return "\n".join(lines)


def _shown(table: Table) -> list[str]:
    shown = [[column.label for column in table.columns], *([cell.text for cell in row] for row in table.rows)]
    widths = [max(len(row[column]) for row in shown) for column in range(len(shown[0]))]
    return [table.caption, *("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in shown)]


def page(sets: Mapping[str, Sequence[Quality]]) -> Document:
    """The same as a page.

    Args:
        sets: measures of each task, by the name of the set: generated ones, and scripted ones beside them.
    """
    count = sum(len(one.kept) for rows in sets.values() for one in rows)
    sections = [
        Section(
            "coverage",
            "Which starts they cover, and where they come from",
            parts=(_table("coverage", COVERAGE, sets), *_parts_tables(sets)),
        ),
        Section("diversity", "How they differ", parts=(_table("diversity", DIVERSITY, sets),)),
        Section("quality", "How they move", parts=(_table("quality", QUALITY, sets),)),
    ]
    return Document(
        title="What demonstrations are worth",
        headline=f"{fmt.count(count, 'demonstration')}: {', '.join(sets)}.",
        sections=sections,
        made=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        synthetic=False,
        source="the states, actions and settings in the files",
    )


def _table(name: str, rows: Sequence[Row], sets: Mapping[str, Sequence[Quality]]) -> Table:
    several = len(sets) > 1
    columns = [Column("task"), *([Column("set")] if several else [])]
    if name == "coverage":
        columns += [Column("kept", numeric=True), Column("of attempts", numeric=True)]
    columns += [Column(row.label, numeric=True) for row in rows]
    body = []
    for task in sorted({one.task for found in sets.values() for one in found}):
        for label, found in sets.items():
            for one in (each for each in found if each.task == task):
                cells = [Cell(task), *([Cell(label)] if several else [])]
                if name == "coverage":
                    cells += _rate(one)
                body.append((*cells, *(_cell(row, one) for row in rows)))
    captions = {"coverage": "Attempts, starts and sources", "diversity": "Paths, stands, lengths", "quality": "Motion"}
    return Table(f"{name}-table", captions[name], tuple(columns), tuple(body), _NOTES[name], cards=True)


def _parts_tables(sets: Mapping[str, Sequence[Quality]]) -> list[Table]:
    """Of generated demonstrations: what is kept of attempts by the segments that they began, and by their sources."""
    tables = []
    for which, (name, column) in enumerate((("segments", "segment"), ("sources", "source"))):
        several = len(sets) > 1
        head = [Column("task"), *([Column("set")] if several else []), Column(column)]
        head += [Column("kept", numeric=True), Column("of attempts", numeric=True)]
        body = [
            (Cell(one.task), *([Cell(label)] if several else []), Cell(part), *_rated(kept, tried))
            for label, found in sets.items()
            for one in found
            for part, (kept, tried) in one.kept_with(which).items()
        ]
        if body:
            table = f"{name}-table"
            tables.append(Table(table, f"Kept by {column}", tuple(head), tuple(body), _NOTES[name], cards=True))
    return tables


def _rate(one: Quality) -> list[Cell]:
    return _rated(len(one.kept), one.tried)


def _rated(kept: int, tried: int) -> list[Cell]:
    rate = kept / max(tried, 1)
    bar = Bar(Estimate(rate, *wilson_interval(kept, tried)))
    return [Cell(f"{kept:,}", kept), Cell(f"{rate:.0%}", rate, bar=bar)]


def _cell(row: Row, one: Quality) -> Cell:
    value = row.value(one)
    return Cell(fmt.NONE) if value is None else Cell(row.written(value), value)
