"""Who decided each step of a demonstration, as recordings by hand say it."""

from __future__ import annotations

from collections.abc import Iterable

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.demo import Demo


def decisions_of(demos: Iterable[Demo]) -> tuple[str, ...]:
    """Those of `contract.DECISIONS` that all of some demos have, in that order."""
    common = contract.DECISIONS
    for demo in demos:
        common = tuple(key for key in common if demo.has(key))
        if not common:
            break
    return common
