"""Errors that come back from other processes say what they said there."""

from __future__ import annotations

import pickle
from types import SimpleNamespace

import pytest

from robocasa_lerobot.data.registry.registry import MissingDatasetsError
from robocasa_lerobot.errors import UnknownNameError, UserError

MISSING = SimpleNamespace(task="OpenDrawer", split="target", source="human", missing="make it")
ERRORS = [
    UserError("no such file"),
    UnknownNameError("camera", "robot0_agentview_lft", ["robot0_agentview_left"], "(choose with --cameras)"),
    MissingDatasetsError([MISSING]),  # type: ignore[list-item]  # as much of an entry as the message reads
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_survives_being_pickled(error: UserError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.args == error.args
    assert again.__dict__ == error.__dict__
