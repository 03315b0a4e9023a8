"""A stand-in for Ray: runs each piece at once in this process, and keeps what was asked for."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any
from unittest import mock

import pytest

_GIB = 2**30


class StandIn(ModuleType):
    """Those functions of Ray that we call; `asked` are the resources of each call of `remote`."""

    def __init__(self, **resources: float) -> None:
        super().__init__("ray")
        self.__spec__ = ModuleSpec("ray", None)  # by which it counts as installed
        self.resources: dict[str, float] = {"CPU": 4, "memory": 64 * _GIB, **resources}
        self.asked: list[dict[str, Any]] = []

    def is_initialized(self) -> bool:
        """Always."""
        return True

    def nodes(self) -> list[dict[str, Any]]:
        """One node."""
        return [{"Alive": True, "Resources": self.resources}]

    def put(self, value: Any) -> Any:
        """The value itself."""
        return value

    def remote(self, **asked: Any) -> Callable[[Callable[..., Any]], _Remote]:
        """What turns a function into one that runs elsewhere."""
        self.asked.append(asked)
        return _Remote

    def wait(self, references: Sequence[_Reference], num_returns: int) -> tuple[list[_Reference], list[_Reference]]:
        """The first ones are ready."""
        return list(references[:num_returns]), list(references[num_returns:])

    def get(self, reference: _Reference) -> Any:
        """What the function gives or raises."""
        # datatrove sets variables of the process that runs a piece, which begins where Ray was started.
        with mock.patch.dict(os.environ), contextlib.chdir("/"):
            return reference.function(*reference.arguments)


class _Remote:
    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def options(self, name: str) -> _Remote:
        return self

    def remote(self, *arguments: Any) -> _Reference:
        return _Reference(self._function, arguments)


class _Reference:
    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self.function, self.arguments = function, arguments


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    """A stand-in for Ray with one node of 4 cores and 64 GiB."""
    stand_in = StandIn()
    monkeypatch.setitem(sys.modules, "ray", stand_in)
    return stand_in
