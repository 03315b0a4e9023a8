"""Confidence intervals of success rates."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocasa_lerobot.errors import UserError

# Standard normal quantile of 0.975 (a two-sided interval at 95 %).
Z_95 = 1.959963984540054


@dataclass(frozen=True)
class Rate:
    """A success rate with its Wilson 95 % interval; all rates lie in [0, 1]."""

    successes: int
    trials: int
    rate: float
    low: float
    high: float


def wilson_interval(successes: int, trials: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson score interval (low, high) of a binomial proportion.

    The values p for which |p_hat - p| <= z * sqrt(p (1 - p) / n); solved for p this gives the centre
    (p_hat + z^2 / 2n) / (1 + z^2 / n) and the half-width z / (1 + z^2 / n) * sqrt(p_hat (1 - p_hat) / n + z^2 / 4n^2).
    It stays inside [0, 1] and has a sensible width at 0 of n and n of n.
    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927).

    Raises:
        UserError: no trials, or successes outside 0..trials.
    """
    if trials <= 0 or not 0 <= successes <= trials:
        raise UserError(
            f"{successes} successes in {trials} trials: expected at least 1 trial and 0 <= successes <= trials."
        )
    p = successes / trials
    shrink = 1.0 / (1.0 + z * z / trials)
    centre = shrink * (p + z * z / (2 * trials))
    half = shrink * z * math.sqrt(p * (1 - p) / trials + z * z / (4 * trials * trials))
    # The ends are exactly 0 and 1 there; rounding would leave 1e-17.
    low = 0.0 if successes == 0 else centre - half
    high = 1.0 if successes == trials else centre + half
    return low, high


def success_rate(successes: int, trials: int) -> Rate:
    """The rate of `successes` in `trials` with its Wilson 95 % interval."""
    low, high = wilson_interval(successes, trials)
    return Rate(successes, trials, successes / trials, low, high)
