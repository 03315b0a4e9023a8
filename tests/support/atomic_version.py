"""A version that has the atomic tasks alone: of the benchmark's sets some are whole, some partial, some empty.

Tests of what is left out would otherwise change with every composite task.
"""

from __future__ import annotations

import pytest

from robocasa_lerobot.benchmark.tasks import task_facts


def atomic_tasks_only(monkeypatch: pytest.MonkeyPatch) -> frozenset[str]:
    """Plans and registries of this process know the atomic tasks alone; their names."""
    from robocasa_lerobot.data.registry import registry as datasets
    from robocasa_lerobot.envs.tasks import registry as tasks

    atomic = frozenset(name for name, facts in task_facts().items() if facts.kind == "atomic")
    monkeypatch.setattr(datasets, "demonstrated_tasks", lambda: atomic)
    monkeypatch.setattr(tasks, "task_names", lambda: tuple(sorted(atomic)))
    return atomic
