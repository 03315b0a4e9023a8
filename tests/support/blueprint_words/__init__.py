"""Our words for the blueprints of composite tasks, a module for each activity, as the tasks have."""

from __future__ import annotations

import importlib
import pkgutil

from blueprint_words.ours import Ours


def all_words() -> dict[str, Ours]:
    """Of every composite task, by name."""
    out: dict[str, Ours] = {}
    for found in pkgutil.iter_modules(__path__):
        out |= getattr(importlib.import_module(f"{__name__}.{found.name}"), "OURS", {})
    return out
