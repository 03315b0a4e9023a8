"""The benchmark's published results, as data: one JSON file for each table, in percent, with its protocol.

Context, never the same experiment: the published kitchens, objects and simulator are others than ours.
"""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from importlib import resources
from typing import Any

from robocasa_lerobot.errors import UnknownNameError

# Said in the summary of every report, and in short above every table that shows our numbers beside published ones.
PUBLISHED_SCENES = "Published numbers come from RoboCasa's own kitchens, objects and human demonstrations in robosuite"
DIFFERENT_KITCHENS = (
    f"{PUBLISHED_SCENES}; ours come from kitchens made in code, in another simulator. Read them as context, not as "
    "the same experiment."
)
DIFFERENT_KITCHENS_SHORT = "Ours are other kitchens, other objects and another simulator than the published ones."
TABLES = (
    "multi_task",
    "foundation",
    "lifelong",
    "robustness",
    "pretraining_composition",
    "scene_diversity",
    "joint_cotraining",
    "low_rank",
    "real_robot",
)
GR00T = "groot"
# How many tasks each group of the 50 has; averages are weighted by it.
GROUPS = {"atomic_seen": 18, "composite_seen": 16, "composite_unseen": 16}


@dataclass(frozen=True)
class Entry:
    """A row or column: key, label, and facts such as `target_demos` or `steps`."""

    key: str
    label: str
    facts: dict[str, Any]


@dataclass(frozen=True)
class PublishedTable:
    """A published table; `percent[row key][column key]` are success rates, absent where none was given."""

    name: str
    title: str
    source: str
    notes: str
    protocol: dict[str, Any]
    row_head: str
    rows: tuple[Entry, ...]
    columns: tuple[Entry, ...]
    percent: dict[str, dict[str, float]]

    def value(self, row: str, column: str) -> float | None:
        """Percent, or None for an empty cell."""
        return self.percent.get(row, {}).get(column)


def read(name: str) -> dict[str, Any]:
    """The JSON of `published/<name>.json`."""
    path = resources.files(__package__).joinpath(f"{name}.json")
    if not path.is_file():
        raise UnknownNameError("published table", name, (*TABLES, "per_task", "data", "leaderboard"))
    values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return values


@functools.cache
def table(name: str) -> PublishedTable:
    """A table of rows and columns.

    Raises:
        UnknownNameError: no such table.
    """
    values = read(name)
    rows, columns = (tuple(_entry(dict(one)) for one in values.pop(part)) for part in ("rows", "columns"))
    return PublishedTable(rows=rows, columns=columns, **values)


def policy_type(name: str, column: str) -> str:
    """LeRobot's type of the policy whose results a column holds: GR00T, where a table does not say."""
    if name not in TABLES:
        return GR00T
    return next((str(one.facts.get("type", GR00T)) for one in table(name).columns if one.key == column), GR00T)


@functools.cache
def per_task_rates() -> dict[str, float]:
    """Percent of the best published variant on each of the 50 tasks."""
    return {row["task"]: float(row["percent"]) for row in read("per_task")["tasks"]}


@functools.cache
def group_of_task() -> dict[str, str]:
    """Which of the three groups each of the 50 tasks belongs to."""
    return {row["task"]: row["group"] for row in read("per_task")["tasks"]}


def _entry(values: dict[str, Any]) -> Entry:
    return Entry(values.pop("key"), values.pop("label"), values)
