"""The success rate of one policy on one task."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.wilson import wilson_interval


@dataclass(frozen=True)
class Rate:
    """A success rate with its Wilson 95 % interval; all rates lie in [0, 1]."""

    successes: int
    trials: int
    rate: float
    low: float
    high: float


def success_rate(successes: int, trials: int) -> Rate:
    """The rate of `successes` in `trials` with its Wilson 95 % interval."""
    low, high = wilson_interval(successes, trials)
    return Rate(successes, trials, successes / trials, low, high)
