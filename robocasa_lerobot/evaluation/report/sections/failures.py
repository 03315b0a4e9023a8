"""Why trials failed: which of the goal's terms were never met."""

from __future__ import annotations

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.model import Bar, Cell, Column, Section, Table
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.statistics import Estimate

SHOWN = 15


def section(data: ReportData) -> Section | None:
    """Terms ranked by the trials that they cost; the last policy that failed in full view, the others folded."""
    tables: list[Table] = []
    for policy in reversed(data.policies):
        table = _table(data, policy, folded=bool(tables))
        tables += [table] if table is not None else []
    if not tables:
        return None
    text = (
        "A task's goal is a few terms that must hold together. Of the trials that failed: how often a term was never "
        "met, and how often it was met but lost again by the end. The longest bars are what to work on first.",
    )
    return Section("failures", "Why trials failed", text, parts=tuple(tables))


def sentence(data: ReportData) -> str | None:
    """The term that cost the last policy most trials."""
    found = [(term, result) for result in data.policies[-1].tasks for term in result.terms if term.never]
    if not found:
        return None
    term, result = max(found, key=lambda item: item[0].never)
    return (
        f"The goal most often never met by {data.policies[-1].label} is “{spelled(term.name)}” of {result.task}: in "
        f"{term.never} of {fmt.count(result.failed, 'failed trial')}."
    )


def spelled(term: str) -> str:
    """A term's name for people."""
    return term.replace("_", " ")


def _table(data: ReportData, policy: PolicyResult, folded: bool) -> Table | None:
    found = sorted(
        ((term, result) for result in policy.tasks for term in result.terms if term.never or term.lost),
        key=lambda item: (-item[0].never, -item[0].lost),
    )
    if not found:
        return None
    rows = []
    for term, result in found[:SHOWN]:
        share = term.never / result.failed
        rows.append(
            (
                Cell(spelled(term.name)),
                Cell(result.task, code=True),
                Cell(
                    f"{term.never} of {result.failed}",
                    term.never,
                    bar=Bar(Estimate(share, share, share), loss=True, whisker=False),
                    strong=True,
                ),
                Cell(f"{term.lost}", term.lost),
            )
        )
    more = len(found) - len(rows)
    return Table(
        f"failures-{data.series(policy) + 1}",
        f"{policy.label}: goals that were not met",
        (
            Column("goal"),
            Column("task"),
            Column("never met, of failed trials", numeric=True, wide=True),
            Column("met, then lost", numeric=True),
        ),
        tuple(rows),
        notes=(f"The {len(rows)} that cost most trials; {more} more are left out.",) if more else (),
        folded=folded,
        cards=True,
    )
