"""Errors that a user can act on: what was found, what was expected, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any


class UserError(ValueError):
    """A mistake in what the user asked for or handed in; the command line prints it without a traceback."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Subclasses are made from other things than their message, by which pickle would make them again; a process
        # pool waits for ever for an answer that it cannot read.
        return _again, (type(self), self.args), self.__dict__


def _again(kind: type[UserError], args: tuple[Any, ...]) -> UserError:
    return kind.__new__(kind, *args)


class LackingMachineError(UserError):
    """Something that this machine lacks, such as a package: no other attempt, seed or kitchen would go better."""


# What no other attempt would mend either: a loop over attempts or kitchens lets these through.
OF_THE_MACHINE = (OSError, MemoryError, LackingMachineError)


class WorkerDiedError(UserError):
    """A process that was working did not live to report: killed, out of memory, or crashed."""


class UnknownNameError(UserError):
    """A name that no registry entry has; the message names the closest ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str], remedy: str = "") -> None:
        self.kind, self.name = kind, name
        # What stands where a name should may be anything, None for example.
        super().__init__(f"unknown {kind} {name!r}. {suggest(str(name), known)}{' ' + remedy if remedy else ''}")


def suggest(name: str, known: Iterable[str]) -> str:
    """A sentence with the closest matches of `name`, or with all known names where none is close."""
    names = sorted(set(known))
    if close := closest(name, names):
        return "Did you mean " + " or ".join(repr(c) for c in close) + "?"
    shown = ", ".join(names[:20]) + (f", ... ({len(names)} in all)" if len(names) > 20 else "")
    return f"Known: {shown or 'none'}."


def closest(name: str, known: Iterable[str], cutoff: float = 0.5) -> list[str]:
    """Up to three known names that are like `name`, the most alike first; capitals do not count."""
    by_lower = {one.lower(): one for one in known}
    return [by_lower[match] for match in difflib.get_close_matches(name.lower(), by_lower, n=3, cutoff=cutoff)]


def differing(found: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Those settings of `now` that were others, `seed: 1, now 2`; empty where there are none."""
    return ", ".join(
        f"{key}: {found.get(key)!r}, now {value!r}" for key, value in now.items() if found.get(key) != value
    )
