"""The benchmark's 365 tasks and their sets: facts, whether a task can be run here or not."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from importlib import resources

from robocasa_lerobot.errors import UnknownNameError

TARGET_SETS = ("atomic_seen", "composite_seen", "composite_unseen")


@dataclass(frozen=True)
class TaskFacts:
    """What the benchmark says of one of its 365 tasks, whether it can be run here or not.

    `kind` is `atomic` or `composite`. `activity` (one of 60) and its `family` (one of 6) are None for atomic tasks.
    `subtasks` is the number of skills in a row, `mobile` whether the base has to move. `horizon` is RoboCasa 1.0.1's,
    control steps at 20 Hz, None where none is published; `own_horizon` is ours for those, five times the
    demonstrator's median. `human_seconds` is the length of a human demonstration, `note` where our task differs from
    the published one.
    """

    task: str
    kind: str
    family: str | None
    activity: str | None
    subtasks: int
    mobile: bool
    horizon: int | None
    human_seconds: float
    sets: frozenset[str]
    note: str = ""
    own_horizon: int | None = None


@functools.cache
def task_facts() -> dict[str, TaskFacts]:
    """Facts of all of RoboCasa365's tasks by name: its published list of attributes, corrected by the paper's tables.

    The tables list the 50 target tasks. They call three of them stationary that the list calls mobile, and name two
    activities otherwise; all tasks of such an activity have the table's name here.
    """
    text = resources.files(__package__).joinpath("tasks.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text.splitlines()]
    return {row["task"]: TaskFacts(**{**row, "sets": frozenset(row["sets"])}) for row in rows}


@functools.cache
def published_tasks() -> dict[str, tuple[str, frozenset[str]]]:
    """Kind (`atomic`, `composite`) and sets of each of RoboCasa365's tasks, by name."""
    return {name: (facts.kind, facts.sets) for name, facts in task_facts().items()}


@functools.cache
def published_task_sets() -> dict[str, tuple[str, ...]]:
    """The benchmark's task sets by name, with `target50` (the three target sets) and `diversity17`.

    `diversity17` are the atomic target tasks with MimicGen data, those of the scene-diversity experiment.
    """
    sets: dict[str, list[str]] = {}
    for task, (_, names) in published_tasks().items():
        own = set(names)
        own |= {"target50"} if own & set(TARGET_SETS) else set()
        own |= {"diversity17"} if {"atomic_seen", "mimicgen60"} <= own else set()
        for name in own:
            sets.setdefault(name, []).append(task)
    return {name: tuple(tasks) for name, tasks in sorted(sets.items())}


def facts_of(name: str) -> TaskFacts:
    """Facts of one task.

    Raises:
        UnknownNameError: the benchmark has no such task.
    """
    if name not in task_facts():
        raise UnknownNameError("task", name, task_facts())
    return task_facts()[name]
