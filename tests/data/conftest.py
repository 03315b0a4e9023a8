"""What tests of recipes share."""

from __future__ import annotations

import pytest
from atomic_version import atomic_tasks_only


@pytest.fixture
def atomic_only(monkeypatch: pytest.MonkeyPatch) -> frozenset[str]:
    """Registries of a version that demonstrates the atomic tasks alone."""
    return atomic_tasks_only(monkeypatch)
