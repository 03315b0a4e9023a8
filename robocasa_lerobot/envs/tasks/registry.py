"""The tasks by name: every module under `tasks/atomic` and `tasks/composite` declares one or more in `TASKS`."""

from __future__ import annotations

import functools
import importlib
import pkgutil

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.envs.tasks import atomic, composite
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.errors import UnknownNameError


@functools.cache
def _tasks() -> dict[str, Task]:
    found: dict[str, Task] = {}
    for package in (atomic, composite):
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if module.ispkg:
                continue
            for task in importlib.import_module(module.name).TASKS:
                assert task.name not in found, f"task {task.name} is declared twice"
                found[task.name] = task
    return dict(sorted(found.items()))


def task_names() -> tuple[str, ...]:
    """Names of all tasks, sorted."""
    return tuple(_tasks())


def get_task(name: str) -> Task:
    """A task declaration.

    Raises:
        UnknownNameError: no task of that name; the message has the closest ones.
    """
    if name not in _tasks():
        raise UnknownNameError("task", name, _tasks(), "`robocasa-lerobot tasks` lists them.")
    return _tasks()[name]


def task_set(name: str) -> tuple[str, ...]:
    """Names of the registered tasks of a set such as `atomic_seen`, `target50` or `lifelong_phase1`.

    Raises:
        UnknownNameError: no registered task belongs to such a set.
    """
    if name not in task_sets():
        raise UnknownNameError("task set", name, task_sets())
    members = published_task_sets()[name]
    return tuple(task for task in _tasks() if task in members)


def task_sets() -> tuple[str, ...]:
    """Names of the sets that registered tasks belong to, sorted."""
    return tuple(name for name, members in published_task_sets().items() if not _tasks().keys().isdisjoint(members))
