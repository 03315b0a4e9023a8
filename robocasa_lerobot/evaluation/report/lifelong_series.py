"""Which policies are the phases of one lifelong training, and which tasks each phase brought."""

from __future__ import annotations

import re
from collections.abc import Hashable
from dataclasses import dataclass

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.joining import training_folder
from robocasa_lerobot.evaluation.report.policies import GROUP_LABELS, LIFELONG_SETS, PolicyResult, ReportData
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
        """The tasks of a phase that were run."""
        name = self.sets[phase]
        return frozenset(result.task for policy in self.policies.values() for result in policy.group(name))

    @property
    def other_tasks(self) -> bool:
        """Whether some phase's tasks are not those of the published phase."""
        return any(name not in LIFELONG_SETS or self.tasks(k) != tasks_of(name) for k, name in self.sets.items())

    def matrix(self) -> Lifelong | None:
        """The matrix and its summaries; None where fewer than two phases were evaluated."""
        counts = {
            phase: {
                j: [result.counts for result in policy.group(name)]
                for j, name in self.sets.items()
                if policy.group(name)
            }
            for phase, policy in self.policies.items()
        }
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
        key = (policy.info.experiment, training_folder(policy.info.path))
        while phase in found.get((*key, number), {}):
            number += 1
        found.setdefault((*key, number), {})[phase] = policy
    labels = [_label(policies) for policies in found.values()]
    return [
        LifelongSeries(
            f"{label}, {number}" if labels.count(label) > 1 else label, policies, _sets(list(policies.values()))
        )
        for number, (label, policies) in enumerate(zip(labels, found.values(), strict=True), start=1)
    ]


def _label(policies: dict[int, PolicyResult]) -> str:
    last = policies[max(policies)]
    return last.info.experiment or "lifelong"


def _sets(policies: list[PolicyResult]) -> dict[int, str]:
    """Phase -> name of its task set: by the number in a name `..._phase2`, else by the order in the run's header."""
    longest = max((header for policy in policies for header in policy.headers), key=lambda one: len(one.task_sets))
    found: dict[int, str] = {}
    for number, (name, tasks) in enumerate(longest.task_sets.items(), start=1):
        match = re.fullmatch(r".*phase_?(\d+)", name)
        if tasks:
            found[int(match[1]) if match else number] = name
    return dict(sorted(found.items()))
