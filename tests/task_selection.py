"""Which tasks a test walks: all of them, most only among the slow tests; or those that a demonstrator can solve."""

from __future__ import annotations

from typing import Any

import pytest

from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.registry import get_task, task_names

# Of every sort one: a door, a knob, an object in a narrow place.
_SORTS = ("OpenFridge", "TurnOnStove", "PickPlaceToasterToCounter")


def demonstrated() -> tuple[str, ...]:
    """Tasks whose stages all have a skill."""
    return tuple(name for name in task_names() if can_demonstrate(get_task(name)))


def every_task() -> list[Any]:
    """All tasks; those that are not of the sample are slow tests."""
    fast = {*demonstrated(), *_SORTS}
    return [name if name in fast else pytest.param(name, marks=pytest.mark.slow) for name in task_names()]
