"""Which tasks a test walks: all of them, most only among the slow tests; or those that a demonstrator can solve."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from task_sample import SAMPLE_VARIABLE, number_of

from robocasa_lerobot.benchmark.tasks import facts_of
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task

# Among the fast tests: one task of every sort that is declared, and one of every sort that a demonstrator solves.
_SORTS = ("OpenFridge", "TurnOnStove", "PickPlaceToasterToCounter")
_SOLVED = ("OpenDrawer", "CloseDrawer", "PickPlaceCounterToSink")


def solvable() -> tuple[str, ...]:
    """Tasks whose stages all have a skill."""
    return tuple(name for name in task_names() if can_demonstrate(get_task(name)))


def demonstrated(fast: Sequence[str] = _SOLVED) -> list[Any]:
    """Tasks whose stages all have a skill; those that are not among the fast ones are slow tests."""
    return _marked(solvable(), fast)


def every_task(wanted: Callable[[Task], bool] = lambda task: True) -> list[Any]:
    """All tasks, or those wanted; those that are of no sample are slow tests."""
    return _marked([name for name in task_names() if wanted(get_task(name))], (*_SOLVED, *_SORTS, *drawn()))


def sample() -> tuple[str, ...]:
    """The solved tasks of the fast tests."""
    return _SOLVED


def drawn(seed: str | None = None) -> tuple[str, ...]:
    """One atomic and one composite task for this run: they follow from the commit, or from `--task-sample`.

    So the fast tests walk through all tasks in time, and a failure can be repeated.
    """
    seed = os.environ.get(SAMPLE_VARIABLE, "") if seed is None else seed
    kinds = ("atomic", "composite")
    of_kind = [sorted(name for name in task_names() if facts_of(name).kind == kind) for kind in kinds]
    return tuple(names[number_of(seed) % len(names)] for names in of_kind)


def _marked(names: Sequence[str], fast: Sequence[str]) -> list[Any]:
    return [name if name in fast else pytest.param(name, marks=pytest.mark.slow) for name in names]
