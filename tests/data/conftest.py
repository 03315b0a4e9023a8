"""What tests of recipes share."""

from __future__ import annotations

import pytest
from atomic_version import atomic_tasks_only
from ray_support import ray

__all__ = ["atomic_only", "ray"]


@pytest.fixture
def atomic_only(monkeypatch: pytest.MonkeyPatch) -> frozenset[str]:
    """Registries of a version that demonstrates the atomic tasks alone."""
    return atomic_tasks_only(monkeypatch)
