"""Which policies are the phases of one lifelong training, and which tasks each phase brought."""

from __future__ import annotations

import re
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.joining import put_together, training_folder
from robocasa_lerobot.evaluation.report.policies import (
    GROUP_LABELS,
    LIFELONG_SETS,
    PolicyResult,
    ReportData,
    TaskResult,
    label_under,
)
from robocasa_lerobot.evaluation.report.published_cells import tasks_of
from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong, lifelong


@dataclass(frozen=True)
class LifelongSeries:
    """The policies of one training by phase (0 is the untrained one), and the task set of each phase by number."""

    label: str
    policies: dict[int, PolicyResult]
    sets: dict[int, str]

    def heading(self, phase: int) -> str:
        """What a phase's tasks are called, with how many there are where the name does not say so."""
        name, number = self.sets[phase], len(self.tasks(phase))
        if name not in LIFELONG_SETS:
            return f"Phase {phase}: {name.replace('_', ' ')} ({number})"
        whole = tasks_of(name)
        if self.tasks(phase) == whole:
            return GROUP_LABELS[name]
        if self.tasks(phase) <= whole:
            return f"{GROUP_LABELS[name]} ({number} of {len(whole)})"
        return f"Phase {phase} ({fmt.count(number, 'other task')})"

    def tasks(self, phase: int) -> frozenset[str]:
        """The tasks of a phase that its cells are over."""
        rows = [row[phase] for row in self.cells.values() if phase in row]
        return frozenset(result.task for result in rows[0]) if rows else frozenset()

    @cached_property
    def cells(self) -> dict[int, dict[int, tuple[TaskResult, ...]]]:
        """Phase trained -> phase evaluated -> results, those of a column all on the same tasks.

        A policy that lacks planned tasks of a phase, or some that the policies with the most of them have, has no cell
        there: trials begin with the longest tasks, so that of a run that was killed the others would be missing.
        """
        out: dict[int, dict[int, tuple[TaskResult, ...]]] = {k: {} for k in self.policies}
        for j, name in self.sets.items():
            ran = {k: policy.group(name) for k, policy in self.policies.items()}
            names = {
                k: frozenset(result.task for result in results)
                for k, results in ran.items()
                if results and not _lacking(self.policies[k], name)
            }
            most = max(map(len, names.values()), default=0)
            widest = [own for own in names.values() if len(own) == most]
            common = frozenset.intersection(*widest) if widest else frozenset()
            for k, own in names.items():
                if common and common <= own:
                    out[k][j] = tuple(result for result in ran[k] if result.task in common)
        return out

    @property
    def left_out(self) -> list[str]:
        """The cells that are not there because their policies lack tasks, in words."""
        out = []
        for k, policy in self.policies.items():
            for j, name in self.sets.items():
                ran, lacking = len(policy.group(name)), len(_lacking(policy, name))
                if j not in self.cells[k] and (ran or lacking):
                    of = max(ran + lacking, len(self.tasks(j)))
                    out.append(f"phase {k} on the tasks of phase {j} ({ran} of {of} were run)")
        return out

    @property
    def other_tasks(self) -> bool:
        """Whether some phase's tasks are not those of the published phase."""
        return any(name not in LIFELONG_SETS or self.tasks(k) != tasks_of(name) for k, name in self.sets.items())

    @property
    def several(self) -> bool:
        """Whether its phases are of several trainings."""
        return len({(one.info.experiment, training_folder(one.info.path)) for one in self.policies.values()}) > 1

    def matrix(self) -> Lifelong | None:
        """The matrix and its summaries; None where fewer than two phases were evaluated."""
        counts = {k: {j: [r.counts for r in cell] for j, cell in row.items()} for k, row in self.cells.items()}
        start = counts.pop(0, {})
        counts = {phase: row for phase, row in counts.items() if row}
        return lifelong(counts, start) if len(counts) > 1 else None


def all_series(data: ReportData) -> list[LifelongSeries]:
    """Every lifelong training of the report; policies that claim the same phase of one are series of their own."""
    found: dict[Hashable, dict[int, PolicyResult]] = {}
    for policy in sorted(data.policies, key=lambda one: one.info.lifelong_phase or 0):
        phase, number = policy.info.lifelong_phase, 0
        if phase is None:
            continue
        key = (policy.info.experiment, training_folder(policy.info.path), policy.condition)
        while phase in found.get((*key, number), {}):
            number += 1
        found.setdefault((*key, number), {})[phase] = policy
    trainings = list(found.values())
    series = [
        dict(sorted(point for number in numbers for point in trainings[number].items()))
        for numbers in put_together(trainings, zero_joins=True)  # an untrained policy is of no training
    ]
    labels = [_label(policies) for policies in series]
    return [
        LifelongSeries(
            f"{label}, {number}" if labels.count(label) > 1 else label, policies, _sets(list(policies.values()))
        )
        for number, (label, policies) in enumerate(zip(labels, series, strict=True), start=1)
    ]


def _label(policies: dict[int, PolicyResult]) -> str:
    names = dict.fromkeys(one.info.experiment for phase, one in policies.items() if phase and one.info.experiment)
    return label_under(" + ".join(names) or "lifelong", policies[max(policies)].condition)


def _lacking(policy: PolicyResult, name: str) -> set[str]:
    """The tasks of a set that a policy's runs planned, and of which it has no trial."""
    members = {task for header in policy.headers for task in header.task_sets.get(name, ())}
    return {task for _, task in policy.planned if task in members} - {result.task for result in policy.tasks}


def _sets(policies: list[PolicyResult]) -> dict[int, str]:
    """Phase -> name of its task set: by the number in a name `..._phase2`, else by the order in the run's header."""
    longest = max((header for policy in policies for header in policy.headers), key=lambda one: len(one.task_sets))
    found: dict[int, str] = {}
    for number, (name, tasks) in enumerate(longest.task_sets.items(), start=1):
        match = re.fullmatch(r".*phase_?(\d+)", name)
        if tasks:
            found[int(match[1]) if match else number] = name
    return dict(sorted(found.items()))
