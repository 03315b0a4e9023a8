"""Which policies make a curve of success against target demonstrations, and on which tasks two curves compare."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report.joining import put_together
from robocasa_lerobot.evaluation.report.policies import GROUP_LABELS, PolicyResult, ReportData
from robocasa_lerobot.evaluation.report.published_cells import AVERAGE, tasks_of
from robocasa_lerobot.evaluation.statistics.averages import Counts
from robocasa_lerobot.evaluation.statistics.data_efficiency import DataWorth, worth_of_pretraining

# Target demonstrations per task of the whole benchmark: 100 %.
ALL_DEMOS = 500
TARGET_ONLY = "target only"
NOTHING = "none"  # no training data at all before the target's
ALL = "all"
FEWEST_POINTS = 3  # of both curves together


@dataclass
class Curve:
    """The policies of one training by target demonstrations per task; `published` if they stand in that table."""

    label: str
    pretrained: bool
    published: bool
    points: dict[int, PolicyResult] = field(default_factory=dict)

    @property
    def several(self) -> bool:
        """Whether its points are of several experiments."""
        return len({policy.info.experiment for policy in self.points.values()}) > 1


@dataclass(frozen=True)
class GroupCurves:
    """Both curves on the tasks of a group that every point was evaluated on.

    `only` and `pretrained` have (successes, trials) of each task by demonstrations; `tasks` of the group's `of` tasks
    are those; `left_out` are the labels of policies that lack some of them.
    """

    key: str
    label: str
    tasks: int
    of: int
    only: Mapping[int, Counts]
    pretrained: Mapping[int, Counts]
    left_out: tuple[str, ...]

    @property
    def is_curve(self) -> bool:
        """Whether there are enough points to show."""
        return len(self.only) + len(self.pretrained) >= FEWEST_POINTS

    @property
    def whole(self) -> bool:
        """Whether these are all tasks of a published group, so that published numbers may stand beside."""
        return self.tasks == self.of and self.key != ALL

    def worth(self) -> list[DataWorth]:
        """What pretraining is worth at each point; nothing where the two curves are not both there."""
        only = {demos: counts for demos, counts in self.only.items() if demos > 0}
        if len(only) < 2 or not self.pretrained:
            return []
        # A report must say the same each time that it is written.
        return worth_of_pretraining(only, self.pretrained, np.random.default_rng(0))

    def published_worth(self) -> dict[int, DataWorth]:
        """The same read off the published curves, by demonstrations."""
        if not self.whole:
            return {}
        values = {pretrained: _published_curve(self.key, pretrained) for pretrained in (False, True)}
        return {one.demos: one for one in worth_of_pretraining(values[False], values[True])}


def all_curves(data: ReportData) -> list[Curve]:
    """Every curve, without and with pretraining, the one that stands in the published table and the longest first."""
    found: dict[Hashable, Curve] = {}
    for policy in data.policies:
        if policy.info.demo_fraction is None or policy.condition != UNPERTURBED:
            continue
        place = next((one for one in policy.places if one.table == "foundation"), None)
        pretrained = _is_pretrained(policy)
        demos, number = round(ALL_DEMOS * policy.info.demo_fraction), 0
        name = policy.info.experiment or ("" if place else policy.info.training_data or "")
        # A second policy at a point that is taken begins a curve of its own: none is left out in silence.
        while demos in found.get((pretrained, name, number), Curve("", True, True)).points:
            number += 1
        label = name or ("with pretraining" if pretrained else TARGET_ONLY)
        curve = found.setdefault((pretrained, name, number), Curve(label, pretrained, place is not None))
        curve.points[demos] = policy
    sides = [[curve for curve in found.values() if curve.pretrained == side] for side in (False, True)]
    curves = [curve for side in sides for curve in _put_together(side)]
    return sorted(curves, key=lambda curve: (curve.pretrained, not curve.published, -len(curve.points)))


def groups(only: Mapping[int, PolicyResult], pretrained: Mapping[int, PolicyResult]) -> list[GroupCurves]:
    """The average of the benchmark's groups and each group, where the policies have several; else all their tasks.

    Those with fewer points than `FEWEST_POINTS` are no curves.
    """
    policies = (*only.values(), *pretrained.values())
    keys: list[str] = [key for key in published.GROUPS if any(policy.group(key) for policy in policies)]
    common = {key: _common(key, policies) for key in ([AVERAGE, *keys] if len(keys) > 1 else keys or [ALL])}
    group_of = published.group_of_task()
    if len(keys) > 1 and len({group_of[task] for task in common[AVERAGE]}) == 1:
        del common[AVERAGE]  # nothing but that group once more
    return [_group(key, tasks, only, pretrained) for key, tasks in common.items()]


def published_percent(key: str, pretrained: bool, demos: int) -> float | None:
    """The published percentage at a point of a group's curve."""
    table = published.table("foundation")
    for column in table.columns:
        if column.facts["pretrained"] is pretrained and column.facts["target_demos"] == demos:
            return table.value(key, column.key)
    return None


def _put_together(curves: Sequence[Curve]) -> list[Curve]:
    """The curves of one side; single points of several experiments as one."""
    out = []
    for numbers in put_together([curve.points for curve in curves]):
        parts = [curves[number] for number in numbers]
        label, published_too = " + ".join(part.label for part in parts), all(part.published for part in parts)
        points = {demos: policy for part in parts for demos, policy in part.points.items()}
        out.append(Curve(label, parts[0].pretrained, published_too, dict(sorted(points.items()))))
    return out


def _is_pretrained(policy: PolicyResult) -> bool:
    table = published.table("foundation")
    keys = [place.column for place in policy.places if place.table == table.name]
    known = next((column for column in table.columns if column.key in keys), None)
    if known is not None:
        return bool(known.facts["pretrained"])
    return (policy.info.training_data or "").strip().lower() not in (TARGET_ONLY, NOTHING)


def _common(key: str, policies: Sequence[PolicyResult]) -> frozenset[str]:
    """The tasks on which points compare: those of the policies with most, or, where too few have them, of all."""
    found = [names for policy in policies if (names := _tasks(policy, key))]
    most = max(map(len, found), default=0)
    common = frozenset[str]().union(*found).intersection(*(names for names in found if len(names) == most))
    if sum(names >= common for names in found if common) >= FEWEST_POINTS:
        return common
    return common.intersection(*found) or common


def _group(
    key: str, common: frozenset[str], only: Mapping[int, PolicyResult], pretrained: Mapping[int, PolicyResult]
) -> GroupCurves:
    policies = (*only.values(), *pretrained.values())
    tasks = {id(policy): _tasks(policy, key) for policy in policies}
    left_out = [policy.label for policy in policies if not common or not tasks[id(policy)] >= common]
    sides = [
        {
            demos: [result.counts for result in policy.tasks if result.task in common]
            for demos, policy in side.items()
            if common and tasks[id(policy)] >= common
        }
        for side in (only, pretrained)
    ]
    of = len(common) if key == ALL else len(tasks_of(key))
    label = {AVERAGE: "Average", ALL: "All tasks"}.get(key) or GROUP_LABELS[key]
    return GroupCurves(key, label, len(common), of, sides[0], sides[1], tuple(left_out))


def _tasks(policy: PolicyResult, key: str) -> frozenset[str]:
    return frozenset(result.task for result in (policy.tasks if key == ALL else policy.group(key)))


def _published_curve(key: str, pretrained: bool) -> dict[int, float]:
    points = (published_percent(key, pretrained, demos) for demos in (0, 50, 150, 500))
    return {demos: value / 100 for demos, value in zip((0, 50, 150, 500), points, strict=True) if value is not None}
