"""What tests of recipes share."""

from __future__ import annotations

import pytest

from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.data.registry import registry


@pytest.fixture
def atomic_only(monkeypatch: pytest.MonkeyPatch) -> frozenset[str]:
    """Registries of a version that demonstrates the atomic tasks alone: some sets have all, some, or none of theirs.

    Tests of what is left out would otherwise change with every composite task.
    """
    atomic = frozenset(name for name, facts in task_facts().items() if facts.kind == "atomic")
    monkeypatch.setattr(registry, "demonstrated_tasks", lambda: atomic)
    return atomic
