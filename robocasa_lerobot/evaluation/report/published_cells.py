"""Our numbers in the cells of the published tables: the one place from which page and CSV take them."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report.places import PER_TASK, PERTURBATIONS, Place, tables
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, TaskResult, average_of
from robocasa_lerobot.evaluation.statistics import Estimate

AVERAGE = "average"


@dataclass(frozen=True)
class OurCell:
    """What a policy did in a cell of a published table.

    `row` and `column` are the published keys; `percent` is the number published there, None for an empty cell. `tasks`
    are those of the cell's tasks that the policy was evaluated on, `of` how many the published number is over.
    """

    table: str
    row: str
    column: str
    percent: float | None
    policy: PolicyResult
    tasks: tuple[TaskResult, ...]
    of: int

    @property
    def mean(self) -> Estimate | None:
        """The mean over the cell's tasks; None where some of them were not run, as it is then another number."""
        return average_of(self.tasks) if len(self.tasks) == self.of else None

    @property
    def partial(self) -> Estimate | None:
        """The mean over those that were run, where that is not all of them."""
        return average_of(self.tasks) if len(self.tasks) < self.of else None


def our_cells(data: ReportData, name: str) -> list[OurCell]:
    """All cells of a published table that policies of the report fill, wholly or in part, in the policies' order."""
    found = [(policy, place) for policy in data.policies for place in policy.places if place.table == name]
    if name == PER_TASK:
        return [cell for policy, _ in found for cell in _single_tasks(policy)]
    return [cell for policy, place in found for cell in _cells(policy, place)]


@functools.cache
def tasks_of(name: str) -> frozenset[str]:
    """The tasks of a published group or set; "average" is all 50."""
    if name == AVERAGE:
        return frozenset(published.group_of_task())
    return frozenset(published_task_sets()[name])


def _cells(policy: PolicyResult, place: Place) -> list[OurCell]:
    spec, table, out = tables()[place.table], published.table(place.table), []
    perturbed = spec.get("columns_are") == PERTURBATIONS
    for column in [place.column] if place.column is not None else [one.key for one in table.columns]:
        for row in [place.row] if place.row is not None else [one.key for one in table.rows]:
            wanted = spec.get("tasks") or (row if place.row is None else column)
            condition = column if perturbed else UNPERTURBED
            if perturbed and column not in policy.conditions:
                continue
            whole = tasks_of(wanted)
            tasks = policy.group(wanted, condition)
            if "tasks" in spec:  # no set that an evaluation names
                tasks = tuple(r for r in policy.conditions.get(condition, ()) if r.task in whole)
            # A registry may give a set of its own the benchmark's name: other tasks are no part of the published ones.
            if tasks and {result.task for result in tasks} <= whole:
                value = table.value(row, column)
                out.append(OurCell(place.table, row, column, value, policy, tasks, len(whole)))
    return out


def _single_tasks(policy: PolicyResult) -> list[OurCell]:
    known = published.per_task_rates()
    tasks = policy.conditions.get(UNPERTURBED, ())
    return [OurCell(PER_TASK, r.task, "best", known[r.task], policy, (r,), 1) for r in tasks if r.task in known]
