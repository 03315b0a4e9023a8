"""What a number of trials can show: planning before an evaluation, honesty after it."""

from __future__ import annotations

import functools

import numpy as np

from robocasa_lerobot.errors import UserError

ALPHA = 0.05
POWER = 0.8


def mcnemar_power(pairs: int, discordance: float, difference: float, alpha: float = ALPHA) -> float:
    """Probability that the exact McNemar test finds a true difference of two policies' rates.

    Args:
        pairs: trials that both policies run.
        discordance: share of trials that exactly one of them solves, at least `abs(difference)`.
        difference: rate of B minus rate of A.
        alpha: two-sided level of the test.

    The number of discordant trials is binomial; given it, those that B solves are binomial with probability
    `(discordance + difference) / (2 discordance)`, and the test is the exact binomial test of 1/2.

    Raises:
        UserError: no pairs, or a difference larger than the discordance.
    """
    from scipy.stats import binom

    if pairs < 1 or not abs(difference) <= discordance <= 1:
        raise UserError(
            f"power of {pairs} pairs, discordance {discordance:g}, difference {difference:g}: expected at least 1 pair "
            "and |difference| <= discordance <= 1."
        )
    if discordance == 0:
        return 0.0
    counts = np.arange(1, pairs + 1)
    weight = binom.pmf(counts, pairs, discordance)
    counts, weight = counts[weight > 1e-9], weight[weight > 1e-9]
    edges = _reject_below(pairs, alpha)[counts]
    share = min(1.0, max(0.0, (discordance + difference) / (2 * discordance)))
    # Rejected when B solves at most `edge` of the discordant trials, or all but at most `edge`.
    found = binom.cdf(edges, counts, share) + binom.sf(counts - edges - 1, counts, share)
    return float((weight * np.where(edges >= 0, found, 0.0)).sum())


@functools.lru_cache(maxsize=8)
def _reject_below(pairs: int, alpha: float) -> np.ndarray:
    """For m = 0..pairs discordant trials, the largest count with `2 P(X <= count) <= alpha`; -1 where there is none."""
    from scipy.stats import binom

    m = np.arange(pairs + 1)
    edge = binom.ppf(alpha / 2, m, 0.5).astype(int)
    # ppf is the smallest count that reaches alpha / 2; it is itself inside only when it does so exactly.
    edge = np.where(2 * binom.cdf(edge, m, 0.5) <= alpha, edge, edge - 1)
    return np.where(m > 0, edge, -1)


def smallest_difference(
    pairs: int, discordance: float, power: float = POWER, alpha: float = ALPHA, tolerance: float = 1e-4
) -> float | None:
    """The smallest true difference of rates that so many paired trials find with probability `power`.

    `discordance` is the share of trials on which the policies differ, e.g. the observed one; where the difference
    exceeds it, it grows with it. None if not even a difference of 1 is found (fewer than six pairs at 0.05).
    """
    if mcnemar_power(pairs, 1.0, 1.0, alpha) < power:
        return None
    low, high = 0.0, 1.0
    while high - low > tolerance:
        middle = (low + high) / 2
        if mcnemar_power(pairs, max(discordance, middle), middle, alpha) >= power:
            high = middle
        else:
            low = middle
    return high


def independent_discordance(rate_a: float, rate_b: float) -> float:
    """Share of trials on which two policies would differ if their outcomes were independent: for planning."""
    return rate_a * (1 - rate_b) + rate_b * (1 - rate_a)
